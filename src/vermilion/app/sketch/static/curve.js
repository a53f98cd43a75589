// Curves through handles: centripetal Catmull-Rom, and the handles of a freehand stroke.
const STEP = 1.5, MOST_SAMPLES = 800, MOST_HANDLES = 14;
const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
const mix = (a, b, t) => [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t];

// Points evenly along a polyline, about `step` apart.
export function resample(points, step, least = 2) {
  const along = [0];
  for (let i = 1; i < points.length; i++) along.push(along[i - 1] + apart(points[i], points[i - 1]));
  const length = along[along.length - 1];
  const count = Math.max(least - 1, Math.ceil(length / step));
  const result = [];
  for (let k = 0, i = 1; k <= count; k++) {
    const at = (length * k) / count;
    while (i < points.length - 1 && along[i] < at) i++;
    const span = along[i] - along[i - 1];
    result.push(mix(points[i - 1], points[i], span > 0 ? (at - along[i - 1]) / span : 0));
  }
  return result;
}

// A hand shakes: each point becomes the mean of its neighbours, the ends stay.
export function smooth(points, rounds) {
  let result = points;
  for (let r = 0; r < rounds; r++) {
    result = result.map((p, i) => (i === 0 || i === result.length - 1 ? p
      : [(result[i - 1][0] + 2 * p[0] + result[i + 1][0]) / 4, (result[i - 1][1] + 2 * p[1] + result[i + 1][1]) / 4]));
  }
  return result;
}

function between(p0, p1, p2, p3, t) {
  const knot = (from, a, b) => from + Math.max(Math.sqrt(apart(a, b)), 1e-4);
  const t0 = 0, t1 = knot(t0, p0, p1), t2 = knot(t1, p1, p2), t3 = knot(t2, p2, p3);
  const u = t1 + (t2 - t1) * t;
  const blend = (a, b, from, to) => mix(a, b, (u - from) / (to - from));
  const a1 = blend(p0, p1, t0, t1), a2 = blend(p1, p2, t1, t2), a3 = blend(p2, p3, t2, t3);
  return blend(blend(a1, a2, t0, t2), blend(a2, a3, t1, t3), t1, t2);
}

// The curve through handles as points; `spans[i]` is the index of the handle before point i.
export function sampled(handles, step = STEP) {
  if (handles.length < 2) return { points: handles.slice(), spans: handles.map(() => 0) };
  const ends = [mix(handles[1], handles[0], 2), ...handles, mix(handles[handles.length - 2], handles[handles.length - 1], 2)];
  const total = handles.slice(1).reduce((sum, h, i) => sum + apart(h, handles[i]), 0);
  const pace = Math.max(step, (total * 1.2) / MOST_SAMPLES);
  const points = [handles[0]], spans = [0];
  for (let i = 0; i < handles.length - 1; i++) {
    const pieces = Math.max(2, Math.ceil(apart(handles[i], handles[i + 1]) / pace));
    for (let k = 1; k <= pieces; k++) {
      points.push(k === pieces ? handles[i + 1] : between(ends[i], ends[i + 1], ends[i + 2], ends[i + 3], k / pieces));
      spans.push(i);
    }
  }
  return { points, spans };
}

// Nearest place on a polyline: { distance, index (of the segment), point }.
export function nearest(points, place) {
  let best = { distance: Infinity, index: 0, point: points[0] };
  for (let i = 0; i < points.length - 1; i++) {
    const [ax, ay] = points[i], [bx, by] = points[i + 1];
    const squared = (bx - ax) ** 2 + (by - ay) ** 2 || 1e-9;
    const t = Math.min(1, Math.max(0, ((place[0] - ax) * (bx - ax) + (place[1] - ay) * (by - ay)) / squared));
    const point = [ax + (bx - ax) * t, ay + (by - ay) * t];
    const distance = apart(point, place);
    if (distance < best.distance) best = { distance, index: i, point };
  }
  return best;
}

// As few handles as keep the curve within `tolerance` px of a stroke.
export function handlesOf(stroke, tolerance = 0.6) {
  const even = resample(stroke, 1, 9);
  const chosen = [0, Math.round((even.length - 1) / 2), even.length - 1];
  while (chosen.length < MOST_HANDLES) {
    const { points } = sampled(chosen.map((i) => even[i]));
    let worst = -1, far = tolerance;
    for (let i = 0; i < even.length; i++) {
      const { distance } = nearest(points, even[i]);
      if (distance > far && !chosen.some((c) => Math.abs(c - i) < 3)) { far = distance; worst = i; }
    }
    if (worst < 0) break;
    chosen.push(worst);
    chosen.sort((a, b) => a - b);
  }
  return chosen.map((i) => even[i]);
}

// A freehand stroke as a curve: smoothed a little, then reduced to handles.
export function fromStroke(stroke, pixel) {
  const even = resample(stroke, Math.max(0.75, pixel), 9);
  return handlesOf(smooth(even, 4), Math.max(0.4, 0.9 * pixel));
}
export { apart };
