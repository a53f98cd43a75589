// The dialog that runs the workflow: how many jobs, progress, time left, cancel, what failed.
import { getJson, send } from "./api.js";

const byId = (id) => document.getElementById(id);
const dialog = byId("propagation");
let state = "closed", shown = 0;

export function wire(settleSketches, openReview) {
  byId("propagation-start").addEventListener("click", start);
  byId("propagation-cancel").addEventListener("click", () => act("api/cancel"));
  byId("propagation-close").addEventListener("click", () => dialog.close());
  byId("propagation-review").addEventListener("click", () => { dialog.close(); openReview(); });
  // Of the whole window: a button that is hidden takes the focus out of the dialog.
  window.addEventListener("keydown", (event) => {
    if (!dialog.open) return;
    if (event.key === "Enter" && !byId("propagation-start").hidden && event.target.tagName !== "BUTTON") start();
    else if (event.key.toLowerCase() === "s" && !byId("propagation-review").hidden) { dialog.close(); openReview(); }
    else return;
    event.preventDefault();
  });
  settle = settleSketches;
}
let settle = async () => {};

function say(sentence, { start = false, cancel = false, review = false, bar = null } = {}) {
  byId("propagation-text").textContent = sentence;
  byId("propagation-start").hidden = !start;
  byId("propagation-cancel").hidden = !cancel;
  byId("propagation-review").hidden = !review;
  byId("progress").hidden = bar === null;
  if (bar !== null) byId("progress").value = bar;
}

function table(jobs) {
  const rows = Object.entries(jobs).map(([rule, count]) => {
    const row = document.createElement("tr");
    for (const text of [rule, String(count)]) row.appendChild(document.createElement("td")).textContent = text;
    return row;
  });
  byId("jobs").replaceChildren(...rows);
}

export async function open(run) {
  if (!dialog.open) dialog.showModal();
  byId("log").hidden = true;
  table({});
  if (["running", "cancelling"].includes(run.state)) { state = "watching"; show(run); return; }
  shown = run.started;  // A run that ended before this one is not its end.
  state = "counting";
  say("Counting the jobs...");
  try {
    await settle();
    const { jobs } = await send("POST", "api/jobs");
    if (state !== "counting") return;
    const total = Object.values(jobs).reduce((sum, count) => sum + count, 0);
    table(jobs);
    state = "ready";
    if (total) {
      say(`${total} job${total === 1 ? "" : "s"} will run: each changed sketch is refined, the lips are learnt again, and the whole take is corrected.`, { start: true });
      byId("propagation-start").focus();
    } else {
      say("Nothing has changed since the last propagation.", { review: true });
    }
  } catch (error) {
    state = "ready";
    say(error.message);
  }
}

async function start() {
  if (state !== "ready") return;
  state = "watching";
  say("Starting...", { bar: 0 });
  await act("api/propagate");
}

async function act(path) {
  try {
    show(await send("POST", path));
  } catch (error) {
    say(error.message);
    state = "ready";
  }
}

const duration = (seconds) => (seconds < 90 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min`);

// What the server says of the run, every second; true where a run has just ended well.
export function show(run) {
  if (state !== "watching") return false;
  const share = run.total ? run.done / run.total : 0;
  if (run.state === "running") {
    const left = run.left_s === null ? "" : `, about ${duration(run.left_s)} left`;
    const rule = run.rule ? ` (${run.rule})` : "", sofar = `${duration(run.taken_s)} so far`;
    const sentence = run.total ? `${run.done} of ${run.total} jobs done${rule}, ${sofar}${left}.` : `The workflow plans its jobs, ${sofar}.`;
    say(sentence, { cancel: true, bar: share });
    return false;
  }
  if (run.state === "cancelling") { say("Stopping the jobs...", { bar: share }); return false; }
  if (run.state === "idle" || run.started === shown) return false;
  shown = run.started;
  state = "ended";
  if (run.state === "done") {
    say(`Done in ${duration(run.taken_s)}. ${run.sentence}`, { review: true, bar: 1 });
    return true;
  }
  say(run.sentence, { bar: share });
  if (run.state === "failed") {
    getJson("api/log").then(({ log }) => { byId("log").textContent = log; byId("log").hidden = !log; }).catch(() => {});
  }
  return run.state === "cancelled";
}
