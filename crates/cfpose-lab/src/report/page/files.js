"use strict";
// What can be taken along: CSV and SVG files, made in the browser.

function quoted(cell) {
  const text = cell === null || cell === undefined ? "" : String(cell);
  return /[",\n\r]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
}

/** Rows of cells as the text of a CSV file. */
function csvOf(rows) {
  return rows.map((row) => row.map(quoted).join(",")).join("\n") + "\n";
}

/** The numbers of a figure, of the methods that are on. */
function csvOfFigure(figure, on) {
  if (figure.maps) {
    const rows = [["method", "x", "y", "successes", "trials", "low", "high"]];
    for (const map of figure.maps.filter((m) => on.has(m.method))) {
      map.counts.forEach(([hits, trials], place) => {
        const middle = (k, axis) => ((2 * k + 1) / map.fields - 1) * map.half[axis];
        rows.push([map.label, middle(place % map.fields, 0), middle(Math.floor(place / map.fields), 1), hits, trials, ...map.intervals[place]]);
      });
    }
    return csvOf(rows);
  }
  const rows = [["series", figure.x.label, figure.y.label, "low", "high", "note"]];
  for (const series of visibleSeries(figure, on)) {
    series.x.forEach((x, index) => {
      const value = figure.x.scale === "names" ? figure.x.names[x] : x;
      rows.push([series.label, value, series.y[index], series.low && series.low[index], series.high && series.high[index], series.notes && series.notes[index]]);
    });
  }
  return csvOf(rows);
}

/** The trials: cells and methods stand in the page by their numbers. */
function csvOfTrials(lines, { cells, methods }) {
  const rows = [["cell", "method", "repetition", "success", "error", "evaluations", "seconds"]];
  for (const line of lines.trimEnd().split("\n")) {
    const [cell, method, ...rest] = line.split(",");
    rows.push([cells[cell] || cell, methods[method], ...rest]);
  }
  return csvOf(rows);
}

/** Offer a text as a file. */
function save(name, type, text) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** An SVG element as a file of its own: colours and fonts written out. */
function svgFile(svg) {
  const copy = svg.cloneNode(true);
  const style = getComputedStyle(document.documentElement);
  copy.setAttribute("xmlns", svg.namespaceURI);
  copy.setAttribute("width", svg.viewBox.baseVal.width);
  copy.setAttribute("height", svg.viewBox.baseVal.height);
  copy.querySelectorAll(".spot").forEach((spot) => spot.remove());
  const look = (name) => style.getPropertyValue(name).trim();
  const rules = `svg{font:12px sans-serif;background:${look("--card")}}text{fill:${look("--soft")}}text.strong{fill:${look("--ink")}}` +
    `.grid{stroke:${look("--grid")}}.axis{stroke:${look("--soft")};fill:none}.zero{stroke:${look("--soft")};stroke-dasharray:4 3}`;
  const text = new XMLSerializer().serializeToString(copy).replace(/var\((--[a-z0-9]+)\)/g, (_, name) => look(name));
  return text.replace(">", `><style>${rules}</style>`);
}
