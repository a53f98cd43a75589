// Before and after side by side, and the frames that changed most.
import * as frames from "./frames.js";

const SHOWN = 10, MARGIN = 0.35;
const strip = document.getElementById("thumbs");
let listed = "";

export function thumbnails(status, camera, choose, current) {
  const most = Object.entries(status.changed_mm).sort((a, b) => b[1] - a[1]).slice(0, SHOWN);
  const key = `${camera}:${JSON.stringify(most)}`;
  if (key !== listed) {
    listed = key;
    strip.replaceChildren(...most.map(([frame, mm]) => thumbnail(Number(frame), mm, camera, choose)));
  }
  for (const button of strip.children) button.setAttribute("aria-pressed", String(Number(button.dataset.frame) === current));
}

function thumbnail(frame, mm, camera, choose) {
  const button = document.createElement("button"), canvas = button.appendChild(document.createElement("canvas"));
  canvas.width = 192; canvas.height = 120;
  button.dataset.frame = frame;
  button.append(`${frame}: ${mm.toFixed(2)} mm`);
  button.title = `Frame ${frame}: the inner lips moved by ${mm.toFixed(2)} mm in the mean`;
  button.addEventListener("click", () => choose(frame));
  Promise.all([frames.image(camera, frame).promise, frames.mesh("propagated", camera, frame).promise])
    .then(([image, packet]) => paint(canvas, image, packet))
    .catch(() => {});
  return button;
}

function paint(canvas, image, packet) {
  const [x0, y0, x1, y1] = boxOf(packet, MARGIN), c = canvas.getContext("2d");
  const scale = Math.min(canvas.width / (x1 - x0), canvas.height / (y1 - y0));
  c.setTransform(scale, 0, 0, scale, canvas.width / 2 - (scale * (x0 + x1)) / 2, canvas.height / 2 - (scale * (y0 + y1)) / 2);
  c.drawImage(image, 0, 0);
  c.beginPath();
  for (const name of ["upper_inner", "lower_inner"]) {
    const ends = packet[`contour_${name}`];
    for (let i = 0; i < ends.length; i += 4) { c.moveTo(ends[i], ends[i + 1]); c.lineTo(ends[i + 2], ends[i + 3]); }
  }
  c.strokeStyle = "#63d471"; c.lineWidth = 2 / scale; c.stroke();
}

// The lips in the image with a margin: [x0, y0, x1, y1].
export function boxOf(packet, margin) {
  let box = [Infinity, Infinity, -Infinity, -Infinity];
  for (const name of ["upper_outer", "lower_outer", "upper_inner", "lower_inner"]) {
    const ends = packet[`contour_${name}`];
    for (let i = 0; i < ends.length; i += 2) {
      box = [Math.min(box[0], ends[i]), Math.min(box[1], ends[i + 1]), Math.max(box[2], ends[i]), Math.max(box[3], ends[i + 1])];
    }
  }
  if (!Number.isFinite(box[0])) return null;
  const pad = margin * (box[2] - box[0]);
  return [box[0] - pad, box[1] - pad, box[2] + pad, box[3] + pad];
}
