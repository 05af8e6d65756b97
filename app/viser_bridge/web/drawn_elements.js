// Elements of our HTML that the page draws: `<ef-profile data="...">`, with the JSON of `drawProfile`.
import { drawProfile } from "../../web/profile.js";

const STYLE = `
  :host { display: block; }
  svg { display: block; width: 100%; }
  text { fill: var(--dim); font-size: 11px; }
  .name { fill: var(--text); font-size: 12px; }
`;

// What it draws lies in a shadow tree, which updates of the panel leave as it is.
class Profile extends HTMLElement {
  static observedAttributes = ["data"];

  constructor() {
    super();
    const style = Object.assign(document.createElement("style"), { textContent: STYLE });
    this.host = document.createElement("div");
    this.attachShadow({ mode: "open" }).append(style, this.host);
    this.resized = new ResizeObserver(() => this.draw());
  }

  connectedCallback() { this.resized.observe(this); }
  disconnectedCallback() { this.resized.disconnect(); }
  attributeChangedCallback() { this.draw(); }

  draw() { if (this.isConnected) drawProfile(this.host, JSON.parse(this.getAttribute("data"))); }
}

export function defineElements() {
  if (!customElements.get("ef-profile")) customElements.define("ef-profile", Profile);
}
