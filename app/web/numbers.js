// A number as text with so many significant decimals, as `number` of app/html.py writes it: 12 345, 0.00123, 17.0, 1.2e-07.
export function brief(value, digits = 3) {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const size = Math.abs(value), sign = value < 0 ? "\u2212" : "";
  if (size < 1e-4 || size >= 1e7) return sign + size.toExponential(digits - 1).replace(/([+-])(\d)$/, "$10$2");
  const magnitude = Number(size.toExponential(6).split("e")[1]);
  const [whole, decimals] = size.toFixed(Math.max(0, digits - 1 - magnitude)).split(".");
  return sign + [whole.replace(/\B(?=(\d{3})+$)/g, "\u2009"), ...(decimals ? [decimals] : [])].join(".");
}

// The same without zeros at its end, as ticks are labelled: 17, 0.5.
export const tickLabel = (value, digits = 3) => brief(value, digits).replace(/(\.\d*?)0+(?=e|$)/, "$1").replace(/\.(?=e|$)/, "");
