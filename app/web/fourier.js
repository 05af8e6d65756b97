// Fast Fourier transform, and filtering of small images with it.
const twiddles = new Map();

// Transforms a signal of power-of-two length in place, unscaled. `sign`: -1 forward, 1 inverse.
function fourier(re, im, sign) {
  const n = re.length;
  if (!twiddles.has(n)) twiddles.set(n, [Math.cos, Math.sin].map((wave) => Float64Array.from({ length: n / 2 }, (_, k) => wave(2 * Math.PI * k / n))));
  const [cosine, sine] = twiddles.get(n);
  for (let i = 1, j = 0; i < n; i++) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j |= bit;
    if (i < j) { [re[i], re[j]] = [re[j], re[i]]; [im[i], im[j]] = [im[j], im[i]]; }
  }
  for (let half = 1; half < n; half *= 2) {
    const step = n / (2 * half);
    for (let first = 0; first < n; first += 2 * half)
      for (let k = 0; k < half; k++) {
        const a = first + k, b = a + half, c = cosine[k * step], s = sign * sine[k * step];
        const x = re[b] * c - im[b] * s, y = re[b] * s + im[b] * c;
        re[b] = re[a] - x; im[b] = im[a] - y;
        re[a] += x; im[a] += y;
      }
  }
}

// Multiplies the spectrum of a plane (high x wide) by `transfer(wx, wy)`, radians per pixel, in place, with zero padding.
export function filtered(plane, wide, high, transfer) {
  const across = 2 ** Math.ceil(Math.log2(wide)), down = 2 ** Math.ceil(Math.log2(high));
  const re = new Float64Array(across * down), im = new Float64Array(across * down);
  for (let y = 0; y < high; y++) re.set(plane.subarray(y * wide, (y + 1) * wide), y * across);
  const rows = (sign) => { for (let y = 0; y < down; y++) fourier(re.subarray(y * across, (y + 1) * across), im.subarray(y * across, (y + 1) * across), sign); };
  const columns = (work) => {
    const r = new Float64Array(down), i = new Float64Array(down);
    for (let x = 0; x < across; x++) {
      for (let y = 0; y < down; y++) { r[y] = re[y * across + x]; i[y] = im[y * across + x]; }
      work(r, i, x);
      for (let y = 0; y < down; y++) { re[y * across + x] = r[y]; im[y * across + x] = i[y]; }
    }
  };
  const turn = (k, n) => 2 * Math.PI * (k < n / 2 ? k : k - n) / n;
  rows(-1);
  columns((r, i, x) => {
    fourier(r, i, -1);
    for (let y = 0; y < down; y++) { const share = transfer(turn(x, across), turn(y, down)) / (across * down); r[y] *= share; i[y] *= share; }
    fourier(r, i, 1);
  });
  rows(1);
  for (let y = 0; y < high; y++) plane.set(re.subarray(y * across, y * across + wide), y * wide);
}
