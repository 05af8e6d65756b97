// Unpacks the arrays of the page: base64, deflate, byte planes, zigzag coding of signed numbers. See packing.py.
const ARRAY_KINDS = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, i2: Int16Array, i4: Int32Array, f4: Float32Array };

// Replaces every packed array in a tree of data by its typed array, in place.
export async function unpack(tree) {
  const works = [];
  const visit = (node) => {
    for (const [key, value] of Object.entries(node)) {
      if (value === null || typeof value !== "object") continue;
      if ("deflated" in value) works.push(unpacked(value).then((array) => { node[key] = array; }));
      else visit(value);
    }
  };
  visit(tree);
  await Promise.all(works);
  return tree;
}

async function unpacked({ kind, deflated }) {
  const bytes = Uint8Array.from(atob(deflated), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const Kind = ARRAY_KINDS[kind], width = Kind.BYTES_PER_ELEMENT, count = planes.length / width;
  const joined = new Uint8Array(planes.length);
  for (let b = 0; b < width; b++) for (let i = 0; i < count; i++) joined[width * i + b] = planes[b * count + i];
  const values = new Kind(joined.buffer);
  if (kind[0] === "i") for (let i = 0; i < count; i++) values[i] = (values[i] >>> 1 & 2 ** (8 * width - 1) - 1) ^ -(values[i] & 1);
  return values;
}
