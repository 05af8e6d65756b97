// Completion of names: a list of suggestions below the text field, filtered by the name before the caret.
export function completeNames({ most }) {
  if (window.eigenfairingComplete) return;
  let field = null, list = null, found = [], active = -1;
  const close = () => {
    list?.remove();
    field?.setAttribute("aria-expanded", "false");
    field?.removeAttribute("aria-activedescendant");
    [field, list, found, active] = [null, null, [], -1];
  };
  const typed = (input) => input.value.slice(0, input.selectionStart).match(/[A-Za-z_]\w*$/)?.[0] ?? "";
  const insert = (input, word, before) => {
    const at = input.selectionStart ?? input.value.length, rest = input.value.slice(at);
    const text = rest.startsWith("(") ? word.replace(/\(.*$/, "") : word;
    const value = input.value.slice(0, at - before.length) + text;
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(input, value + rest);
    input.focus();
    input.setSelectionRange(value.length, value.length);
    close();
    input.dispatchEvent(new Event("input", { bubbles: true }));
    close();
  };
  window.eigenfairingComplete = (name, word) => {
    const input = document.querySelector(`input[data-words][name="${CSS.escape(name)}"]`);
    if (!input) return;
    const at = input.value.length, gap = at && !/[\s(]$/.test(input.value) ? " " : "";
    input.setSelectionRange(at, at);
    insert(input, gap + word, "");
  };
  const mark = (n) => {
    active = n;
    [...list.children].forEach((option, k) => option.setAttribute("aria-selected", String(k === active)));
    if (active < 0) field.removeAttribute("aria-activedescendant");
    else field.setAttribute("aria-activedescendant", list.children[active].id);
  };
  const open = (input) => {
    const before = typed(input);
    close();
    if (!before) return;
    const words = JSON.parse(input.dataset.words);
    found = words.filter(([word]) => word.toLowerCase().startsWith(before.toLowerCase()) && word !== before).slice(0, most);
    if (!found.length) return;
    field = input;
    list = document.createElement("div");
    list.className = "ef suggestions";
    list.id = "eigenfairing-suggestions";
    list.setAttribute("role", "listbox");
    list.setAttribute("aria-label", `Names for ${input.name}`);
    found.forEach(([word, meaning], k) => {
      const option = list.appendChild(document.createElement("div"));
      option.id = `eigenfairing-suggestion-${k}`;
      option.setAttribute("role", "option");
      option.append(Object.assign(document.createElement("code"), { textContent: word }),
        Object.assign(document.createElement("span"), { textContent: meaning, className: "dim" }));
      option.addEventListener("pointerdown", (event) => { event.preventDefault(); insert(input, word, before); });
    });
    const box = input.getBoundingClientRect();
    document.body.append(list);
    list.style.left = `${Math.max(4, Math.min(box.left, innerWidth - list.offsetWidth - 4))}px`;
    const below = box.bottom + 2, fits = below + list.offsetHeight < innerHeight;
    list.style.top = `${fits ? below : box.top - list.offsetHeight - 2}px`;
    input.setAttribute("aria-expanded", "true");
    mark(-1);
  };
  window.addEventListener("input", (event) => { if (event.target.dataset?.words) open(event.target); });
  window.addEventListener("focusout", (event) => { if (event.target === field) close(); });
  window.addEventListener("keydown", (event) => {
    if (!field || event.target !== field) return;
    const takes = event.key === "Tab" || (event.key === "Enter" && active >= 0);
    if (event.key === "ArrowDown") mark((active + 1) % found.length);
    else if (event.key === "ArrowUp") mark((active <= 0 ? found.length : active) - 1);
    else if (takes) insert(field, found[Math.max(active, 0)][0], typed(field));
    else if (event.key === "Escape") close();
    else { if (event.key === "Enter") close(); return; }
    event.preventDefault();
    event.stopImmediatePropagation();
  }, true);
}
