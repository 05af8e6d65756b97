// Navigation within the page: tabs, headings and fields.

const TRIES = 50; // 0.1 s each: what is looked for may not have been drawn yet
const SCROLLS = 12; // repetitions once it is there: images above it may still be loading

export function showTab({ title }) {
  const tab = Array.from(document.querySelectorAll("[role=tab]")).find((found) => found.textContent.trim() === title);
  // Tabs of docked panels handle keys and pointer events, those within a panel clicks.
  if (tab?.hasAttribute("data-dock-tab")) tab.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true }));
  else tab?.click();
}

// Scrolls to a heading of a panel; any input by the user ends it.
export function showHeading({ title }) {
  let left = TRIES;
  const stop = () => { left = 0; };
  for (const kind of ["wheel", "pointerdown", "keydown"]) addEventListener(kind, stop, { once: true, capture: true });
  const scroll = () => {
    const heading = Array.from(document.querySelectorAll(".ef h4")).find((found) => found.textContent === title);
    if (heading && left > SCROLLS) left = SCROLLS;
    if (heading && left > 0) heading.scrollIntoView();
    if (left-- > 0) setTimeout(scroll, 100);
  };
  scroll();
}

// Scrolls the panel with an element, given as a CSS selector, to its top.
export function showTop({ inside }) {
  document.querySelector(inside)?.closest(".mantine-ScrollArea-viewport")?.scrollTo(0, 0);
}

// Opens the folder with this title if it is closed, and scrolls to the field with this label.
export function showField({ folder, label }) {
  let left = TRIES;
  const named = (text) => Array.from(document.querySelectorAll("label, p, div, span")).find((e) =>
    e.childElementCount === 0 && e.textContent.trim() === text && e.offsetParent && !e.closest("[role=tab], .ef"));
  const scroll = () => {
    const field = named(label), title = named(folder);
    if (field) {
      field.scrollIntoView({ block: "center" });
      field.animate([{ color: "#ffd43b" }, {}], 3000);
      return;
    }
    if (title && left % 10 === 0) title.click();
    if (left-- > 0) setTimeout(scroll, 100);
  };
  scroll();
}

export function reloadPage({ after }) { setTimeout(() => location.reload(), after); }

export function setTabTitle({ title }) { document.title = title; }
