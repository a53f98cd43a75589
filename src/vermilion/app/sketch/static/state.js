// What the page shows now, and who wants to know when that changes.
export const state = {
  frame: 0, camera: "", curve: "upper_inner", tool: "draw", kind: "sure", handle: -1,
  layer: "after", overlay: "off", contours: true, onion: false, magnet: true,
  brightness: 1, wireframe: false, distance: false, review: false, playing: false,
};
const listeners = [];

export function onChange(listener) { listeners.push(listener); }

export function set(changes) {
  const changed = Object.keys(changes).filter((name) => state[name] !== changes[name]);
  if (!changed.length) return;
  Object.assign(state, changes);
  for (const listener of listeners) listener(new Set(changed));
}

let messenger = () => {};
export function tellWith(show) { messenger = show; }
// A sentence for the person; kind "error" stays until the next one.
export function tell(sentence, kind = "info") { messenger(sentence, kind); }
