"use strict";
// Curves and dots with intervals, drawn as SVG text. A figure is what figure.rs writes.

const AREA = { width: 620, left: 62, right: 606, top: 14, bottom: 276 };

/** Escape text for markup. */
function escaped(text) {
  return String(text).replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);
}

/** Colour of a method. */
function colourOf(method) {
  return `var(--m${method % 8})`;
}

/** Dashes tell the ninth method from the first. */
function dashOf(method) {
  return method < 8 ? "" : ` stroke-dasharray="${method < 16 ? "7 3" : "2 3"}"`;
}

/** Series of a figure that are shown while these methods are on. */
function visibleSeries(figure, on) {
  return (figure.series || []).filter((series) => series.methods.every((method) => on.has(method)));
}

function extent(series) {
  const all = series.flatMap((s) => [...s.y, ...(s.low || []), ...(s.high || [])]);
  return all.filter((v) => v !== null);
}

/**
 * Draw a figure. Returns { markup, spots, width, height, legend }: spots are the places that answer to the mouse.
 */
function chart(figure, on, wide) {
  const series = visibleSeries(figure, on);
  const names = figure.x.scale === "names";
  const kept = names ? [...new Set(series.flatMap((s) => s.x))].sort((a, b) => a - b) : [];
  const width = wide ? 2 * AREA.width + 36 : AREA.width;
  const right = width - (AREA.width - AREA.right);
  const x = ruler(figure.x, series.flatMap((s) => s.x), kept);
  const y = ruler(figure.y, extent(series), []);
  const at = (value, shift) => AREA.left + x.place(value, shift) * (right - AREA.left);
  const up = (value) => AREA.bottom - y.place(value) * (AREA.bottom - AREA.top);
  const longest = names ? Math.max(0, ...x.marks.map(([, text]) => text.length)) : 0;
  const slanted = names && longest * 6.4 > (right - AREA.left) / Math.max(kept.length, 1);
  const below = slanted ? Math.min(150, 26 + longest * 3) : 44;
  const frame = { at, up, right, slanted };
  let markup = axes(figure, x, y, frame);
  const spots = [];
  const owners = [...new Set(series.map((s) => s.methods.join()))];
  for (const s of series) {
    const beside = names && figure.plot !== "published" && kept.length && series.some((other) => other !== s && other.x.some((v) => s.x.includes(v)));
    const shift = beside ? ((owners.indexOf(s.methods.join()) + 0.5) / owners.length - 0.5) * 0.7 : 0;
    markup += s.style === "line" || s.style === "steps" ? curve(s, frame, figure) : dots(s, frame, shift);
    s.x.forEach((value, index) => {
      if (s.y[index] === null) return;
      spots.push({ x: at(value, shift), y: up(s.y[index]), colour: colourOf(s.methods[0]), text: hint(figure, s, index) });
    });
  }
  if (!series.length) markup += `<text x="${width / 2}" y="150" text-anchor="middle">no method of this plot is switched on</text>`;
  return { markup, spots, width, height: AREA.bottom + below, legend: series };
}

function axes(figure, x, y, { at, up, right, slanted }) {
  let markup = "";
  for (const [value, text] of y.marks) {
    markup += `<path class="grid" d="M${AREA.left} ${up(value).toFixed(1)}H${right}"/>`;
    markup += `<text x="${AREA.left - 7}" y="${(up(value) + 4).toFixed(1)}" text-anchor="end">${escaped(text)}</text>`;
  }
  if (y.low < 0 && y.high > 0) markup += `<path class="zero" d="M${AREA.left} ${up(0).toFixed(1)}H${right}"/>`;
  for (const [value, text] of x.marks) {
    const place = at(value).toFixed(1);
    const turn = slanted ? ` text-anchor="end" transform="rotate(-24 ${place} ${AREA.bottom + 16})"` : ' text-anchor="middle"';
    const long = text.length > 44 ? `${text.slice(0, 43)}\u2026` : text;
    markup += `<path class="axis" d="M${place} ${AREA.bottom}v4"/><text x="${place}" y="${AREA.bottom + 17}"${turn}>${escaped(long)}</text>`;
  }
  markup += `<path class="axis" d="M${AREA.left} ${AREA.top}V${AREA.bottom}H${right}"/>`;
  if (figure.x.scale !== "names") {
    markup += `<text class="strong" x="${(AREA.left + right) / 2}" y="${AREA.bottom + 37}" text-anchor="middle">${escaped(figure.x.label)}</text>`;
  }
  const middle = (AREA.top + AREA.bottom) / 2;
  return `${markup}<text class="strong" x="13" y="${middle}" text-anchor="middle" transform="rotate(-90 13 ${middle})">${escaped(figure.y.label)}</text>`;
}

/** Way through (x, y) values: straight, or in steps that change at each x. */
function way(xs, ys, steps, { at, up }) {
  const points = [];
  xs.forEach((value, index) => {
    if (ys[index] === null || ys[index] === undefined) return;
    const next = [at(value), up(ys[index])];
    if (steps && points.length) points.push([next[0], points[points.length - 1][1]]);
    points.push(next);
  });
  return points;
}

const joined = (points) => points.map(([a, b]) => `${a.toFixed(1)} ${b.toFixed(1)}`).join("L");

function curve(series, frame, figure) {
  const steps = series.style === "steps";
  const colour = colourOf(series.methods[0]);
  let markup = "";
  if (series.low) {
    const top = figure.y.scale === "log" ? Infinity : series.high;
    const lower = way(series.x, series.low, steps, frame);
    const upper = way(series.x, top === Infinity ? series.high : top, steps, frame).reverse();
    if (lower.length && upper.length) markup += `<path d="M${joined([...lower, ...upper])}Z" fill="${colour}" fill-opacity=".14"/>`;
  }
  const line = way(series.x, series.y, steps, frame);
  return line.length ? `${markup}<path d="M${joined(line)}" fill="none" stroke="${colour}" stroke-width="2"${dashOf(series.methods[0])}/>` : markup;
}

function dots(series, { at, up }, shift) {
  const colour = colourOf(series.methods[0]);
  let markup = "";
  series.x.forEach((value, index) => {
    if (series.y[index] === null) return;
    const [x, y] = [at(value, shift), up(series.y[index])];
    const low = series.low && series.low[index];
    if (low !== null && low !== undefined) {
      // An open interval ends at the edge.
      const from = up(low), to = series.high[index] === null ? AREA.top : up(series.high[index]);
      markup += `<path d="M${x.toFixed(1)} ${from.toFixed(1)}V${to.toFixed(1)}M${(x - 4).toFixed(1)} ${from.toFixed(1)}h8M${(x - 4).toFixed(1)} ${to.toFixed(1)}h8" stroke="${colour}" stroke-width="1.5" fill="none"/>`;
    }
    markup += series.style === "diamonds"
      ? `<path d="M${x.toFixed(1)} ${(y - 6).toFixed(1)}l6 6l-6 6l-6 -6Z" fill="var(--card)" stroke="${colour}" stroke-width="2"/>`
      : `<circle cx="${x.toFixed(1)}" cy="${y.toFixed(1)}" r="4" fill="${colour}"/>`;
  });
  return markup;
}

/** What the mouse says at a point. */
function hint(figure, series, index) {
  const lines = [series.label];
  const x = figure.x.scale === "names" ? figure.x.names[series.x[index]] : `${figure.x.label}: ${shown(figure.x, series.x[index])}`;
  if (x !== series.label) lines.push(x);
  lines.push(`${figure.y.label}: ${shown(figure.y, series.y[index])}`);
  if (series.low && series.low[index] !== null) lines.push(`95 %: ${shown(figure.y, series.low[index])} to ${shown(figure.y, series.high[index])}`);
  if (series.notes && series.notes[index]) lines.push(series.notes[index]);
  return lines.join("\n");
}
