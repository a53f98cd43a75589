// Images and meshes of frames, remembered, and the neighbours fetched ahead.
import { getImage, getPacket } from "./api.js";

const KEPT = 80, AHEAD = 3;
const images = new Map(), meshes = new Map();

function remembered(store, key, make) {
  if (store.has(key)) {
    const found = store.get(key);
    store.delete(key);
    store.set(key, found);
    return found;
  }
  const entry = { value: null, promise: null };
  entry.promise = make().then((value) => { entry.value = value; return value; });
  entry.promise.catch(() => store.delete(key));
  store.set(key, entry);
  while (store.size > KEPT) {
    const [oldest, old] = store.entries().next().value;
    if (old.value && old.value.close) old.value.close();
    store.delete(oldest);
  }
  return entry;
}

export const image = (camera, frame) =>
  remembered(images, `${camera}/${frame}`, () => getImage(`api/image/${encodeURIComponent(camera)}/${frame}`));
export const mesh = (layer, camera, frame) =>
  remembered(meshes, `${layer}/${camera}/${frame}`, () => getPacket(`api/mesh/${layer}/${encodeURIComponent(camera)}/${frame}`));

// Forget the meshes of a layer, of one frame or of all.
export function forget(layer, frame = null) {
  for (const key of [...meshes.keys()]) {
    const [of, , number] = key.split("/");
    if (of === layer && (frame === null || Number(number) === frame)) meshes.delete(key);
  }
}

export function prefetch(camera, frame, first, last, layersOf) {
  for (let step = 1; step <= AHEAD; step++) {
    for (const near of [frame + step, frame - step]) {
      if (near < first || near > last) continue;
      image(camera, near).promise.catch(() => {});
      for (const layer of layersOf(near)) mesh(layer, camera, near).promise.catch(() => {});
    }
  }
}
