// The frames of the take, what is known of each, and the one that is shown.
const COLOUR = { sketched: "#ffc857", solved: "#63d471", suggested: "#b58cff", propagated: "#5b8def", bad: "#e5484d" };

export class Timeline {
  constructor(canvas, first, last, choose) {
    Object.assign(this, { canvas, first, last, choose, status: null, frame: first });
    this.context = canvas.getContext("2d");
    new ResizeObserver(() => this.draw()).observe(canvas);
    const scrub = (event) => choose(this.frameAt(event));
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); this.held = true; scrub(event); });
    canvas.addEventListener("pointermove", (event) => {
      if (this.held) scrub(event);
      canvas.title = this.says(this.frameAt(event));
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { this.held = false; });
  }
  get step() { return (this.canvas.clientWidth - 12) / (this.last - this.first + 1); }
  x(frame) { return 6 + (frame - this.first + 0.5) * this.step; }
  frameAt(event) {
    const at = event.clientX - this.canvas.getBoundingClientRect().left - 6;
    return Math.min(this.last, Math.max(this.first, this.first + Math.floor(at / this.step)));
  }
  says(frame) {
    const s = this.status;
    if (!s) return `Frame ${frame}`;
    const words = ["sketched", "solved", "propagated"].filter((name) => s[name].includes(frame));
    const rank = s.suggested.indexOf(frame);
    if (rank >= 0) words.push(`suggested (${rank + 1}.)`);
    const moved = s.changed_mm[frame];
    if (moved !== undefined) words.push(`moved ${moved.toFixed(2)} mm`);
    if (s.bad[frame]) words.push(s.bad[frame]);
    return `Frame ${frame}${words.length ? ": " + words.join(", ") : ""}`;
  }
  show(status, frame) { this.status = status; this.frame = frame; this.draw(); }
  draw() {
    const { canvas, context: c } = this, ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    const top = 20, bottom = height - 15, step = this.step, bar = Math.max(1, Math.min(step - 1, 18));
    c.fillStyle = "#17191d"; c.fillRect(6, top, width - 12, bottom - top);
    const every = [1, 2, 5, 10, 20, 25, 50, 100, 200, 500, 1000].find((n) => n * step >= 46) || 5000;
    c.font = "10px system-ui, sans-serif"; c.textAlign = "center"; c.fillStyle = "#8f96a3";
    for (let f = Math.ceil(this.first / every) * every; f <= this.last; f += every) {
      c.fillRect(this.x(f) - 0.5, bottom, 1, 3);
      c.fillText(String(f), this.x(f), height - 2);
    }
    const s = this.status;
    if (s) {
      const most = Math.max(0.2, ...Object.values(s.changed_mm));
      for (const frame of s.propagated) {
        const tall = 3 + (bottom - top - 9) * Math.min(1, (s.changed_mm[frame] || 0) / most);
        c.fillStyle = COLOUR.propagated; c.globalAlpha = s.stale ? 0.4 : 0.85;
        c.fillRect(this.x(frame) - bar / 2, bottom - tall, bar, tall);
      }
      c.globalAlpha = 1; c.fillStyle = COLOUR.bad;
      for (const frame of Object.keys(s.bad)) c.fillRect(this.x(Number(frame)) - Math.max(1, step / 2), bottom - 3, Math.max(2, step), 3);
      s.suggested.forEach((frame, rank) => {
        const x = this.x(frame), y = 12;
        c.fillStyle = COLOUR.suggested; c.globalAlpha = 1 - 0.06 * Math.min(rank, 9);
        c.beginPath(); c.moveTo(x, y - 6); c.lineTo(x + 5, y); c.lineTo(x, y + 6); c.lineTo(x - 5, y); c.fill();
        c.globalAlpha = 1;
      });
      for (const frame of s.sketched) {
        c.beginPath(); c.arc(this.x(frame), 12, 4.2, 0, 7);
        c.fillStyle = COLOUR.sketched; c.fill();
        if (s.solved.includes(frame)) { c.beginPath(); c.arc(this.x(frame), 12, 6.6, 0, 7); c.strokeStyle = COLOUR.solved; c.lineWidth = 2; c.stroke(); }
      }
    }
    const x = this.x(this.frame);
    c.fillStyle = "#ffffff22"; c.fillRect(x - Math.max(step, 3) / 2, top, Math.max(step, 3), bottom - top);
    c.fillStyle = "#fff"; c.fillRect(x - 0.75, top - 2, 1.5, bottom - top + 4);
  }
}
