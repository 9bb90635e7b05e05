// The bench: arm, follow, disarm. What the banner says comes from the acquisition's own events, never from a guess.

import { ask, askJson } from "./service.js";
import { refresh } from "./list.js";

const PATH = "/api/v1/acquisitions";
const LOOK_MS = 2000;
const SAYS = {
  idle: ["○", "NOT ARMED", "Fill in the test, then arm."],
  starting: ["◌", "CONNECTING", "Reaching the recorder."],
  connected: ["◌", "CONNECTED", "Giving the recorder its settings."],
  configured: ["◔", "CONFIGURED", "Not armed yet: keep the dart in its clamp."],
  waiting: ["◔", "NOT READY", "The interlock does not allow a drop yet."],
  armed: ["▼", "ARMED – DROP NOW", "The recorder waits for the impact."],
  triggered: ["◆", "TRIGGERED", "Recording."],
  reading: ["◕", "READING", "The recorder holds the record until it is saved."],
  saved: ["✓", "SAVED", ""],
  disarmed: ["○", "DISARMED", "No drop was recorded."],
  failed: ["✕", "FAILED", ""],
  busy: ["▣", "IN USE", "Another process holds the rig."],
  lost: ["?", "NO ANSWER", "The service does not answer. A drop that is armed goes on without it; this page tries again."],
};
const RUNNING = ["starting", "connected", "configured", "waiting", "armed", "triggered", "reading"];
const DISARMABLE = ["starting", "connected", "configured", "waiting", "armed"];
const NOTHING_HELD = ["interlock", "no-trigger", "aborted", "RigBusy", "SettingsError"]; // ends that leave no record
const EARLY = [["v0", "v₀", "m/s", 1], ["F_M", "F_M", "N", 1], ["t_c", "t_c", "ms", 1e3], ["alpha_M", "α_M", "mm", 1e3], ["eps_exact", "ε", "", 1]];
const $ = (id) => document.getElementById(id);
let stream = null;
let warned = [];

function show(state, text = null, progress = null, outcome = null) {
  const [mark, word, usual] = SAYS[state];
  const share = progress && progress.total ? progress.done / progress.total : null;
  $("banner").dataset.state = state;
  $("state-mark").textContent = mark;
  $("state-word").textContent = state === "reading" && share !== null ? `${word} ${Math.floor(100 * share)} %` : word;
  $("pace").textContent = state === "reading" && progress ? pace(progress) : "";
  $("state-text").textContent = text || usual;
  $("progress").hidden = state !== "reading";
  if (share === null) $("progress").removeAttribute("value"); // a bar that moves without an amount
  else $("progress").value = share;
  $("arm").disabled = RUNNING.includes(state) || state === "lost" || state === "busy";
  $("recover").hidden = state !== "failed" || NOTHING_HELD.includes(outcome);
  $("disarm").disabled = !DISARMABLE.includes(state);
  document.title = `${word} · droptower`;
}

// What stands under the state's word; null for the words that belong to the state.
function words(state, { run, text }) {
  if (state === "saved") return run ? `${run}: on the disk, and it reads back the same.` : $("state-text").textContent;
  return state === "armed" ? null : text;
}

function pace({ bytes, rate_B_s: rate, left_s: left }) {
  const kilobytes = (n) => (n / 1e3).toPrecision(3);
  return `${kilobytes(bytes)} kB, ${kilobytes(rate)} kB/s, ${left === null ? "?" : left.toFixed(left < 10 ? 1 : 0)} s left`;
}

// What the contact shows while the rest of the record is still being read.
function early(found) {
  const said = found
    ? EARLY.filter(([symbol]) => found.findings[symbol]?.value != null).map(
        ([symbol, name, unit, factor]) => `${name} ${(found.findings[symbol].value * factor).toPrecision(4)} ${unit}`.trim(),
      )
    : [];
  $("early").hidden = said.length === 0;
  $("early").textContent = said.length ? `Preliminary: ${said.join(" · ")}` : "";
}

function warn(warnings) {
  warned = warnings;
  $("told").replaceChildren(
    ...warnings.map(({ code, text }) => {
      const item = document.createElement("li");
      item.textContent = text;
      item.dataset.code = code;
      return item;
    }),
  );
  $("told").hidden = warnings.length === 0;
}

function complain(words) {
  $("order-error").textContent = words;
  $("order-error").hidden = words === "";
}

function follow() {
  stream?.close();
  stream = new EventSource(`${PATH}/current/events`);
  stream.onmessage = async ({ data }) => {
    const event = JSON.parse(data);
    show(event.state, words(event.state, event), event.event === "progress" ? event : null, event.outcome);
    if (event.event === "preliminary") early(event);
    if (event.event === "saved") {
      early(null);
      await refresh();
    }
    if (event.event === "connected") warn([]);
    if (event.event === "warning") warn([...warned, event]);
    if (event.event === "done" || event.event === "failed") {
      stream?.close();
      stream = null;
    }
  };
  stream.onopen = () => tell().catch(() => show("lost"));
  stream.onerror = () => show("lost");
}

async function tell() {
  const now = await askJson(`${PATH}/current`);
  show(now.state, words(now.state, now), now.progress, now.outcome);
  warn(now.warnings);
  early(now.state === "reading" ? now.preliminary : null);
  return now;
}

async function catchUp() {
  if (!(await tell()).done) follow();
}

async function look() {
  try {
    if (stream === null || stream.readyState === EventSource.CLOSED) await catchUp();
  } catch {
    show("lost");
  }
  setTimeout(look, LOOK_MS);
}

async function start(path, order) {
  complain("");
  $("arm").disabled = true;
  try {
    await ask(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(order) });
    show("starting");
    follow();
  } catch (error) {
    if (error.code === "specimen" && confirm(`${error.message}\n\nHit it again?`)) {
      await start(path, { ...order, again: true });
      return;
    }
    complain(error.message);
    await catchUp().catch(() => show("lost"));
  }
}

$("order").addEventListener("submit", (event) => {
  event.preventDefault();
  start(PATH, { test: $("test").value, series: $("series").value.trim() || null });
});
$("recover").addEventListener("click", () => start(`${PATH}/recovery`, {}));

$("disarm").addEventListener("click", async () => {
  $("disarm").disabled = true;
  await ask(`${PATH}/current`, { method: "DELETE" }).catch((error) => complain(error.message));
});

// What was typed outlives a reload of the page, but not a newer drop, whose test is the better start.
const draft = `droptower-draft-${$("test").dataset.from}`;
for (const id of ["test", "series"]) {
  const kept = sessionStorage.getItem(`${draft}-${id}`);
  if (kept !== null) $(id).value = kept;
  $(id).addEventListener("input", () => sessionStorage.setItem(`${draft}-${id}`, $(id).value));
}
await look();
