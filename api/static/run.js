// One run: its force, and the displacement of its contact.

import { askJson } from "./service.js";
import { CONFIG, ForcePlot, layout } from "./trace.js";

// Room on both sides, so that a curve's turning point does not hide on the frame.
function roomy(form, values) {
  const known = values.filter((v) => v !== null);
  const [low, high] = known.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [0, 0]);
  form.xaxis.range = [low - 0.03 * (high - low), high + 0.05 * (high - low)];
  return form;
}

const force = new ForcePlot(document.getElementById("force"));
const buttons = { contact: document.getElementById("show-contact"), whole: document.getElementById("show-whole") };

function press(which) {
  for (const [name, button] of Object.entries(buttons)) button.setAttribute("aria-pressed", String(name === which));
}

async function drawContact() {
  const place = document.getElementById("contact");
  const found = await askJson(`/api/v1/runs/${place.dataset.run}/contact`);
  if (found.t.length === 0 || found.alpha.every((v) => v === null)) {
    const words = found.t.length === 0 ? "No contact was found in this record." : "The impact speed is not known, so the displacement is not.";
    for (const plot of place.querySelectorAll(".plot")) plot.replaceWith(Object.assign(document.createElement("p"), { className: "none", textContent: words }));
    return;
  }
  const t = found.t.map((v) => v * 1e3);
  const alpha = found.alpha.map((v) => (v === null ? null : v * 1e3));
  const ink = { mode: "lines", line: { color: "#8a3b12", width: 2 } };
  const near = { hovermode: "closest" };
  await window.Plotly.newPlot("alpha", [{ ...ink, x: t, y: alpha, hovertemplate: "%{x:.3f} ms: %{y:.3f} mm<extra></extra>" }],
    roomy(layout("Time from first contact (ms)", "Displacement α (mm)", near), t), { ...CONFIG, doubleClick: "reset" });
  await window.Plotly.newPlot("loop", [{ ...ink, x: alpha, y: found.force, hovertemplate: "%{x:.3f} mm: %{y:.1f} N<extra></extra>" }],
    roomy(layout("Displacement α (mm)", "Contact force (N)", near), alpha), { ...CONFIG, doubleClick: "reset" });
}

if (force.contact === null) {
  buttons.contact.disabled = true;
  press("whole");
}
buttons.contact.addEventListener("click", () => { press("contact"); force.show(force.around()); });
buttons.whole.addEventListener("click", () => { press("whole"); force.show(force.whole()); });
await force.draw();
await drawContact();
