// The page: puts its parts together.
import { getJson, getPacket, send } from "./api.js";
import { bindKeys, build } from "./controls.js";
import { handlesOf, sampled } from "./curve.js";
import { Drawing } from "./drawing.js";
import * as frames from "./frames.js";
import { ImageView } from "./image_view.js";
import { MeshView } from "./mesh_view.js";
import * as propagation from "./propagation.js";
import * as review from "./review.js";
import * as book from "./sketch_book.js";
import { onChange, set, state, tell, tellWith } from "./state.js";
import { Timeline } from "./timeline.js";

const byId = (id) => document.getElementById(id);
const POLL_MS = 1000, MARGIN = 0.45;
let facts, topology, status, view, second, mesh3d = null, timeline, drawing, framed = "";

tellWith((sentence, kind) => {
  const line = byId("message");
  line.textContent = sentence;
  line.title = sentence;
  line.className = kind === "error" ? "error" : "";
});

const sketch = () => book.sketchOf(state.camera, state.frame);
const cameraFacts = () => facts.cameras.find((camera) => camera.name === state.camera);
const isSolved = (frame) => status.solved.includes(frame);
// The layer "after" of a frame: solved here, else propagated.
function afterLayer(frame) {
  if (state.review) return status.propagated.includes(frame) ? "propagated" : null;
  return isSolved(frame) ? "refined" : status.propagated.includes(frame) ? "propagated" : null;
}
const layersOf = (frame) => ["base", afterLayer(frame)].filter(Boolean);

function goTo(frame) {
  set({ frame: Math.min(facts.last, Math.max(facts.first, frame)), handle: -1 });
}
function jump(step) {
  const line = status.suggested.filter((frame) => !status.sketched.includes(frame));
  if (!line.length) { tell("No frame is suggested; the workflow suggests new ones when it propagates."); return; }
  const at = line.indexOf(state.frame);
  goTo(line[(at + step + (at < 0 && step < 0 ? 1 : 0) + line.length) % line.length]);
}

// Showing -----------------------------------------------------------------------------------------
function show() {
  const { frame, camera } = state, layer = afterLayer(frame), here = () => state.frame === frame && state.camera === camera;
  const image = frames.image(camera, frame), base = frames.mesh("base", camera, frame);
  const after = layer ? frames.mesh(layer, camera, frame) : { value: null, promise: Promise.resolve(null) };
  put(image.value, base.value, after.value);
  const failed = (error) => { if (here()) tell(error.message, "error"); };
  for (const part of [image, base, after]) {
    part.promise.then(() => { if (here()) put(image.value, base.value, after.value); }).catch(failed);
  }
  frames.prefetch(camera, frame, facts.first, facts.last, layersOf);
}
function put(image, base, after) {
  for (const shown of [view, second]) Object.assign(shown, { image, base, after, sketch: sketch(), topology });
  view.onion = onionSketch();
  if (base && framed !== state.camera && !drawing.gesture) { framed = view.canvas.dataset.framed = state.camera; fitMouth(); }
  view.draw();
  if (state.review) second.draw();
  const packet = state.layer === "after" && after ? after : base;
  if (mesh3d && packet && !state.review) {
    const scale = Math.max(0.5, after ? after.header.largest_mm : 0.5);
    mesh3d.show(packet, scale);
    byId("ramp-text").textContent = `0 to ${scale.toFixed(1)} mm from the ${facts.sequence === "base" ? "track" : "sequence"}`;
  }
  tags(after);
}
function tags(after) {
  const layer = afterLayer(state.frame);
  const name = state.layer === "before" || !after ? "before" : layer === "refined" ? "solved" : "propagated";
  byId("left-tag").textContent = state.review ? "Before" : "";
  byId("right-tag").textContent = state.review
    ? (after ? "After" : "After: this frame was not propagated") : name[0].toUpperCase() + name.slice(1);
}
function fitMouth() {
  const box = view.base && review.boxOf(view.base, MARGIN);
  if (box) view.fit(box);
  else fitImage();
}
function fitImage() { const { width, height } = cameraFacts(); view.fit([0, 0, width, height]); }
function onionSketch() {
  if (!state.onion) return null;
  const frame = neighbourDrawn();
  return frame === null ? null : book.sketchOf(state.camera, frame);
}
// The frame whose sketch serves as a start: the nearest one before, else after.
function neighbourDrawn() {
  const drawn = Object.keys(status.revisions[state.camera] || {}).map(Number).sort((a, b) => a - b);
  const before = drawn.filter((frame) => frame < state.frame), after = drawn.filter((frame) => frame > state.frame);
  return before.length ? before[before.length - 1] : after.length ? after[0] : null;
}

function controls() {
  const entry = sketch(), { frame } = state, press = (id, on) => byId(id).setAttribute("aria-pressed", String(Boolean(on)));
  byId("frame-text").textContent = `Frame ${frame} (${facts.first} to ${facts.last})`;
  for (const name of facts.curves) press(`curve-${name}`, name === state.curve);
  for (const tool of ["draw", "erase", "pan"]) press(`tool-${tool}`, tool === state.tool);
  for (const name of ["onion", "magnet", "contours"]) press(name, state[name]);
  press("overlay", state.overlay !== "off");
  byId("overlay").firstChild.textContent = state.overlay === "off" ? "Mesh " : `Mesh: ${state.overlay} `;
  press("near", (entry.curves[state.curve] || state).kind === "near");
  press("before", state.layer === "before"); press("wireframe", state.wireframe); press("distance", state.distance);
  byId("magnet").disabled = !cameraFacts().magnet;
  byId("undo").disabled = !entry.past.length; byId("redo").disabled = !entry.future.length;
  byId("solve").disabled = !Object.keys(entry.curves).length && !status.sketched.includes(frame);
  byId("legend").hidden = !state.distance || state.review;
  byId("brightness").value = state.brightness;
  document.body.classList.toggle("review", state.review);
  for (const [id, hidden] of [["mesh", state.review], ["second", !state.review], ["review", !state.review], ["right-bar", state.review]]) byId(id).hidden = hidden;
  for (const id of ["from-mesh", "copy", "onion", "magnet", "near"]) byId(id).hidden = state.review;
  const waiting = book.unsaved().length, saved = byId("saved");
  saved.textContent = entry.refused ? "not saved" : waiting ? "saving..." : "saved";
  saved.className = entry.refused ? "unsaved" : "";
  const solved = entry.solved;
  byId("solve-text").textContent = solved && isSolved(frame)
    ? `solved in ${solved.seconds.toFixed(2)} s, ${solved.mean_px.toFixed(2)} px off the strokes (at most ${solved.largest_px.toFixed(2)})` : "";
  timeline.show(status, frame);
  if (state.review) review.thumbnails(status, state.camera, goTo, frame);
}

// Doing -------------------------------------------------------------------------------------------
async function solve() {
  const entry = sketch(), { frame } = entry;
  await book.settled(entry);
  if (entry.refused) { tell(`This sketch is not saved, so it cannot be solved. ${entry.refused}`, "error"); return; }
  tell("Solving...");
  try {
    const found = await send("POST", `api/solve/${frame}`);
    entry.solved = found;
    frames.forget("refined", frame);
    await poll();
    set({ layer: "after" });
    tell(found.warning || `Frame ${frame} is solved.`, found.warning ? "error" : "info");
  } catch (error) {
    tell(error.message, "error");
  }
  show(); controls();
}
async function copyNeighbour() {
  const frame = neighbourDrawn();
  if (frame === null) { tell("No other frame of this camera is drawn yet."); return; }
  const [entry, other] = await Promise.all([book.loaded(state.camera, state.frame), book.loaded(state.camera, frame)]);
  book.edit(entry, (curves) => Object.assign(curves, structuredClone(other.curves)));
  tell(`The curves of frame ${frame} are the start: drag them where the lips are now.`);
}
async function fromMesh() {
  const { camera, frame, curve } = state, entry = await book.loaded(camera, frame);
  const inner = ["upper_inner", "lower_inner"];
  const names = inner.includes(curve) && !inner.some((name) => entry.curves[name]) ? inner : [curve];
  try {
    const found = await Promise.all(names.map((name) => getJson(`api/curve/${name}/${encodeURIComponent(camera)}/${frame}`)));
    book.edit(entry, (curves) => {
      names.forEach((name, i) => {
        const handles = handlesOf(found[i].points, 0.8);
        curves[name] = { kind: "sure", handles, points: sampled(handles).points };
      });
    });
    tell("The mesh's own contour is the start: drag it where the lips are.");
  } catch (error) {
    tell(error.message, "error");
  }
}
function setReview(on) {
  if (on && !status.propagated.length) { tell("The take was not propagated yet: P does it."); return; }
  set({ review: on });
  if (on && status.followed) tell(status.followed, "error");
}
let player = null;
function play() {
  set({ playing: !state.playing });
  clearInterval(player);
  if (!state.playing) return;
  player = setInterval(() => {
    const next = state.frame >= facts.last ? facts.first : state.frame + 1;
    const ready = frames.image(state.camera, next).value && frames.mesh("base", state.camera, next).value;
    if (ready) goTo(next); else frames.prefetch(state.camera, state.frame, facts.first, facts.last, layersOf);
  }, 1000 / facts.fps);
}
let known = "";
async function poll() {
  try {
    const found = await getJson("api/status");
    const key = JSON.stringify({ ...found, run: 0 });
    const made = JSON.stringify(found.changed_mm), before = status ? JSON.stringify(status.changed_mm) : made;
    status = found;
    if (propagation.show(found.run) || made !== before) frames.forget("propagated");
    book.compare(found.revisions);
    if (key !== known) { known = key; if (view) { show(); controls(); } }
  } catch (error) {
    tell(error.message, "error");
  }
}

// Setting up --------------------------------------------------------------------------------------
// What buttons and keys work on.
const page = {
  get facts() { return facts; }, get status() { return status; }, get view() { return view; },
  get mesh3d() { return mesh3d; }, get drawing() { return drawing; },
  sketch, goTo, jump, solve, copyNeighbour, fromMesh, setReview, play, fitMouth, fitImage,
};

async function start() {
  [facts, topology] = await Promise.all([getJson("api/take"), getPacket("api/topology")]);
  document.title = `${facts.take}: Vermilion`;
  byId("take").textContent = facts.take;
  byId("sequence").textContent = { base: "the track", corrected: "the corrected track", H: "the reconstruction" }[facts.sequence];
  book.open(facts);
  await poll();
  const left = status.suggested.filter((frame) => !status.sketched.includes(frame));
  const kept = Number(sessionStorage.getItem(`vermilion/${facts.take}/frame`) ?? NaN);
  const first = kept >= facts.first && kept <= facts.last ? kept : left[0] ?? facts.first;
  sessionStorage.setItem(`vermilion/${facts.take}/frame`, String(first));
  Object.assign(state, { camera: facts.cameras[0].name, frame: first, curve: facts.curves[0] });
  view = new ImageView(byId("image"));
  second = new ImageView(byId("second"));
  view.layer = () => (state.review ? "before" : state.layer);
  second.layer = () => "after";
  second.plain = true;
  view.follow = () => { if (state.review) second.take(view); };
  second.follow = () => { if (state.review) view.take(second); };
  drawing = new Drawing(view, sketch, (camera) => facts.cameras.find((one) => one.name === camera).magnet);
  timeline = new Timeline(byId("timeline"), facts.first, facts.last, goTo);
  try {
    mesh3d = new MeshView(byId("mesh"));
    mesh3d.open(topology);
  } catch (error) {
    const box = document.createElement("div");
    box.className = "problem";
    box.textContent = `This browser shows no 3D (${error.message}). Drawing, solving and propagating work without it.`;
    byId("right").append(box);
  }
  build(page);
  bindKeys(page);
  propagation.wire(() => Promise.all(book.unsaved().map(book.settled)), () => setReview(true));
  book.onSketch((entry) => {
    if (entry.camera === state.camera && entry.frame === state.frame) view.sketch = entry;
    show(); controls();
  });
  onChange((changes) => {
    if (changes.has("frame")) sessionStorage.setItem(`vermilion/${facts.take}/frame`, String(state.frame));
    if (changes.has("camera")) byId("camera").value = state.camera;
    if (changes.has("frame") || changes.has("camera")) tell("");
    view.plain = state.review;
    show(); controls();
    if (changes.has("review") && state.review) requestAnimationFrame(() => { second.resize(); fitMouth(); });
    if (changes.has("wireframe") && mesh3d) mesh3d.draw();
  });
  window.addEventListener("beforeunload", (event) => { if (book.unsaved().length) event.preventDefault(); });
  show(); controls();
  setInterval(poll, POLL_MS);
  document.body.dataset.ready = "yes";
}

start().catch((error) => tell(error.message, "error"));
