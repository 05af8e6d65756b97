// Functions for the attributes of our HTML, as `onclick="ef.copy(this, ...)"`. In them `event` is the browser's event, and its
// current target the element with the attribute.

const REST = 200; // ms of rest on a picture before it is enlarged, so that a passing pointer causes no flicker
const NOWHERE = -1; // number of no picture

let over = NOWHERE, resting = 0; // the picture under the pointer, and the timer that reports it

// Where the pointer is along an element, from 0 to 1.
function along(event) {
  const box = event.currentTarget.getBoundingClientRect();
  return (event.clientX - box.left) / box.width;
}

const within = (low, value, high) => Math.max(low, Math.min(high, value));

export const handlers = {
  // The moment under the pointer in a plot of moments 0 to `length` of which those up to `last` exist. `left` and `right`: shares
  // of the plot's width beside its axis.
  moment: (event, length, last, left = 0, right = 0) =>
    within(0, Math.round((along(event) - left) / (1 - left - right) * length), last),

  // The step under the pointer in a strip of steps 1 to `length`.
  step: (event, length) => within(1, Math.ceil(along(event) * length), length),

  // The column under the pointer in a row of `count` columns of `width` px.
  column: (event, count, width) =>
    within(0, Math.floor((event.clientX - event.currentTarget.getBoundingClientRect().left) / width), count - 1),

  // Sends a picture's number once the pointer has rested on it.
  rest: (event, number, picture) => {
    if (event.pointerType !== "mouse" || picture === over) return;
    over = picture;
    clearTimeout(resting);
    resting = setTimeout(() => window.ef(number, picture), REST);
  },

  // Sends that the pointer has left the pictures.
  leave: (event, number) => {
    if (event.pointerType !== "mouse") return;
    over = NOWHERE;
    clearTimeout(resting);
    resting = setTimeout(() => window.ef(number, NOWHERE), REST);
  },

  // Sends the picture that a click or a key has selected; a pending rest must not replace it.
  enlarge: (number, picture) => {
    clearTimeout(resting);
    window.ef(number, picture);
  },

  // Writes the values of the sample under the pointer into the element of class `read-out`. `size`: samples along a side of the
  // cell; the attribute `data-values` holds I / 64, U c / 64 and the weight / 10 000 of all samples, as 16-bit integers in base64.
  readOut: (event, size, threshold) => {
    const picture = event.currentTarget, encoded = picture.dataset.values;
    if (picture.encoded !== encoded) {
      const bytes = Uint8Array.from(atob(encoded), (character) => character.charCodeAt(0));
      Object.assign(picture, { encoded, values: new Int16Array(bytes.buffer) });
    }
    const { values } = picture, box = picture.getBoundingClientRect(), count = values.length / 3;
    const column = Math.floor((event.clientX - box.left) / box.width * size);
    const row = Math.floor((event.clientY - box.top) / box.height * size);
    const out = picture.parentElement.querySelector(".read-out > div");
    if (column < 0 || row < 0 || column + row >= size) {
      out.textContent = "\u00a0";
      return;
    }
    const sample = row * size - row * (row - 1) / 2 + column;
    const observed = values[sample] / 64, reconstruction = values[count + sample] / 64, weight = values[2 * count + sample];
    const residual = observed - reconstruction, sign = residual < 0 ? "\u2212" : "+";
    const facts = [`${row}, ${column}`, `I ${observed.toFixed(1)}`, `U c ${reconstruction.toFixed(1)}`];
    if (weight < 0) facts.push("not seen here");
    else {
      const outlier = Math.abs(residual) > threshold ? " \u25a0 outlier" : "";
      facts.push(`e ${sign}${Math.abs(residual).toFixed(1)}`, `weight ${(weight / 1e4).toFixed(2)}${outlier}`);
    }
    out.textContent = facts.join("\u2003");
  },

  // Copies a text to the clipboard and highlights the button for 0.8 s.
  copy: (button, text) => {
    navigator.clipboard.writeText(text);
    button.classList.add("on");
    setTimeout(() => button.classList.remove("on"), 800);
  },

  // Sends the text of a field when Enter is pressed in it; the field is emptied unless it keeps its text.
  entered: (event, number, keeps) => {
    if (event.key !== "Enter" || event.isComposing) return;
    event.preventDefault();
    const field = event.currentTarget, { value } = field;
    window.eigenfairingInPlace?.delete(field.name);
    if (keeps) field.sent = value;
    else field.value = "";
    window.ef(number, [value, true]);
  },

  // Keeps what is being typed, should the field be drawn anew.
  typed: (field) => { window.eigenfairingInPlace?.set(field.name, field.value); },

  // Sends a text that was typed without Enter.
  left: (field, number) => { if (field.value !== field.sent) window.ef(number, [field.value, false]); },
};
