// What grows with time: the time-distance chart, and the error of one train's position.

import { clock, font, groupColours, prepare, theme, ticks, timeTicks } from '/assets/theme.js';
import { extent, offsets } from '/assets/line.js';

// `rows` are [time, place of each train], a place [track, estimate, sigma, truth] or null.
export function drawTimeDistance(canvas, line, rows, names, options) {
  const colours = theme(options.dark);
  const { pen, width, height } = prepare(canvas, options.height);
  const [left, right, top, bottom] = [54, width < 500 ? 62 : 76, 12, 40];
  const from = offsets(line);
  const whole = extent(line);
  const [plotW, plotH] = [width - left - right, height - top - bottom];
  const t1 = rows.length ? rows[rows.length - 1][0] : 0;
  const t0 = rows.length ? Math.max(rows[0][0], options.last_s ? t1 - options.last_s : -Infinity) : 0;
  const x = (t) => left + ((t - t0) / Math.max(t1 - t0, 30)) * plotW;
  const y = (u) => top + plotH - (u / whole) * plotH;
  frameOf(pen, colours, { left, top, plotW, plotH, width, height });
  pen.font = font(11);
  for (const t of timeTicks(t0, Math.max(t1, t0 + 30), Math.max(2, plotW / 70))) {
    rule(pen, colours, x(t), top, x(t), top + plotH);
    text(pen, colours.soft, clock(t), x(t), top + plotH + 15, 'center');
  }
  for (const u of ticks(0, whole, Math.max(2, plotH / 44)).found) {
    rule(pen, colours, left, y(u), left + plotW, y(u));
    text(pen, colours.soft, (u / 1000).toFixed(whole > 8000 ? 0 : 1), left - 14, y(u) + 4, 'right');
  }
  text(pen, colours.soft, 'simulated time [min:s]', left + plotW / 2, height - 5, 'center');
  upright(pen, colours.soft, 'distance along the line [km]', 12, top + plotH / 2);
  const groups = groupColours(line);
  for (const each of (line.rows || []).filter((row) => row.on_track).flatMap((row) => row.stretches)) {
    const track = (line.tracks || []).find((t) => t.name === each.track);
    if (!track || track.from) continue;
    const u0 = from.get(each.track);
    pen.fillStyle = groups.get(each.group || 0).colour;
    pen.fillRect(left - 8, y(u0 + each.end_m) + 0.5, 6, Math.max(1, y(u0 + each.start_m) - y(u0 + each.end_m) - 1));
  }
  const ends = [];
  pen.save();
  pen.beginPath(); pen.rect(left, top - 4, plotW + 1, plotH + 8); pen.clip();
  const order = names.map((_, k) => k).sort((a, b) => (names[a] === options.train) - (names[b] === options.train));
  for (const k of order) {
    const picked = names[k] === options.train;
    trace(pen, rows, (row) => (row[k + 1] && row[k + 1][3] != null ? [x(row[0]), y(from.get(row[k + 1][0]) + row[k + 1][3])] : null), colours.soft, 1, []);
    const last = trace(
      pen, rows,
      (row) => (row[k + 1] && row[k + 1][1] != null ? [x(row[0]), y(from.get(row[k + 1][0]) + row[k + 1][1]), row[k + 1][0]] : null),
      picked ? colours.pick : colours.ink, picked ? 2.5 : 1.5, [], options.branches,
    );
    if (last && t1 - last.time < 0.15 * (t1 - t0) + 3) ends.push({ name: names[k], picked, at: last.point });
  }
  pen.restore();
  pen.font = font(11, true);
  // Names stand beside the ends of the traces, moved down where they would lie on one another.
  let free = top;
  for (const { name, picked, at } of ends.sort((a, b) => a.at[1] - b.at[1])) {
    const at_y = Math.max(at[1], free);
    free = at_y + 12;
    if (at_y < at[1] + 40) text(pen, picked ? colours.pick : colours.ink, name, Math.min(at[0] + 5, left + plotW + 5), at_y + 4, 'left');
  }
  canvas.dataset.rows = rows.length;
}

function trace(pen, rows, point, colour, thick, dash) {
  pen.strokeStyle = colour;
  pen.lineWidth = thick;
  pen.setLineDash(dash);
  pen.beginPath();
  let before = null;
  let last = null;
  for (const row of rows) {
    const p = point(row);
    if (p) {
      if (before && before[2] === p[2]) pen.lineTo(p[0], p[1]); else { pen.moveTo(p[0], p[1]); pen.lineTo(p[0] + 0.1, p[1]); }
      last = { time: row[0], point: p };
    }
    before = p;
  }
  pen.stroke();
  pen.setLineDash([]);
  return last;
}

// Estimate minus truth over the last minutes, with what it claims: the measured position by two
// sigma, the estimate number `options.trace` (from 0) by its interval.
export function drawError(canvas, rows, index, options) {
  const colours = theme(options.dark);
  const { pen, width, height } = prepare(canvas, 132);
  const traced = options.trace >= 0;
  const [left, right, top, bottom] = [46, 10, 8, 32];
  const [plotW, plotH] = [width - left - right, height - top - bottom];
  const t1 = rows.length ? rows[rows.length - 1][0] : 0;
  const t0 = Math.max(rows.length ? rows[0][0] : 0, t1 - 120);
  const points = rows.filter((row) => row[0] >= t0 - 1e-9 && row[index + 1])
    .map((row) => (traced ? tracedPoint(row[0], row[index + 1], options.trace) : measuredPoint(row[0], row[index + 1])))
    .filter(Boolean);
  const most = Math.max(0.2, ...points.map((p) => Math.max(Math.abs(p.e || 0), Math.min(p.high, 50), Math.min(-p.low, 50))));
  const x = (t) => left + ((t - t0) / Math.max(t1 - t0, 10)) * plotW;
  const y = (e) => top + plotH / 2 - (e / (1.15 * most)) * (plotH / 2);
  frameOf(pen, colours, { left, top, plotW, plotH });
  pen.font = font(11);
  for (const t of timeTicks(t0, Math.max(t1, t0 + 10), Math.max(2, plotW / 80))) {
    text(pen, colours.soft, clock(t), Math.min(x(t), width - 18), top + plotH + 14, 'center');
  }
  for (const e of ticks(-1.1 * most, 1.1 * most, 4).found) {
    rule(pen, colours, left, y(e), left + plotW, y(e));
    text(pen, colours.soft, `${e > 0 ? '+' : ''}${Number(e.toPrecision(2))}`, left - 4, y(e) + 4, 'right');
  }
  text(pen, colours.soft, 'simulated time [min:s]', left + plotW / 2, height - 4, 'center');
  upright(pen, colours.soft, 'error [m]', 11, top + plotH / 2);
  pen.save();
  pen.beginPath(); pen.rect(left, top, plotW, plotH); pen.clip();
  pen.fillStyle = traced ? colours.shade : colours.band;
  for (let k = 1; k < points.length; k += 1) {
    const [a, b] = [points[k - 1], points[k]];
    if (b.t - a.t > 5) continue;
    pen.beginPath();
    pen.moveTo(x(a.t), y(a.high)); pen.lineTo(x(b.t), y(b.high)); pen.lineTo(x(b.t), y(b.low)); pen.lineTo(x(a.t), y(a.low));
    pen.fill();
  }
  rule(pen, { faint: colours.soft }, left, y(0), left + plotW, y(0));
  pen.strokeStyle = traced ? colours.claim : colours.pick;
  pen.lineWidth = 1.8;
  pen.beginPath();
  let before = null;
  for (const p of points) {
    if (p.e != null) { if (before && p.t - before < 5) pen.lineTo(x(p.t), y(p.e)); else pen.moveTo(x(p.t), y(p.e)); }
    before = p.e == null ? null : p.t;
  }
  pen.stroke();
  pen.restore();
  if (!points.length) text(pen, colours.soft, 'no position known', left + plotW / 2, top + plotH / 2 - 8, 'center');
}

function measuredPoint(t, [, estimate, sigma, truth]) {
  if (estimate == null) return null;
  return { t, e: truth == null ? null : estimate - truth, low: -2 * sigma, high: 2 * sigma };
}

// An interval is about the truth: whether it holds it is whether it holds zero.
function tracedPoint(t, place, trace) {
  const [error, low, high] = place.slice(4 + 3 * trace, 7 + 3 * trace);
  return error == null ? null : { t, e: error, low, high };
}

export function frameOf(pen, colours, { left, top, plotW, plotH }) {
  pen.strokeStyle = colours.soft;
  pen.lineWidth = 1;
  pen.strokeRect(left + 0.5, top + 0.5, plotW - 1, plotH - 1);
}

export function rule(pen, colours, x0, y0, x1, y1) {
  pen.strokeStyle = colours.faint;
  pen.lineWidth = 1;
  pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1); pen.stroke();
}

export function text(pen, colour, words, x, y, align) {
  pen.fillStyle = colour;
  pen.textAlign = align;
  pen.fillText(words, x, y);
  pen.textAlign = 'left';
}

export function upright(pen, colour, words, x, y) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(-Math.PI / 2);
  pen.font = font(11);
  text(pen, colour, words, 0, 0, 'center');
  pen.restore();
}
