"use strict";
// Numbers and axes: the same rules as figure/ticks.rs.

/** Write a number in at most four digits. */
function plain(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "-";
  const short = Number(value.toPrecision(4));
  const size = Math.abs(short);
  return size !== 0 && (size < 1e-3 || size >= 1e5) ? short.toExponential().replace("e+", "e") : String(short);
}

/** Write a value as its axis shows it. */
function shown(axis, value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "none";
  return axis.scale === "share" ? `${plain(100 * value)} %` : plain(value);
}

function roundStep(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  return ([1, 2, 5, 10].find((digit) => digit * power >= step * (1 - 1e-9)) || 10) * power;
}

function linearMarks(low, high) {
  const step = roundStep((high - low) / 5);
  const marks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high * (1 + 1e-9) + 1e-12; k += 1) marks.push(k * step);
  return marks;
}

function logMarks(low, high) {
  const decades = Math.log10(high / low);
  if (high < 4 * low) return linearMarks(low, high).filter((mark) => mark >= low && mark <= high);
  const digits = decades < 1.5 ? [1, 2, 5] : [1];
  const every = Math.max(1, Math.ceil(decades / 6));
  const marks = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power += 1) {
    if (power % every !== 0) continue;
    for (const digit of digits) {
      const mark = digit * 10 ** power;
      if (mark >= low * (1 - 1e-9) && mark <= high * (1 + 1e-9)) marks.push(mark);
    }
  }
  return marks;
}

/**
 * Lay out an axis over values. Returns { place(value) in 0..1, marks: [[value, text]], low, high }.
 * `kept` are the places of an axis of names that have something to show; the others are left out.
 */
function ruler(axis, values, kept) {
  if (axis.scale === "names") {
    const places = new Map(kept.map((name, index) => [name, index]));
    const step = Math.max(1, Math.ceil(kept.length / 28));
    return {
      place: (value, shift = 0) => ((places.get(value) ?? 0) + 0.5 + shift) / Math.max(kept.length, 1),
      marks: kept.filter((_, index) => index % step === 0).map((name) => [name, axis.names[name] ?? ""]),
      count: kept.length,
    };
  }
  const log = axis.scale === "log";
  const fit = values.filter((v) => Number.isFinite(v) && (!log || v > 0));
  let low = fit.length ? fit.reduce((a, b) => Math.min(a, b)) : 1;
  let high = fit.length ? fit.reduce((a, b) => Math.max(a, b)) : 1;
  if (axis.scale === "share" && low >= 0) [low, high] = [0, 1];
  else if (log) { if (high < 1.5 * low) [low, high] = [low / 2, high * 2]; }
  else if (high === low) [low, high] = [low - 0.5, high + 0.5];
  else [low, high] = [low - 0.04 * (high - low), high + 0.04 * (high - low)];
  const raw = log ? (v) => Math.log(v / low) / Math.log(high / low) : (v) => (v - low) / (high - low);
  const marks = (log ? logMarks : linearMarks)(low, high);
  return { low, high, place: (v) => Math.min(1, Math.max(0, raw(v))), marks: marks.map((v) => [v, shown(axis, v)]) };
}
