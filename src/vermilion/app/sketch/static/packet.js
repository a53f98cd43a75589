// Reads what packet.py writes: a JSON header, then the bytes of its arrays.
const TYPES = { float32: Float32Array, uint32: Uint32Array, uint8: Uint8Array };

export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let offset = 4 + length;
  const arrays = {};
  for (const { name, type, shape } of header.arrays) {
    const count = shape.reduce((product, n) => product * n, 1);
    arrays[name] = new TYPES[type](buffer, offset, count);
    offset += Math.ceil(arrays[name].byteLength / 4) * 4;
  }
  return { header, ...arrays };
}
