// Events of our own HTML, sent as changes of a text input of viser's that is never displayed.
import { handlers } from "./handlers.js";

// `afterTyping`: ms; `uuid`: of the text input.
export function installEvents({ afterTyping, uuid }) {
  if (!window.ef) {
    window.addEventListener("input", (event) => {
      if (event.target.matches(".mantine-Input-input")) window.efTyped = performance.now();
    }, true);
  }
  const waiting = [];
  let count = 0;
  const send = () => {
    const typing = (window.efTyped ?? -Infinity) + afterTyping - performance.now(), page = window.__viserMutable;
    if (typing > 0 || !page) return void setTimeout(send, page ? typing : 50); // the page is still being built
    for (const event of waiting.splice(0))
      page.sendMessage({type: "GuiUpdateMessage", uuid, updates: { value: JSON.stringify(event) }});
  };
  const report = (event, value) => {
    waiting.push([++count, event, value ?? null]);
    send();
  };
  window.ef = Object.assign(report, handlers);
}
