// The eigenspace of a face's cells, their residuals and robust weights: mirrors `fit_face` and `weigh` in fairing/kernels
// (eigenspace.py, robust.py).
const FILL_ROUNDS = 3;

// `observed`: a Float32Array (p) per photo; `counts`: a Uint8Array (p) per photo, or null if all samples count; `options`:
// removeBias, centered. Returns {observed, reconstruction, residual}, each with an array (p) per photo, the basis images (k)
// of p samples, and all singular values in descending order.
export function fitEigenspace(observed, counts, k, options) {
  const n = observed.length, p = observed[0].length, cells = observed.map((cell) => cell.slice());
  const masked = counts.some((count) => count !== null);
  const isCounted = (i, t) => counts[i] === null || counts[i][t];
  if (options.removeBias) cells.forEach((cell, i) => shift(cell, -meanOf(cell, (t) => isCounted(i, t))));
  if (masked) {
    for (let t = 0; t < p; t++) {
      let total = 0, count = 0;
      for (let i = 0; i < n; i++) if (isCounted(i, t)) { total += cells[i][t]; count++; }
      for (let i = 0; i < n; i++) if (!isCounted(i, t)) cells[i][t] = total / Math.max(count, 1);
    }
  }
  let residual = [], basis = [], singular = [];
  for (let round = 0; round < (masked ? FILL_ROUNDS + 1 : 1); round++) {
    if (options.centered) takeMeanOff(cells);
    ({ residual, basis, singular } = residualOf(cells, k));
    if (!masked) break;
    for (let i = 0; i < n; i++)
      if (counts[i]) for (let t = 0; t < p; t++) if (!counts[i][t]) { cells[i][t] -= residual[i][t]; residual[i][t] = 0; }
  }
  const reconstruction = observed.map((cell, i) => {
    const bias = options.removeBias || options.centered ? meanOf(cell, (t) => isCounted(i, t)) - meanOf(cells[i], (t) => isCounted(i, t)) : 0;
    return cell.map((value, t) => (isCounted(i, t) ? value - residual[i][t] : cells[i][t] + bias));
  });
  return { observed, reconstruction, residual, basis, singular };
}

function meanOf(values, isCounted) {
  let total = 0, count = 0;
  for (let t = 0; t < values.length; t++) if (isCounted(t)) { total += values[t]; count++; }
  return total / Math.max(count, 1);
}

function shift(values, by) { for (let t = 0; t < values.length; t++) values[t] += by; }

function takeMeanOff(cells) {
  for (let t = 0; t < cells[0].length; t++) {
    const mean = cells.reduce((sum, cell) => sum + cell[t], 0) / cells.length;
    for (const cell of cells) cell[t] -= mean;
  }
}

// The residual I - U c: with the first k right singular vectors V of the cells, it is I (1 - V V'). The basis is U = I V / s.
function residualOf(cells, k) {
  const n = cells.length, p = cells[0].length, gram = cells.map((a, i) => cells.map((b, j) => (j <= i ? product(a, b) : 0)));
  for (let i = 0; i < n; i++) for (let j = i + 1; j < n; j++) gram[i][j] = gram[j][i];
  const { values, vectors } = symmetricEigen(gram);
  const order = [...values.keys()].sort((a, b) => values[b] - values[a]), singular = order.map((m) => Math.sqrt(Math.max(0, values[m])));
  const used = order.slice(0, k).filter((m) => values[m] > 0);
  const residual = cells.map((cell, i) => {
    const rest = cell.slice();
    cells.forEach((other, j) => {
      const share = used.reduce((sum, m) => sum + vectors[i][m] * vectors[j][m], 0);
      for (let t = 0; t < p; t++) rest[t] -= share * other[t];
    });
    return rest;
  });
  const basis = used.map((m) => {
    const image = new Float32Array(p), length = Math.sqrt(values[m]);
    cells.forEach((cell, i) => { for (let t = 0; t < p; t++) image[t] += vectors[i][m] / length * cell[t]; });
    return image;
  });
  return { residual, basis, singular };
}

function product(a, b) {
  let total = 0;
  for (let t = 0; t < a.length; t++) total += a[t] * b[t];
  return total;
}

// Jacobi eigenvalue algorithm: rotates two axes at a time until the matrix is diagonal. vectors[i][m]: entry i of eigenvector m.
function symmetricEigen(matrix) {
  const n = matrix.length, A = matrix.map((row) => [...row]), V = A.map((row, i) => row.map((_, j) => Number(i === j)));
  const size = Math.hypot(...A.flat());
  for (let round = 0; round < 60; round++) {
    let off = 0;
    for (let i = 0; i < n; i++) for (let j = 0; j < i; j++) off = Math.max(off, Math.abs(A[i][j]));
    if (off <= 1e-15 * size) break;
    for (let i = 0; i < n; i++)
      for (let j = 0; j < i; j++) {
        if (A[i][j] === 0) continue;
        const theta = (A[j][j] - A[i][i]) / (2 * A[i][j]);
        const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1)), c = 1 / Math.sqrt(t * t + 1), s = t * c;
        for (let m = 0; m < n; m++) [A[m][i], A[m][j]] = [c * A[m][i] - s * A[m][j], s * A[m][i] + c * A[m][j]];
        for (let m = 0; m < n; m++) [A[i][m], A[j][m]] = [c * A[i][m] - s * A[j][m], s * A[i][m] + c * A[j][m]];
        for (let m = 0; m < n; m++) [V[m][i], V[m][j]] = [c * V[m][i] - s * V[m][j], s * V[m][i] + c * V[m][j]];
      }
  }
  return { values: A.map((row, m) => row[m]), vectors: V };
}

// The sum of rho(e) and the weights rho'(e) / e. `table`: rho(x) / x^2, then rho'(x) / x, at 1 / (1 + x) = 0 ... 1, with x = |e|
// over the root of `scale`; linear in between.
export function weigh(residual, table, scale) {
  const weights = new Float32Array(residual.length), sigma = Math.sqrt(scale), points = table.length / 2;
  let total = 0;
  for (let t = 0; t < residual.length; t++) {
    const place = (points - 1) * sigma / (sigma + Math.abs(residual[t])), k = Math.min(Math.floor(place), points - 2);
    const at = (first) => table[first + k] + (place - k) * (table[first + k + 1] - table[first + k]);
    total += at(0) * residual[t] * residual[t] / scale;
    weights[t] = at(points) / scale;
  }
  return { total, weights };
}
