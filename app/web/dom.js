// Elements of a page.

export const $ = (id) => document.getElementById(id);

export function element(name, attributes = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key in node) node[key] = value;
    else node.setAttribute(key, value);
  }
  node.append(...children);
  return node;
}

const SVG = "http://www.w3.org/2000/svg";

export function svg(name, attributes, parent) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  parent?.append(node);
  return node;
}

// A small button that switches something on or off.
export function chip(label, isOn, act, title = "") {
  return element("button", { type: "button", className: isOn ? "chip on" : "chip", title, "aria-pressed": String(isOn), onclick: act }, label);
}

export function press(button, isOn) {
  button.classList.toggle("on", isOn);
  button.setAttribute("aria-pressed", String(isOn));
}

export const label = (text) => element("span", { className: "dim" }, text);

// Replaces the buttons of a group; the focused one keeps the focus.
export function fillGroup(id, children) {
  const host = $(id), at = [...host.children].indexOf(document.activeElement);
  host.replaceChildren(...children);
  if (at >= 0) host.children[at]?.focus();
}
