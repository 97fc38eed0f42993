"use strict";
// Works the page as a reader would, and writes what it found into an element `probe`.
(() => {
  const errors = [];
  window.addEventListener("error", (event) => errors.push(String(event.message)));
  const wrong = console.error;
  console.error = (...words) => { errors.push(words.join(" ")); wrong(...words); };
  const found = { opened: performance.now(), ready: document.documentElement.dataset.ready, plots: {}, changes: {}, bands: 0, bars: 0, fields: 0 };
  if (found.ready !== "true") errors.push("the page did not get ready");
  const plots = document.getElementById("plots");
  const count = () => {
    for (const card of plots.querySelectorAll("[data-plot]")) {
      const drawn = card.querySelectorAll("svg circle, svg rect, svg path[fill], svg path[stroke]").length;
      found.plots[card.dataset.plot] = Math.max(found.plots[card.dataset.plot] || 0, drawn);
    }
    found.bands = Math.max(found.bands, plots.querySelectorAll("path[fill-opacity]").length);
    found.bars = Math.max(found.bars, plots.querySelectorAll('path[stroke-width="1.5"]').length);
    found.fields = Math.max(found.fields, plots.querySelectorAll("#plot-basin-map rect[style]").length);
  };
  const choose = (id, value) => {
    const select = document.getElementById(id);
    select.value = value;
    select.dispatchEvent(new Event("change"));
  };
  /** Whether every plot that is there before and after differs. */
  const changed = (act) => {
    const before = new Map([...plots.querySelectorAll("[data-plot]")].map((card) => [card.dataset.plot, card.querySelector("svg").innerHTML]));
    act();
    count();
    const after = [...plots.querySelectorAll("[data-plot]")].filter((card) => before.has(card.dataset.plot));
    return after.length > 3 && after.every((card) => card.querySelector("svg").innerHTML !== before.get(card.dataset.plot));
  };
  count();
  // The published figures are those of one cell of the first scenario and do not change with the cell.
  found.changes.cell = changed(() => choose("cell", document.getElementById("cell").options[2].value));
  found.changes.method = changed(() => document.querySelector(".chip").click());
  document.querySelector(".chip").click();
  found.changes.scenario = changed(() => choose("scenario", "1"));
  choose("scenario", "0");
  const before = getComputedStyle(document.body).backgroundColor;
  document.getElementById("theme").click();
  found.changes.theme = getComputedStyle(document.body).backgroundColor !== before;
  const svg = plots.querySelector("#plot-performance-profile svg");
  const area = svg.getBoundingClientRect();
  svg.dispatchEvent(new MouseEvent("mousemove", { clientX: area.left + area.width / 2, clientY: area.top + area.height / 2 }));
  const texts = [...plots.querySelectorAll(".hint")].filter((hint) => !hint.hidden).map((hint) => hint.textContent);
  found.changes.hint = texts.length === 1 && texts[0].includes("95 %");
  const saved = [];
  const make = URL.createObjectURL;
  URL.createObjectURL = (blob) => { saved.push(blob.size); return make(blob); };
  plots.querySelector("#plot-success button").click();
  found.changes.csv = saved[0] > 200;
  document.getElementById("trials-csv").click();
  found.changes.trials = saved[1] > 1e6;
  const result = document.createElement("pre");
  result.id = "probe";
  found.errors = errors;
  result.textContent = JSON.stringify(found);
  document.body.append(result);
})();
