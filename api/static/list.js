// The last drop and the list of runs: drawn, kept up to date, and analysed where that is still to do.

import { ask, askJson } from "./service.js";
import { ForcePlot } from "./trace.js";

const LOOK_MS = 1500;
const tried = new Set();

export async function drawNewest() {
  const place = document.querySelector("#newest .plot.force");
  if (place !== null) await new ForcePlot(place).draw();
}

function newestShown() {
  return document.querySelector("#runs table")?.dataset.newest ?? "";
}

// Take the page anew and put its list and its last drop in place of those shown.
export async function refresh() {
  const text = await (await ask(location.href, { headers: { Accept: "text/html" } })).text();
  const fresh = new DOMParser().parseFromString(text, "text/html");
  const before = newestShown();
  document.getElementById("runs").replaceChildren(...fresh.getElementById("runs").childNodes);
  if (newestShown() !== before) {
    document.getElementById("newest").replaceChildren(...fresh.getElementById("newest").childNodes);
    await drawNewest();
  }
}

async function analyse() {
  const rows = [...document.querySelectorAll("[data-unanalysed]")].map((row) => row.dataset.unanalysed);
  const waiting = rows.filter((run) => !tried.has(run));
  for (const run of waiting) {
    tried.add(run);
    await askJson(`/api/v1/runs/${run}`).catch(() => null); // the run's own page tells why it cannot be analysed
  }
  if (waiting.length > 0) await refresh();
}

function typing() {
  return document.activeElement?.closest("#runs input") != null;
}

async function look() {
  try {
    const [newest] = (await askJson("/api/v1/runs?limit=1")).runs;
    if ((newest?.run ?? "") !== newestShown() && !typing()) await refresh();
    await analyse();
  } catch {
    // the service does not answer; the next look will tell
  }
  setTimeout(look, LOOK_MS);
}

await drawNewest();
await look();
