// The image of a frame with curves, contours and the mesh over it; zoom and pan.
import { state } from "./state.js";

export const COLOURS = { upper_inner: "#ffc857", lower_inner: "#4cc9f0", upper_outer: "#c79a3f", lower_outer: "#3f93b0" };
const BEFORE = "#ff7b72", AFTER = "#63d471", ONION = "#b58cff";
const NAMES = Object.keys(COLOURS);

export class ImageView {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.scale = 1; this.x = 0; this.y = 0; this.ratio = 1;
    this.image = null; this.base = null; this.after = null; this.topology = null;
    this.sketch = null; this.onion = null; this.stroke = null; this.hover = null;
    this.layer = () => state.layer; this.plain = false; this.follow = () => {};
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }
  resize() {
    const { width, height } = this.canvas.getBoundingClientRect();
    if (!width) return;
    this.ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(width * this.ratio);
    this.canvas.height = Math.round(height * this.ratio);
    if (this.wanted) this.fit(this.wanted);
    this.draw();
  }
  get size() { return [this.canvas.width / this.ratio, this.canvas.height / this.ratio]; }
  toImage(event) {
    const box = this.canvas.getBoundingClientRect();
    return [(event.clientX - box.left - this.x) / this.scale, (event.clientY - box.top - this.y) / this.scale];
  }
  toScreen([x, y]) { return [x * this.scale + this.x, y * this.scale + this.y]; }
  // Show a box [x0, y0, x1, y1] of the image as large as fits.
  fit(box) {
    const [width, height] = this.size;
    this.wanted = box;
    if (!width || !height) return;
    this.scale = Math.min(width / (box[2] - box[0]), height / (box[3] - box[1]));
    this.x = width / 2 - (this.scale * (box[0] + box[2])) / 2;
    this.y = height / 2 - (this.scale * (box[1] + box[3])) / 2;
    this.moved();
  }
  moved() { this.follow(this); this.draw(); }
  take(other) {
    const [width, height] = this.size, [w, h] = other.size;
    this.scale = other.scale; this.wanted = null;
    this.x = other.x + (width - w) / 2; this.y = other.y + (height - h) / 2;
    this.draw();
  }
  zoom(factor, at = null) {
    const [width, height] = this.size, [cx, cy] = at || [width / 2, height / 2];
    const scale = Math.min(60, Math.max(0.1, this.scale * factor)), share = scale / this.scale;
    this.x = cx - (cx - this.x) * share; this.y = cy - (cy - this.y) * share;
    this.scale = scale; this.wanted = null;
    this.moved();
  }
  pan(dx, dy) { this.x += dx; this.y += dy; this.wanted = null; this.moved(); }
  wheel(event) {
    event.preventDefault();
    const box = this.canvas.getBoundingClientRect();
    this.zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)), [event.clientX - box.left, event.clientY - box.top]);
  }
  draw() {
    // Where image pixels are on the canvas, for tests.
    this.canvas.dataset.place = [this.scale, this.x, this.y].join(" ");
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.paint(); });
  }
  paint() {
    const c = this.context;
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.setTransform(this.ratio * this.scale, 0, 0, this.ratio * this.scale, this.ratio * this.x, this.ratio * this.y);
    if (this.image) {
      c.imageSmoothingEnabled = this.scale < 6;
      c.filter = state.brightness === 1 ? "none" : `brightness(${state.brightness})`;
      c.drawImage(this.image, 0, 0);
      c.filter = "none";
    }
    const after = this.layer() === "after" && this.after ? this.after : this.base;
    if (after && this.topology && state.overlay !== "off") this.paintMesh(c, after);
    if (state.contours) {
      if (this.base) this.paintContours(c, this.base, BEFORE, this.after && this.layer() === "after" ? 0.55 : 0.9);
      if (this.after && this.layer() === "after") this.paintContours(c, this.after, AFTER, 1);
    }
    if (this.plain) return;
    if (state.onion && this.onion) this.paintCurves(c, this.onion.curves, () => ONION, true);
    if (this.sketch) this.paintCurves(c, this.sketch.curves, (name) => COLOURS[name], false);
    if (this.stroke) this.line(c, this.stroke, this.erasing ? "#ffffff88" : COLOURS[state.curve], 2);
  }
  line(c, points, colour, width, dash = []) {
    if (points.length < 2) return;
    c.beginPath();
    points.forEach(([x, y], i) => (i ? c.lineTo(x, y) : c.moveTo(x, y)));
    c.strokeStyle = colour; c.lineWidth = width / this.scale; c.lineJoin = c.lineCap = "round";
    c.setLineDash(dash.map((d) => d / this.scale));
    c.stroke();
    c.setLineDash([]);
  }
  paintCurves(c, curves, colourOf, ghost) {
    for (const name of NAMES) {
      const curve = curves[name];
      if (!curve) continue;
      const active = name === state.curve && !ghost;
      this.line(c, curve.points, "#0009", active ? 4 : 3);
      this.line(c, curve.points, colourOf(name), active ? 2 : 1.3, ghost ? [5, 4] : curve.kind === "near" ? [2, 4] : []);
      if (!active) continue;
      curve.handles.forEach(([x, y], i) => {
        const chosen = i === state.handle, near = this.hover === i;
        const r = (chosen || near ? 5.5 : 4) / this.scale;
        c.beginPath(); c.arc(x, y, r, 0, 2 * Math.PI);
        c.fillStyle = chosen ? "#fff" : "#17191d"; c.fill();
        c.strokeStyle = colourOf(name); c.lineWidth = 1.6 / this.scale; c.stroke();
      });
    }
  }
  paintContours(c, packet, colour, alpha) {
    c.globalAlpha = alpha;
    c.beginPath();
    for (const name of NAMES) {
      const ends = packet[`contour_${name}`];
      for (let i = 0; ends && i < ends.length; i += 4) { c.moveTo(ends[i], ends[i + 1]); c.lineTo(ends[i + 2], ends[i + 3]); }
    }
    c.strokeStyle = colour; c.lineWidth = 1.2 / this.scale; c.stroke();
    c.globalAlpha = 1;
  }
  paintMesh(c, packet) {
    const { mouth_triangles: triangles, predicted } = this.topology, px = packet.mouth_px;
    if (state.overlay === "wire") {
      for (const inner of [0, 1]) {
        c.beginPath();
        for (let t = 0; t < predicted.length; t++) {
          if (predicted[t] !== inner) continue;
          const [i, j, k] = [2 * triangles[3 * t], 2 * triangles[3 * t + 1], 2 * triangles[3 * t + 2]];
          if ((px[j] - px[i]) * (px[k + 1] - px[i + 1]) - (px[k] - px[i]) * (px[j + 1] - px[i + 1]) >= 0) continue;
          c.moveTo(px[i], px[i + 1]); c.lineTo(px[j], px[j + 1]); c.lineTo(px[k], px[k + 1]); c.closePath();
        }
        c.strokeStyle = inner ? "#ff9d8acc" : "#c8d0dc55"; c.lineWidth = 0.6 / this.scale; c.stroke();
      }
      return;
    }
    const shaded = this.shaded(packet);
    c.globalAlpha = 0.8;
    for (const { i, j, k, colour } of shaded) {
      c.beginPath();
      c.moveTo(px[i], px[i + 1]); c.lineTo(px[j], px[j + 1]); c.lineTo(px[k], px[k + 1]); c.closePath();
      c.fillStyle = c.strokeStyle = colour; c.lineWidth = 0.7 / this.scale; c.fill(); c.stroke();
    }
    c.globalAlpha = 1;
  }
  // Triangles that face the camera, far ones first, lit from the camera; kept with the packet.
  shaded(packet) {
    if (packet.shaded) return packet.shaded;
    const { mouth_triangles: triangles, mouth_vertices: ids, predicted } = this.topology;
    const px = packet.mouth_px, depth = packet.mouth_depth_mm, v = packet.vertices_mm, list = [];
    for (let t = 0; t < predicted.length; t++) {
      const a = triangles[3 * t], b = triangles[3 * t + 1], d = triangles[3 * t + 2];
      const i = 2 * a, j = 2 * b, k = 2 * d;
      const seen = (px[j + 1] - px[i + 1]) * (px[k] - px[i]) - (px[j] - px[i]) * (px[k + 1] - px[i + 1]);
      if (seen <= 0) continue;
      const p = [a, b, d].map((n) => 3 * ids[n]);
      const e = [0, 1, 2].map((x) => v[p[1] + x] - v[p[0] + x]), f = [0, 1, 2].map((x) => v[p[2] + x] - v[p[0] + x]);
      const area = Math.hypot(e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]);
      list.push({ i, j, k, far: depth[a] + depth[b] + depth[d], seen, area, inner: predicted[t] });
    }
    const facing = list.map((t) => t.seen / (t.area || 1e-9)).sort((x, y) => x - y);
    const full = facing[Math.floor(facing.length * 0.9)] || 1;
    for (const t of list) {
      const light = 40 + 190 * Math.min(1, t.seen / (t.area || 1e-9) / full);
      t.colour = t.inner ? `rgb(${light},${light * 0.72},${light * 0.68})` : `rgb(${light * 0.94},${light * 0.93},${light * 0.9})`;
    }
    packet.shaded = list.sort((x, y) => y.far - x.far);
    return packet.shaded;
  }
}
