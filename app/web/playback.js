// Playback: the controls of time (buttons and slider) and the moment they choose.
import { $ } from "./dom.js";

export class Playback {
  // `length`: a function to the number of steps; `rate`: one to moments a second; `moment`: one to the present moment; `go`:
  // shows a moment; `onStop`: called when playing has stopped.
  constructor({ length, rate, moment, go, onStop }) {
    Object.assign(this, { length, rate, moment, go, onStop, isOn: false });
    $("slider").addEventListener("input", () => this.jump(Number($("slider").value)));
    for (const [id, to] of Object.entries({ first: () => 0, last: length, back: () => moment() - 1, forward: () => moment() + 1 }))
      $(id).addEventListener("click", () => this.jump(to()));
    $("play").addEventListener("click", () => this.play(!this.isOn));
  }

  // Goes to a moment chosen by the user and stops playing.
  jump(moment) {
    if (this.isOn) this.play(false);
    this.go(moment);
  }

  play(isOn) {
    if (isOn && this.moment() === this.length()) this.go(0);
    this.isOn = isOn && this.length() > 0;
    $("play").classList.toggle("on", this.isOn);
    $("play").setAttribute("aria-label", this.isOn ? "Pause" : "Play");
    $("play").title = this.isOn ? "Pause (Space)" : "Play (Space)";
    [this.since, this.from] = [performance.now(), this.moment()];
    if (this.isOn) requestAnimationFrame((now) => this.tick(now));
    else this.onStop();
  }

  tick(now) {
    if (!this.isOn) return;
    const target = this.from + Math.max(0, now - this.since) / 1000 * this.rate(), moment = Math.min(this.length(), Math.floor(target));
    if (moment !== this.moment()) this.go(moment);
    if (target >= this.length()) this.play(false);
    else requestAnimationFrame((next) => this.tick(next));
  }

  // What keys do that every page with a run has.
  get keys() {
    return { " ": () => this.play(!this.isOn), Home: () => this.jump(0), End: () => this.jump(this.length()) };
  }

  // Shows which moment is the present one.
  show() {
    const moment = this.moment(), length = this.length();
    Object.assign($("slider"), { max: length, value: moment });
    $("slider").setAttribute("aria-valuetext", `moment ${moment} of ${length}`);
    $("moment").textContent = `${moment} / ${length}`;
  }
}
