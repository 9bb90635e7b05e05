// Force against time: the least and the greatest of each stretch of what is in view, fetched anew at each zoom.

import { ask } from "./service.js";

const MARGIN = 0.5; // of the view, fetched on each side, so that a short pan shows no gap
const SETTLE_MS = 120;
const INK = "#12395b";
const LAYOUT = {
  margin: { l: 70, r: 20, t: 28, b: 50 },
  paper_bgcolor: "#fff",
  plot_bgcolor: "#fff",
  font: { family: "system-ui, sans-serif", size: 14, color: "#1c2733" },
  dragmode: "zoom",
  showlegend: false,
};
const AXIS = { gridcolor: "#e3e8ee", zerolinecolor: "#9aa7b4", linecolor: "#5b6875", ticks: "outside", mirror: true, showline: true };
export const CONFIG = {
  responsive: true,
  displaylogo: false,
  doubleClick: false,
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "resetScale2d"],
};

export function layout(x, y, more = {}) {
  return { ...LAYOUT, xaxis: { ...AXIS, title: { text: x } }, yaxis: { ...AXIS, title: { text: y } }, ...more };
}

function number(text) {
  return text === "" || text === undefined ? null : Number(text);
}

export class ForcePlot {
  constructor(place) {
    const { run, points, rate, contact, length, peak } = place.dataset;
    Object.assign(this, { place, run, points: Number(points), rate: Number(rate) });
    this.contact = number(contact); // s after the first sample
    this.length = number(length); // s
    this.peak = number(peak); // s after first contact
    this.origin = this.contact ?? 0;
    this.pending = null;
    this.timer = 0;
  }

  // The whole record, and the contact with some of what surrounds it, in ms.
  whole() {
    return [this.ms(0), this.ms(this.points - 1)];
  }

  around() {
    if (this.contact === null) return this.whole();
    const length = (this.length ?? 0.005) * 1e3;
    const [first, last] = this.whole();
    return [Math.max(first, -0.25 * length), Math.min(last, 1.6 * length)];
  }

  ms(index) {
    return (index / this.rate - this.origin) * 1e3;
  }

  async draw() {
    const range = this.around();
    const title = this.contact === null ? "Time from the first sample (ms)" : "Time from first contact (ms)";
    const form = layout(title, "Force (N)", { shapes: this.marks(), annotations: this.words(), hovermode: "x" });
    form.xaxis.range = range;
    form.yaxis.fixedrange = true;
    const trace = { x: [], y: [], mode: "lines", line: { color: INK, width: 1.6 }, hovertemplate: "%{y:.1f} N<extra></extra>" };
    await window.Plotly.newPlot(this.place, [trace], form, CONFIG);
    this.place.on("plotly_relayout", (change) => this.moved(change));
    this.place.on("plotly_doubleclick", () => this.show(this.whole()));
    await this.load(range);
  }

  show(range) {
    return window.Plotly.relayout(this.place, { "xaxis.range": range });
  }

  moved(change) {
    if (!Object.keys(change).some((key) => key.startsWith("xaxis"))) return;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.load(this.place.layout.xaxis.range), SETTLE_MS);
  }

  async load([from, to]) {
    const more = (to - from) * MARGIN;
    const index = (ms) => Math.round((ms * 1e-3 + this.origin) * this.rate);
    const start = Math.max(0, Math.min(index(from - more), this.points - 1));
    const stop = Math.min(this.points, Math.max(index(to + more) + 1, start + 2));
    this.pending?.abort();
    this.pending = new AbortController();
    try {
      await this.fill(start, stop, this.pending.signal);
    } catch (error) {
      if (error.name !== "AbortError") this.place.dataset.error = error.message;
    }
  }

  async fill(start, stop, signal) {
    const path = `/api/v1/runs/${this.run}/envelope?slice=${start}:${stop}&points=4000&format=octet-stream`;
    const answer = await ask(path, { signal });
    const pairs = new Float32Array(await answer.arrayBuffer());
    const x = new Array(pairs.length / 2);
    const y = new Array(pairs.length / 2);
    for (let i = 0; i < x.length; i += 1) {
      x[i] = this.ms(start + pairs[2 * i]);
      y[i] = pairs[2 * i + 1];
    }
    await window.Plotly.update(this.place, { x: [x], y: [y] }, { "yaxis.autorange": true });
    this.place.dataset.loaded = `${start}:${stop}`;
  }

  moments() {
    if (this.contact === null) return [];
    const found = [[0, "first contact"]];
    if (this.peak !== null) found.push([this.peak * 1e3, "t<sub>M</sub>"]);
    if (this.length !== null) found.push([this.length * 1e3, "t<sub>c</sub>"]);
    return found;
  }

  marks() {
    const line = { color: "#8896a5", width: 1, dash: "dot" };
    return this.moments().map(([x]) => ({ type: "line", x0: x, x1: x, y0: 0, y1: 1, yref: "paper", line }));
  }

  words() {
    const font = { size: 13, color: "#4a5866" };
    return this.moments().map(([x, text]) => ({ x, y: 1, yref: "paper", yanchor: "bottom", text, showarrow: false, font }));
  }
}
