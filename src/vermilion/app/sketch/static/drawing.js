// Pointer and keys on the image: strokes, handles, the eraser, panning.
import { send } from "./api.js";
import { apart, fromStroke, handlesOf, nearest, sampled } from "./curve.js";
import * as book from "./sketch_book.js";
import { set, state, tell } from "./state.js";

const GRAB_PX = 9, ERASE_PX = 10;

export class Drawing {
  constructor(view, entry, magnetOf) {
    this.view = view; this.entry = entry; this.magnetOf = magnetOf;
    this.gesture = null;
    const canvas = view.canvas;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => this.up(event));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  }
  get curve() { return this.entry().curves[state.curve]; }
  handleAt(place) {
    const reach = GRAB_PX / this.view.scale;
    let best = -1, far = reach;
    (this.curve ? this.curve.handles : []).forEach((handle, i) => {
      const away = apart(handle, place);
      if (away <= far) { far = away; best = i; }
    });
    return best;
  }
  down(event) {
    if (this.gesture || this.view.plain) return;
    this.view.canvas.focus({ preventScroll: true });
    const pan = event.button === 1 || event.button === 2 || state.tool === "pan" || event.pointerType === "touch";
    const erase = state.tool === "erase" || (event.buttons & 32) !== 0;
    if (event.button > 2 && !erase) return;
    this.view.canvas.setPointerCapture(event.pointerId);
    const place = this.view.toImage(event), entry = this.entry();
    const gesture = { id: event.pointerId, place, before: book.begin(entry), entry, x: event.clientX, y: event.clientY };
    this.gesture = gesture;
    if (pan && !(event.buttons & 32)) { gesture.kind = "pan"; return; }
    if (entry.revision === null) { this.gesture = null; return; }
    if (erase) { gesture.kind = "erase"; this.view.erasing = true; this.view.stroke = [place]; this.erase(place); return; }
    // With Shift a new stroke begins wherever it is; else a handle or the curve is taken where one is near.
    const handle = event.shiftKey ? -1 : this.handleAt(place);
    if (handle >= 0) {
      gesture.kind = "drag"; gesture.handle = handle;
      set({ handle });
    } else if (!event.shiftKey && this.curve && nearest(this.curve.points, place).distance * this.view.scale < GRAB_PX * 0.7) {
      gesture.kind = "drag"; gesture.handle = this.add(place);
      set({ handle: gesture.handle });
    } else {
      gesture.kind = "stroke"; this.view.stroke = [place];
      set({ handle: -1 });
    }
    this.view.draw();
  }
  move(event) {
    const gesture = this.gesture;
    if (!gesture || gesture.id !== event.pointerId) {
      if (!gesture) this.hovered(event);
      return;
    }
    if (gesture.kind === "pan") {
      this.view.pan(event.clientX - gesture.x, event.clientY - gesture.y);
      gesture.x = event.clientX; gesture.y = event.clientY;
      return;
    }
    const events = event.getCoalescedEvents ? event.getCoalescedEvents() : [];
    for (const part of events.length ? events : [event]) {
      const place = this.view.toImage(part);
      if (gesture.kind === "stroke" || gesture.kind === "erase") {
        const last = this.view.stroke[this.view.stroke.length - 1];
        if (apart(last, place) * this.view.scale >= 1) this.view.stroke.push(place);
        if (gesture.kind === "erase") this.erase(place);
      } else {
        const curve = gesture.entry.curves[state.curve];
        curve.handles[gesture.handle] = place;
        book.bend(curve);
      }
    }
    this.view.draw();
  }
  up(event) {
    const gesture = this.gesture;
    if (!gesture || gesture.id !== event.pointerId) return;
    const stroke = this.view.stroke;
    this.gesture = null; this.view.stroke = null; this.view.erasing = false;
    this.view.draw();
    if (gesture.kind === "stroke") this.finish(gesture.entry, stroke);
    else if (gesture.kind !== "pan") book.commit(gesture.entry, gesture.before);
  }
  hovered(event) {
    const found = this.handleAt(this.view.toImage(event));
    const hover = found < 0 ? null : found;
    if (hover !== this.view.hover) { this.view.hover = hover; this.view.draw(); }
  }
  async finish(entry, stroke) {
    const name = state.curve, kind = state.kind;
    const length = stroke.slice(1).reduce((sum, p, i) => sum + apart(p, stroke[i]), 0);
    if (stroke.length < 3 || length * this.view.scale < 12) { tell("Too short for a curve: draw from one corner of the mouth towards the other."); return; }
    let handles = fromStroke(stroke, 1 / this.view.scale);
    if (state.magnet && this.magnetOf(entry.camera)) {
      try {
        const { points } = sampled(handles);
        const snapped = await send("POST", `api/magnet/${encodeURIComponent(entry.camera)}/${entry.frame}`, { curve: name, points });
        handles = handlesOf(snapped.points, 0.6);
      } catch (error) {
        tell(`${error.message} The stroke stays where it was drawn.`, error.status === 404 ? "info" : "error");
      }
    }
    book.edit(entry, (curves) => {
      curves[name] = { kind, handles, points: sampled(handles).points };
    });
  }
  // A new handle on the curve; its index.
  add(place) {
    const curve = this.curve, { points, spans } = sampled(curve.handles);
    const found = nearest(points, place);
    const at = spans[Math.min(found.index + 1, spans.length - 1)] + 1;
    curve.handles.splice(at, 0, found.point);
    book.bend(curve);
    return at;
  }
  erase(place) {
    const curves = this.entry().curves, curve = curves[state.curve];
    if (!curve) return;
    const kept = curve.handles.filter((handle) => apart(handle, place) * this.view.scale > ERASE_PX);
    if (kept.length === curve.handles.length) return;
    if (kept.length < 2) delete curves[state.curve];
    else { curve.handles = kept; book.bend(curve); }
    set({ handle: -1 });
  }
  // Keys -----------------------------------------------------------------------------------------
  choose(step) {
    const count = this.curve ? this.curve.handles.length : 0;
    if (!count) { tell("This curve has no handles yet: draw it, or K takes it from the mesh."); return; }
    const from = state.handle < 0 ? (step > 0 ? -1 : count) : state.handle;
    set({ handle: (from + step + count) % count });
    this.view.draw();
  }
  nudge(dx, dy) {
    const handle = state.handle;
    if (handle < 0 || !this.curve || handle >= this.curve.handles.length) return false;
    book.edit(this.entry(), (curves) => {
      const curve = curves[state.curve], [x, y] = curve.handles[handle];
      curve.handles[handle] = [x + dx, y + dy];
      book.bend(curve);
    });
    return true;
  }
  addAfter() {
    if (!this.curve || state.handle < 0) { tell("Choose a handle first ([ and ])."); return; }
    const first = Math.min(state.handle, this.curve.handles.length - 2);
    const { points, spans } = sampled(this.curve.handles);
    const inside = points.filter((_, i) => i && spans[i] === first);
    const before = book.begin(this.entry());
    const handle = this.add(inside[Math.floor(inside.length / 2)]);
    book.commit(this.entry(), before);
    set({ handle });
  }
  removeHandle() {
    const handle = state.handle;
    if (!this.curve || handle < 0) { tell("Choose a handle first ([ and ]), or X removes the curve."); return; }
    book.edit(this.entry(), (curves) => {
      const curve = curves[state.curve];
      curve.handles.splice(handle, 1);
      if (curve.handles.length < 2) delete curves[state.curve];
      else book.bend(curve);
    });
    set({ handle: this.curve ? Math.min(handle, this.curve.handles.length - 1) : -1 });
  }
  removeCurve() {
    book.edit(this.entry(), (curves) => { delete curves[state.curve]; });
    set({ handle: -1 });
  }
  toggleKind() {
    const kind = (this.curve ? this.curve.kind : state.kind) === "sure" ? "near" : "sure";
    set({ kind });
    if (this.curve) book.edit(this.entry(), (curves) => { curves[state.curve].kind = kind; });
    tell(kind === "near" ? "Near: the contour runs about here, and pulls a tenth." : "Sure: the contour runs here.");
  }
}
