// Sketches of all frames: loaded, edited, saved stroke by stroke, undone frame by frame.
import { getJson, send, RequestError } from "./api.js";
import { handlesOf, sampled } from "./curve.js";
import { tell } from "./state.js";

const RETRY_MS = 2000, KEPT_STEPS = 60;
const copy = (value) => structuredClone(value);
const listeners = [];
const entries = new Map();
let facts = { take: "", cameras: new Map(), most: 2000 };

export function open(description) {
  facts = {
    take: description.take,
    cameras: new Map(description.cameras.map((camera) => [camera.name, camera])),
    most: description.most_points,
  };
}
export function onSketch(listener) { listeners.push(listener); }
function changed(entry) { for (const listener of listeners) listener(entry); }

function entryOf(camera, frame) {
  const key = `${camera}/${frame}`;
  if (!entries.has(key)) {
    entries.set(key, {
      camera, frame, curves: {}, revision: null, past: [], future: [], loading: null,
      saving: null, dirty: false, refused: "", solved: null,
    });
  }
  return entries.get(key);
}

const memory = (entry) => `vermilion/${facts.take}/${entry.camera}/${entry.frame}`;
function remember(entry) {
  try {
    sessionStorage.setItem(memory(entry), JSON.stringify({
      revision: entry.revision, past: entry.past.slice(-KEPT_STEPS), future: entry.future,
    }));
  } catch { /* undo then ends at a reload */ }
}
function recall(entry) {
  try {
    const kept = JSON.parse(sessionStorage.getItem(memory(entry)) || "null");
    if (kept && kept.revision === entry.revision) Object.assign(entry, { past: kept.past, future: kept.future });
  } catch { /* none */ }
}

function taken(curves) {
  const result = {};
  for (const [name, curve] of Object.entries(curves || {})) {
    const handles = curve.handles || handlesOf(curve.points);
    result[name] = { kind: curve.kind, handles, points: curve.points };
  }
  return result;
}

async function fetchInto(entry) {
  const found = await getJson(`api/sketch/${encodeURIComponent(entry.camera)}/${entry.frame}`);
  entry.revision = found.revision;
  entry.curves = taken(found.curves);
  entry.solved = found.solved;
  entry.past = [];
  entry.future = [];
  entry.refused = "";
  if (found.problem) tell(`The saved sketch cannot be read, a new stroke replaces it: ${found.problem}`, "error");
  recall(entry);
}

// The sketch of a frame, loaded once; its edits stay in the page until they are saved.
export function sketchOf(camera, frame) {
  const entry = entryOf(camera, frame);
  if (entry.revision === null && !entry.loading) {
    entry.loading = fetchInto(entry)
      .catch((error) => tell(error.message, "error"))
      .finally(() => { entry.loading = null; changed(entry); });
  }
  return entry;
}
export async function loaded(camera, frame) {
  const entry = sketchOf(camera, frame);
  await entry.loading;
  return entry;
}

// One step: `change` alters a copy of the curves; what was there can be brought back.
export function edit(entry, change) {
  if (entry.revision === null) return;
  const before = copy(entry.curves);
  change(entry.curves);
  if (JSON.stringify(before) === JSON.stringify(entry.curves)) return;
  entry.past.push(before);
  if (entry.past.length > KEPT_STEPS) entry.past.shift();
  entry.future = [];
  keep(entry);
}
// While a handle is dragged the curve follows; the step is kept when it is let go.
export function begin(entry) { return copy(entry.curves); }
export function commit(entry, before) {
  if (JSON.stringify(before) === JSON.stringify(entry.curves)) return;
  entry.past.push(before);
  entry.future = [];
  keep(entry);
}
export function undo(entry) { step(entry, entry.past, entry.future); }
export function redo(entry) { step(entry, entry.future, entry.past); }
function step(entry, from, to) {
  if (!from.length) return;
  to.push(copy(entry.curves));
  entry.curves = from.pop();
  keep(entry);
}

export function bend(curve) {
  curve.points = sampled(curve.handles).points;
}

function content(entry) {
  const { width, height } = facts.cameras.get(entry.camera);
  const names = Object.keys(entry.curves);
  if (!names.length) return null;
  const inside = ([x, y]) => [Math.min(width, Math.max(0, x)), Math.min(height, Math.max(0, y))]
    .map((value) => Math.round(value * 1000) / 1000);
  const curves = {};
  for (const name of names) {
    const { kind, points, handles } = entry.curves[name];
    curves[name] = { kind, points: points.slice(0, facts.most).map(inside), handles: handles.map(inside) };
  }
  return {
    format: "vermilion sketch", version: 1, unit: "px", camera: entry.camera, frame: entry.frame,
    image_size_px: [width, height], curves,
  };
}

function keep(entry) {
  entry.dirty = true;
  entry.solved = null;
  changed(entry);
  if (!entry.saving) entry.saving = saveAll(entry).finally(() => { entry.saving = null; changed(entry); });
}

async function saveAll(entry) {
  while (entry.dirty) {
    entry.dirty = false;
    try {
      const path = `api/sketch/${encodeURIComponent(entry.camera)}/${entry.frame}`;
      const body = { revision: entry.revision, sketch: content(entry) };
      entry.revision = (await send("PUT", path, body)).revision;
      if (entry.refused) tell("");
      entry.refused = "";
      remember(entry);
      changed(entry);
    } catch (error) {
      if (!(error instanceof RequestError)) throw error;
      tell(error.message, "error");
      entry.refused = error.message;
      if (error.status === 409) {
        entry.dirty = false;
        await fetchInto(entry).catch(() => {});
      } else if (error.status === 0) {
        entry.dirty = true;
        changed(entry);
        await new Promise((done) => setTimeout(done, RETRY_MS));
      }
    }
  }
}

export const isSaved = (entry) => !entry.saving && !entry.dirty && !entry.refused;
export const settled = (entry) => entry.saving || Promise.resolve();

// What other tabs saved: loaded again, where nothing of this page waits.
export function compare(revisions) {
  for (const entry of entries.values()) {
    const now = (revisions[entry.camera] || {})[entry.frame] || "none";
    if (entry.revision === null || entry.loading || entry.saving || entry.dirty || entry.refused) continue;
    if (now !== entry.revision) {
      entry.loading = fetchInto(entry)
        .then(() => tell(`Frame ${entry.frame} was changed in another tab; its newer sketch is shown.`))
        .catch((error) => tell(error.message, "error"))
        .finally(() => { entry.loading = null; changed(entry); });
    }
  }
}
export const unsaved = () => [...entries.values()].filter((entry) => !isSaved(entry));
