"use strict";
// The page: selectors, cards, tables. Data stand in script elements: `index`, `group-0`, `group-1`, ... and `trials`.

const index = JSON.parse(document.getElementById("index").textContent);
const loaded = new Map();
const state = { scenario: 0, group: 0, off: new Set() };
const $ = (id) => document.getElementById(id);

/** Figures and tables of a group, read when they are first needed. */
function groupOf(number) {
  if (!loaded.has(number)) {
    const element = $(`group-${number}`);
    loaded.set(number, element ? JSON.parse(element.textContent) : null);
  }
  return loaded.get(number);
}

function element(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name === "on") node.addEventListener("click", value);
    else node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

/** Show what the mouse is near to. */
function follow(box, drawn) {
  const svg = box.querySelector("svg");
  const hint = element("div", { class: "hint", hidden: "" });
  box.append(hint);
  const hide = () => { hint.hidden = true; svg.querySelectorAll(".spot").forEach((spot) => spot.remove()); };
  svg.addEventListener("mouseleave", hide);
  svg.addEventListener("mousemove", (event) => {
    const area = svg.getBoundingClientRect();
    const factor = drawn.width / area.width;
    const [x, y] = [(event.clientX - area.left) * factor, (event.clientY - area.top) * factor];
    let best = null, nearest = Infinity;
    for (const spot of drawn.spots) {
      // Along a curve the place on the x axis counts most.
      const distance = (spot.x - x) ** 2 + 0.3 * (spot.y - y) ** 2;
      if (distance < nearest) [best, nearest] = [spot, distance];
    }
    hide();
    if (!best) return;
    hint.hidden = false;
    hint.textContent = best.text;
    const left = Math.min(best.x / factor + 14, Math.max(0, area.width - hint.offsetWidth - 4));
    hint.style.left = `${left}px`;
    hint.style.top = `${Math.max(0, best.y / factor - hint.offsetHeight - 10)}px`;
    const mark = document.createElementNS(svg.namespaceURI, best.square ? "rect" : "circle");
    const half = (best.square || 0) / 2;
    const place = best.square ? { x: best.x - half, y: best.y - half, width: best.square, height: best.square } : { cx: best.x, cy: best.y, r: 6.5 };
    for (const [name, value] of Object.entries({ ...place, class: "spot", fill: "none", stroke: best.colour, "stroke-width": 2 })) mark.setAttribute(name, value);
    svg.append(mark);
  });
}

function card(figure, on) {
  const wide = figure.maps ? figure.maps.length > 2 : figure.x.scale === "names" && figure.x.names.length > 8;
  const drawn = (figure.maps ? fieldMaps : chart)(figure, on, wide);
  const box = element("div", { class: "plot" });
  box.innerHTML = `<svg viewBox="0 0 ${drawn.width} ${drawn.height.toFixed(0)}" role="img" aria-label="${escaped(figure.title)}">${drawn.markup}</svg>`;
  const name = `${index.scenarios[state.scenario].name}-${figure.plot}`;
  const top = element("div", { class: "top" }, element("h3", {}, figure.title), element("span", {},
    element("button", { type: "button", on: () => save(`${name}.csv`, "text/csv", csvOfFigure(figure, on)) }, "CSV"), " ",
    element("button", { type: "button", on: () => save(`${name}.svg`, "image/svg+xml", svgFile(box.querySelector("svg"))) }, "SVG")));
  const node = element("section", { class: wide ? "card wide" : "card", id: `plot-${figure.plot}`, "data-plot": figure.plot }, top, box);
  if (drawn.legend.length > 1 && drawn.legend.length <= 12) {
    const entry = (series) => element("span", {}, element("i", { style: `--colour:${colourOf(series.methods[0])}` }), series.label);
    node.append(element("div", { class: "legend" }, ...drawn.legend.map(entry)));
  }
  if (figure.note) node.append(element("p", {}, figure.note));
  follow(box, drawn);
  return node;
}

function tableOf(columns, rows, off) {
  const words = columns.map((_, column) => rows.every((row) => !/^[-<0-9]/.test(row[column]) || row[column] === "-"));
  const head = element("tr", {}, ...columns.map((text, column) => element("th", words[column] ? { class: "words" } : {}, text)));
  const body = rows.map((row) => element("tr", off(row) ? { class: "off" } : {}, ...row.map((text, column) => element("td", words[column] ? { class: "words" } : {}, text))));
  return element("div", { class: "scroll" }, element("table", {}, element("thead", {}, head), element("tbody", {}, ...body)));
}

/** Draw everything for the selection. */
function show() {
  const group = groupOf(state.group);
  const plots = $("plots"), tables = $("tables");
  plots.replaceChildren();
  tables.replaceChildren();
  if (!group) {
    plots.append(element("p", {}, "All cells of this scenario are left out to keep the page small: `cfpose report --svg` writes their figures."));
    return;
  }
  // A group numbers its own methods: those that have records there.
  const on = new Set(group.methods.map((_, method) => method).filter((method) => !state.off.has(group.methods[method])));
  const colours = group.methods.map((name) => index.methods.indexOf(name));
  const recoloured = (list) => list.map((method) => colours[method]);
  const own = new Set([...on].map((method) => colours[method]));
  for (const figure of group.figures) {
    plots.append(card({
      ...figure,
      series: figure.series && figure.series.map((series) => ({ ...series, methods: recoloured(series.methods) })),
      maps: figure.maps && figure.maps.map((map) => ({ ...map, method: colours[map.method] })),
    }, own));
  }
  for (const table of group.tables) {
    const off = (row) => row.slice(0, 2).some((cell) => state.off.has(cell));
    tables.append(element("div", { class: "card wide", "data-table": table.name },
      element("div", { class: "top" }, element("h3", {}, table.summary),
        element("button", { type: "button", on: () => save(`${table.name}.csv`, "text/csv", csvOf([table.columns, ...table.rows])) }, "CSV")),
      tableOf(table.columns, table.rows, off), element("p", {}, table.source)));
  }
}

function fillCells() {
  const scenario = index.scenarios[state.scenario];
  const option = (group) => element("option", { value: String(group.number) }, group.label);
  $("cell").replaceChildren(...scenario.groups.map(option));
  if (scenario.left_out) $("cell").append(element("option", { disabled: "" }, `${scenario.left_out} more are left out of this page`));
  state.group = scenario.groups.length ? scenario.groups[0].number : -1;
}

function fillMethods() {
  const chips = index.methods.map((name, method) => element("button", {
    type: "button", class: "chip", "aria-pressed": String(!state.off.has(name)), "data-method": name, style: `--colour:${colourOf(method)}`,
    on: (event) => {
      if (!state.off.delete(name)) state.off.add(name);
      event.currentTarget.setAttribute("aria-pressed", String(!state.off.has(name)));
      show();
    },
  }, element("i"), name));
  $("methods").replaceChildren(...chips);
}

function theme(dark) {
  document.documentElement.dataset.theme = dark ? "dark" : "light";
}

function start() {
  const prefers = window.matchMedia("(prefers-color-scheme: dark)");
  theme(prefers.matches);
  prefers.addEventListener("change", (event) => theme(event.matches));
  $("theme").addEventListener("click", () => theme(document.documentElement.dataset.theme !== "dark"));
  $("scenario").replaceChildren(...index.scenarios.map((scenario, number) => element("option", { value: String(number) }, scenario.name)));
  $("scenario").addEventListener("change", (event) => { state.scenario = Number(event.target.value); fillCells(); show(); });
  $("cell").addEventListener("change", (event) => { state.group = Number(event.target.value); show(); });
  $("summary-csv").addEventListener("click", () => save("summary.csv", "text/csv", csvOf(index.summary)));
  const trials = $("trials");
  if (trials) $("trials-csv").addEventListener("click", () => save("trials.csv", "text/csv", csvOfTrials(JSON.parse(trials.textContent), index)));
  else $("trials-csv").remove();
  fillCells();
  fillMethods();
  show();
  document.documentElement.dataset.ready = "true";
}

start();
