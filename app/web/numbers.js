// A number as text: 12 345, 0.00123, 1.2e-7.
export function brief(value, digits = 3) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e-4 && size < 1e9) {
    const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
    const text = size >= 1e4 || decimals === 0 ? Math.round(value).toString() : Number(value.toFixed(Math.min(decimals, 12))).toString();
    return text.replace(/\B(?=(\d{3})+(?!\d))/g, (match, _, at) => (text.indexOf(".") > -1 && at > text.indexOf(".") ? "" : "\u2009")).replace("-", "\u2212");
  }
  return value.toExponential(digits - 1).replace("-", "\u2212");
}
