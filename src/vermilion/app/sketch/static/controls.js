// Buttons and keys: what each is called and does. `page` has the parts and what they can do.
import { Keys } from "./keys.js";
import { ramp } from "./mesh_view.js";
import * as propagation from "./propagation.js";
import * as book from "./sketch_book.js";
import { set, state } from "./state.js";

const byId = (id) => document.getElementById(id);

function button(parent, id, label, key, title, action, swatch = "") {
  const made = document.createElement("button");
  made.id = id; made.title = key ? `${title} (${key})` : title;
  if (swatch) made.appendChild(document.createElement("span")).className = `swatch ${swatch}`;
  made.append(label + " ");
  if (key) made.appendChild(document.createElement("kbd")).textContent = key;
  made.addEventListener("click", action);
  byId(parent).append(made);
}
const flip = (name) => () => set({ [name]: !state[name] });
const overlay = () => set({ overlay: { off: "wire", wire: "shaded", shaded: "off" }[state.overlay] });
const before = () => set({ layer: state.layer === "after" ? "before" : "after" });
const bright = (step) => set({ brightness: Math.round(Math.min(4, Math.max(0.2, state.brightness * step)) * 100) / 100 });
const undo = (page) => () => { set({ handle: -1 }); book.undo(page.sketch()); };
const redo = (page) => () => { set({ handle: -1 }); book.redo(page.sketch()); };
const cameraStep = (page, step) => {
  const names = page.facts.cameras.map((camera) => camera.name);
  set({ camera: names[(names.indexOf(state.camera) + step + names.length) % names.length], handle: -1 });
};

// Buttons, lists and sliders.
export function build(page) {
  const labels = { upper_inner: "Upper", lower_inner: "Lower", upper_outer: "Outer up", lower_outer: "Outer low" };
  page.facts.curves.forEach((name, i) => button("curves", `curve-${name}`, labels[name] || name, String(i + 1), `Draw the ${name.replace("_", " ")} contour`, () => set({ curve: name, handle: -1 }), name));
  button("tools", "tool-draw", "Draw", "Q", "Draw freehand, with Shift over a curve; drag and add handles", () => set({ tool: "draw" }));
  button("tools", "tool-erase", "Erase", "E", "Rub out handles", () => set({ tool: "erase" }));
  button("tools", "tool-pan", "Pan", "H", "Move the image; the right and middle buttons always do", () => set({ tool: "pan" }));
  button("edits", "undo", "↶", "", "Undo in this frame (Ctrl+Z)", undo(page));
  button("edits", "redo", "↷", "", "Redo in this frame (Ctrl+Y)", redo(page));
  button("left-bar", "from-mesh", "From mesh", "K", "Start from the mesh's own contour", page.fromMesh);
  button("left-bar", "copy", "Copy", "C", "Start from the nearest drawn frame", page.copyNeighbour);
  button("left-bar", "onion", "Onion", "O", "Show the nearest drawn frame's curves", flip("onion"));
  button("left-bar", "magnet", "Magnet", "G", "Pull strokes onto the detected contour", flip("magnet"));
  button("left-bar", "near", "Near", "T", "The contour runs only about here", () => page.drawing.toggleKind());
  button("left-bar", "contours", "Contours", "V", "Contours of the mesh: before red, after green", flip("contours"));
  button("left-bar", "overlay", "Mesh", "M", "The mesh over the image", overlay);
  const label = document.createElement("label"), range = document.createElement("input");
  Object.assign(range, { type: "range", id: "brightness", min: 0.2, max: 4, step: 0.05, value: 1 });
  range.addEventListener("input", () => set({ brightness: Number(range.value) }));
  label.append("Light", range);
  label.title = "Brightness of the image (U, I)";
  byId("left-bar").append(label);
  button("right-bar", "before", "Before", "B", "The mesh before the correction", before);
  button("right-bar", "wireframe", "Wireframe", "W", "Edges of the mesh", flip("wireframe"));
  button("right-bar", "distance", "Distance", "D", "Colour by the distance that the correction moved", flip("distance"));
  button("right-bar", "side", "Side by side", "S", "The propagated take before and after", () => page.setReview(true));
  for (const camera of page.facts.cameras) byId("camera").append(new Option(camera.name, camera.name));
  byId("camera").addEventListener("change", (event) => { set({ camera: event.target.value, handle: -1 }); event.target.blur(); });
  byId("key").replaceChildren(...["suggested", "sketched", "solved", "propagated", "bad"].map((name) => {
    const item = document.createElement("span");
    item.appendChild(document.createElement("span")).className = `swatch ${name}`;
    item.append({ solved: "solved (ring)", propagated: "propagated (height: how far the lips moved)" }[name] || name);
    return item;
  }));
  byId("solve").addEventListener("click", page.solve);
  byId("propagate").addEventListener("click", () => propagation.open(page.status.run));
  byId("review-close").addEventListener("click", () => page.setReview(false));
  byId("help-button").addEventListener("click", () => byId("help").showModal());
  byId("help-close").addEventListener("click", () => byId("help").close());
  const c = byId("ramp").getContext("2d");
  for (let x = 0; x < 160; x++) { c.fillStyle = `rgb(${ramp(x / 159).map((v) => v * 255)})`; c.fillRect(x, 0, 1, 8); }
}

// Every key.
export function bindKeys(page) {
  const keys = new Keys();
  const along = ({ key }, step) => [{ ArrowLeft: -step, ArrowRight: step }[key] || 0, { ArrowUp: -step, ArrowDown: step }[key] || 0];
  const arrow = (dx, dy, otherwise) => () => { if (!page.drawing.nudge(dx, dy)) otherwise(); };
  const nothing = () => {};
  keys.add("Frames", [
    ["ArrowLeft", "frame before (or moves the chosen handle)", arrow(-0.5, 0, () => page.goTo(state.frame - 1))],
    ["ArrowRight", "next frame (or moves the chosen handle)", arrow(0.5, 0, () => page.goTo(state.frame + 1))],
    ["Shift+ArrowLeft", "10 frames back (handle: 3 px)", arrow(-3, 0, () => page.goTo(state.frame - 10))],
    ["Shift+ArrowRight", "10 frames on (handle: 3 px)", arrow(3, 0, () => page.goTo(state.frame + 10))],
    [[",", "."], "one frame, always", (event) => page.goTo(state.frame + (event.key === "," ? -1 : 1))],
    ["Home", "first frame", () => page.goTo(page.facts.first)], ["End", "last frame", () => page.goTo(page.facts.last)],
    ["N", "next suggested frame", () => page.jump(1)], ["Shift+N", "suggested frame before", () => page.jump(-1)],
    ["Space", "play, stop", page.play],
    [["PageUp", "PageDown"], "camera before, next camera", (event) => cameraStep(page, event.key === "PageUp" ? -1 : 1)],
  ]);
  keys.add("Curves", [
    ...page.facts.curves.map((name, i) => [String(i + 1), name.replace("_", " "), () => set({ curve: name, handle: -1 })]),
    ["Q", "draw", () => set({ tool: "draw" })], ["E", "erase", () => set({ tool: "erase" })], ["H", "pan", () => set({ tool: "pan" })],
    ["K", "from the mesh's contour", page.fromMesh], ["C", "copy the nearest drawn frame", page.copyNeighbour],
    ["O", "onion skin", flip("onion")], ["G", "magnet", flip("magnet")], ["T", "sure or near", () => page.drawing.toggleKind()],
    [["[", "]"], "choose a handle", (event) => page.drawing.choose(event.key === "[" ? -1 : 1)],
    [["ArrowUp", "ArrowDown"], "move the chosen handle", (event) => arrow(0, event.key === "ArrowUp" ? -0.5 : 0.5, nothing)()],
    [["Shift+ArrowUp", "Shift+ArrowDown"], "by 3 px", (event) => arrow(0, event.key === "ArrowUp" ? -3 : 3, nothing)()],
    ["A", "add a handle after the chosen one", () => page.drawing.addAfter()],
    [["Delete", "Backspace"], "remove the chosen handle", () => page.drawing.removeHandle()], ["X", "remove the curve", () => page.drawing.removeCurve()],
    ["Ctrl+Z", "undo, in this frame", undo(page)], [["Ctrl+Y", "Ctrl+Shift+Z"], "redo, in this frame", redo(page)],
  ]);
  keys.add("Correction", [
    ["Enter", "solve the frame", page.solve], ["P", "propagate to the take", () => propagation.open(page.status.run)],
    ["B", "before, after", before], ["S", "side by side", () => page.setReview(!state.review)],
  ]);
  keys.add("View", [
    [["+", "="], "zoom in", () => page.view.zoom(1.25)], ["-", "zoom out", () => page.view.zoom(0.8)],
    ["0", "the mouth", page.fitMouth], ["9", "the whole image", page.fitImage],
    [["Ctrl+ArrowLeft", "Ctrl+ArrowRight", "Ctrl+ArrowUp", "Ctrl+ArrowDown"], "pan", (event) => page.view.pan(...along(event, -60))],
    ["U", "darker", () => bright(0.87)], ["I", "lighter", () => bright(1.15)],
    ["V", "contours of the mesh", flip("contours")], ["M", "mesh over the image: wire, shaded, off", overlay],
    ["W", "wireframe in 3D", flip("wireframe")], ["D", "distance colours in 3D", flip("distance")],
    [["Alt+ArrowLeft", "Alt+ArrowRight", "Alt+ArrowUp", "Alt+ArrowDown"], "turn the mesh", (event) => page.mesh3d && page.mesh3d.turn(...along(event, -0.15))],
    ["Alt+0", "the mesh from the front", () => page.mesh3d && page.mesh3d.reset()],
    ["?", "this sheet", () => byId("help").showModal()],
    ["Escape", "let go of the handle; close", () => (state.review ? page.setReview(false) : set({ handle: -1, playing: false }))],
  ]);
  byId("keys").replaceChildren(...keys.sheet());
  window.addEventListener("keydown", (event) => keys.handle(event));
}
