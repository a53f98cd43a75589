// The mesh in 3D: turn, wireframe, before and after, distance colours.
import * as THREE from "./vendor/three.module.min.js";
import { state } from "./state.js";

const SKIN = [0.74, 0.66, 0.61], INNER = [0.72, 0.46, 0.43];
// Stops of the distance colours, from still to far.
const RAMP = [[0.19, 0.21, 0.26], [0.16, 0.38, 0.72], [0.13, 0.70, 0.67], [0.93, 0.83, 0.29], [0.93, 0.28, 0.18]];

export function ramp(share) {
  const at = Math.min(0.9999, Math.max(0, share)) * (RAMP.length - 1), i = Math.floor(at);
  return RAMP[i].map((value, c) => value + (RAMP[i + 1][c] - value) * (at - i));
}

export class MeshView {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(0x0f1013);
    this.camera = new THREE.PerspectiveCamera(28, 1, 1, 5000);
    this.scene.add(new THREE.HemisphereLight(0xdfe6f0, 0x30282a, 1.1));
    this.key = new THREE.DirectionalLight(0xffffff, 2.0);
    this.scene.add(this.key);
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.listen();
  }
  open(topology) {
    this.topology = topology;
    this.geometry = new THREE.BufferGeometry();
    const count = topology.inner.length;
    this.geometry.setIndex(new THREE.BufferAttribute(topology.triangles, 1));
    this.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * count), 3));
    this.geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * count), 3));
    const material = new THREE.MeshStandardMaterial({
      vertexColors: true, roughness: 0.62, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    });
    this.mesh = new THREE.Mesh(this.geometry, material);
    this.wire = new THREE.Mesh(this.geometry, new THREE.MeshBasicMaterial({ wireframe: true, color: 0x0b0c0e, transparent: true, opacity: 0.35 }));
    this.scene.add(this.mesh, this.wire);
    this.reset();
  }
  reset() {
    this.yaw = 0; this.pitch = 0;
    this.target = new THREE.Vector3(...this.topology.header.mouth_mm);
    this.distance = this.topology.header.width_mm * 4.2;
    this.draw();
  }
  // Show a packet; `scaleMm` is where the distance colours end.
  show(packet, scaleMm) {
    const position = this.geometry.getAttribute("position"), colour = this.geometry.getAttribute("color");
    position.array.set(packet.vertices_mm);
    position.needsUpdate = true;
    for (let v = 0; v < packet.moved_mm.length; v++) {
      const rgb = state.distance ? ramp(packet.moved_mm[v] / scaleMm) : this.topology.inner[v] ? INNER : SKIN;
      colour.array.set(rgb, 3 * v);
    }
    colour.needsUpdate = true;
    this.geometry.computeVertexNormals();
    this.geometry.computeBoundingSphere();
    this.draw();
  }
  resize() {
    const { width, height } = this.canvas.getBoundingClientRect();
    if (!width) return;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.draw();
  }
  draw() {
    if (this.waiting || !this.mesh) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      const away = new THREE.Vector3(Math.sin(this.yaw) * Math.cos(this.pitch), Math.sin(this.pitch), Math.cos(this.yaw) * Math.cos(this.pitch));
      this.camera.position.copy(this.target).addScaledVector(away, this.distance);
      this.camera.lookAt(this.target);
      this.camera.updateProjectionMatrix();
      this.key.position.copy(this.camera.position).add(new THREE.Vector3(-60, 120, 0));
      this.key.target.position.copy(this.target);
      this.key.target.updateMatrixWorld();
      this.wire.visible = state.wireframe;
      this.renderer.render(this.scene, this.camera);
    });
  }
  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(1.5, Math.max(-1.5, this.pitch + pitch));
    this.draw();
  }
  zoom(factor) { this.distance = Math.min(2000, Math.max(10, this.distance * factor)); this.draw(); }
  shift(dx, dy) {
    const right = new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, 0), up = new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, 1);
    const pace = (2 * this.distance * Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2))) / this.canvas.clientHeight;
    this.target.addScaledVector(right, -dx * pace).addScaledVector(up, dy * pace);
    this.draw();
  }
  listen() {
    let held = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      held = { id: event.pointerId, x: event.clientX, y: event.clientY, shift: event.button !== 0 || event.shiftKey };
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!held || held.id !== event.pointerId) return;
      const dx = event.clientX - held.x, dy = event.clientY - held.y;
      held.x = event.clientX; held.y = event.clientY;
      if (held.shift) this.shift(dx, dy); else this.turn(-dx * 0.008, dy * 0.008);
    });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => { held = null; });
    this.canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(Math.exp(event.deltaY * 0.001)); }, { passive: false });
    this.canvas.addEventListener("dblclick", () => this.reset());
    this.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  }
}
