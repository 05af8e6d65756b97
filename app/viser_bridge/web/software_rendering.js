// viser's warning about software rendering closes by itself.
export function closeWarning({ after }) {
  setTimeout(() => document.querySelector("#webgl-software-rendering button")?.click(), after);
}
