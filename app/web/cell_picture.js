// Pictures of cells: the samples of a cell as a triangle of coloured pixels, enlarged onto a canvas.
// A cell to draw is {size, color}: the samples along a side, and a function from the number of a sample to [red, green, blue].

export const CELL_COLORS = { empty: [36, 39, 43], masked: [58, 62, 68], zero: 18 };

const small = document.createElement("canvas"); // a pixel a sample

// Draws a cell into a square of a canvas; null leaves the square empty.
export function drawCell(context, x, y, side, cell) {
  context.fillStyle = `rgb(${CELL_COLORS.empty})`;
  context.fillRect(x, y, side, side);
  if (!cell) return;
  const { size, color } = cell, image = new ImageData(size, size);
  for (let r = 0, s = 0; r < size; r++)
    for (let c = 0; c < size; c++) {
      const rgb = r + c < size ? color(s++) : CELL_COLORS.empty, at = 4 * (r * size + c);
      image.data[at] = rgb[0]; image.data[at + 1] = rgb[1]; image.data[at + 2] = rgb[2]; image.data[at + 3] = 255;
    }
  Object.assign(small, { width: size, height: size });
  small.getContext("2d").putImageData(image, 0, 0);
  context.imageSmoothingEnabled = size > side;
  context.imageSmoothingQuality = "high";
  context.drawImage(small, x, y, side, side);
}

// The cells of a photo on a canvas, side by side, one a kind. `cellOf(view, kind)`: the cell; null: the canvas stays blank.
export function drawCells(canvas, { view, kinds, side, gap, cellOf }) {
  Object.assign(canvas, { width: kinds.length * (side + gap) - gap, height: side });
  const context = canvas.getContext("2d");
  if (!context || !cellOf) return;
  kinds.forEach((kind, column) => drawCell(context, column * (side + gap), 0, side, cellOf(view, kind)));
}
