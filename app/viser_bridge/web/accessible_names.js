// Names of viser's own widgets, set whenever the page has changed.
export function nameWidgets() {
  if (window.eigenfairingNames) return;
  const icons = { "tabler-icon-list-search": "All commands", "tabler-icon-adjustments": "Viewer settings" };
  const treeActions = {
    "caret-right": "Expand", "caret-down": "Collapse", "eye": "Hide", "eye-off": "Show", "eye-x": "Clear visibility of",
    "pencil": "Edit props for",
  };
  const set = (element, name) => {
    if (name && element.getAttribute("aria-label") !== name) element.setAttribute("aria-label", name);
  };
  const makeButton = (element, press) => {
    if (element.role === "button") return;
    element.role = "button";
    element.tabIndex = 0;
    element.addEventListener("keydown", (event) => {
      if (event.target !== element || !["Enter", " "].includes(event.key)) return;
      event.preventDefault();
      event.stopPropagation();
      press();
    });
  };
  const label = () => {
    for (const widget of document.querySelectorAll("[role=slider]:not([aria-labelledby]), .mantine-Flex-root input")) {
      let row = widget.closest(".mantine-Flex-root"); // a slider stands with its number in a row within the named one
      while (row && !row.querySelector(":scope > * label, :scope > label"))
        row = row.parentElement.closest(".mantine-Flex-root");
      set(widget, row?.querySelector(":scope > * label, :scope > label").textContent.trim());
    }
    for (const button of document.querySelectorAll("button:not(.ef button)")) {
      if (button.textContent.trim() || (button.getAttribute("aria-label") && !button.dataset.named)) continue;
      const icon = [...(button.querySelector("svg")?.classList ?? [])].find((name) => name.startsWith("tabler-icon-"));
      button.dataset.named = "yes";
      set(button, icons[icon] ?? (icon ?? "button").replace("tabler-icon-", "").replaceAll("-", " "));
    }
    for (const palette of document.querySelectorAll("[role=dialog]:has([class*=mantine-Spotlight])")) {
      set(palette, "All commands");
      palette.querySelectorAll(".mantine-ScrollArea-viewport").forEach((list) => { list.tabIndex = 0; });
    }
    for (const arrow of document.querySelectorAll(".mantine-Paper-root > .mantine-Paper-root > svg[class*=chevron]")) {
      const title = arrow.parentElement;
      title.setAttribute("aria-expanded", arrow.classList.contains("tabler-icon-chevron-up"));
      makeButton(title, () => title.click());
    }
    for (const logo of document.querySelectorAll(".mantine-TextInput-section img")) {
      logo.alt = "";
      set(logo.closest(".mantine-TextInput-root").querySelector("input"), "Server URL");
    }
    for (const input of document.querySelectorAll("[data-prop-key] input"))
      set(input, input.closest("[data-prop-key]").firstElementChild.textContent);
    for (const icon of document.querySelectorAll("[data-scene-node] > * > svg")) {
      const button = icon.parentElement, row = button.parentElement, isOf = (kind) => icon.matches(".tabler-icon-" + kind);
      if (isOf("caret-right") && row.style.cursor !== "pointer") continue; // without children
      const does = Object.keys(treeActions).find(isOf);
      if (!does) continue;
      set(button, `${treeActions[does]} ${row.dataset.sceneNode}`);
      const events = isOf("eye") || isOf("eye-off") ? ["mousedown", "mouseup"] : ["click"];
      makeButton(button, () => {
        for (const event of events)
          button.querySelector("svg").dispatchEvent(new MouseEvent(event, { bubbles: true }));
      });
    }
  };
  let due = 0;
  window.eigenfairingNames = new MutationObserver(() => { due ||= setTimeout(() => { due = 0; label(); }, 200); });
  window.eigenfairingNames.observe(document.body, { childList: true, subtree: true, attributeFilter: ["aria-label"] });
  label();
}
