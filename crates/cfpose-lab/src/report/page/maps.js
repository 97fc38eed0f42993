"use strict";
// Basin maps: one square of fields a method.

const MAP = { side: 210, gap: 62, left: 56, top: 30 };

/** Colour of a success rate: never, half, always. */
function shade(share) {
  const end = share > 0.5 ? "always" : "never";
  const weight = Math.round(100 * Math.abs(2 * share - 1));
  return `color-mix(in srgb, rgb(var(--${end})) ${weight}%, rgb(var(--middle)))`;
}

/** Draw the maps of the methods that are on; returns as chart() does. */
function fieldMaps(figure, on, wide) {
  const maps = figure.maps.filter((map) => on.has(map.method));
  const columns = wide ? 4 : 2;
  const width = wide ? 2 * AREA.width + 36 : AREA.width;
  const rows = Math.max(1, Math.ceil(maps.length / columns));
  const height = MAP.top + rows * (MAP.side + MAP.gap) + 10;
  let markup = "";
  const spots = [];
  maps.forEach((map, index) => {
    const left = MAP.left + (index % columns) * (width / columns);
    const top = MAP.top + Math.floor(index / columns) * (MAP.side + MAP.gap);
    markup += oneMap(figure, map, left, top, spots);
  });
  if (!maps.length) markup = `<text x="${width / 2}" y="120" text-anchor="middle">no method of this plot is switched on</text>`;
  return { markup, spots, width, height, legend: [] };
}

function oneMap(figure, map, left, top, spots) {
  const size = MAP.side / map.fields;
  let markup = `<text class="strong" x="${left + MAP.side / 2}" y="${top - 9}" text-anchor="middle">${escaped(map.label)}</text>`;
  map.counts.forEach(([hits, trials], place) => {
    if (!trials) return;
    const [column, row] = [place % map.fields, Math.floor(place / map.fields)];
    const [x, y] = [left + column * size, top + MAP.side - (row + 1) * size];
    markup += `<rect x="${x.toFixed(1)}" y="${y.toFixed(1)}" width="${size.toFixed(2)}" height="${size.toFixed(2)}" style="fill:${shade(hits / trials)}"/>`;
    const [low, high] = map.intervals[place];
    const middle = (k, axis) => plain(((2 * k + 1) / map.fields - 1) * map.half[axis]);
    const text = `${map.label}\noffset about ${middle(column, 0)}, ${middle(row, 1)}\n${hits} of ${trials} succeed\n95 %: ${plain(100 * low)} % to ${plain(100 * high)} %`;
    spots.push({ x: x + size / 2, y: y + size / 2, colour: "var(--ink)", text, square: size });
  });
  const [half, other] = map.half.map(plain);
  const bottom = top + MAP.side;
  return `${markup}<rect class="axis" x="${left}" y="${top}" width="${MAP.side}" height="${MAP.side}"/>
    <text x="${left}" y="${bottom + 15}">-${half}</text><text x="${left + MAP.side}" y="${bottom + 15}" text-anchor="end">${half}</text>
    <text class="strong" x="${left + MAP.side / 2}" y="${bottom + 31}" text-anchor="middle">${escaped(figure.x.label)}</text>
    <text x="${left - 5}" y="${bottom}" text-anchor="end">-${other}</text><text x="${left - 5}" y="${top + 10}" text-anchor="end">${other}</text>
    <text class="strong" x="${left - 12}" y="${top + MAP.side / 2}" text-anchor="middle" transform="rotate(-90 ${left - 12} ${top + MAP.side / 2})">${escaped(figure.y.label)}</text>`;
}
