// Calls `use` with what `find` finds, as soon as it finds something: the page may still be being built.
export function once(find, use) {
  const found = find();
  if (found) use(found);
  else setTimeout(once, 50, find, use);
}

// The element around the 3D view.
export const aroundView = () => window.__viserMutable?.canvas?.parentElement;
