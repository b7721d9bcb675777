// The line as a map: north up, both axes to the same scale.

import { engineering, font, groupColours, levels, prepare, theme, ticks } from '/assets/theme.js';
import { placeOf } from '/assets/line.js';

const SIDE = 14; // px kept free to the left of the bar

export function drawMap(canvas, line, frame, options) {
  const colours = theme(options.dark);
  const paths = line.paths || {};
  const points = Object.values(paths).flat();
  const { pen, width, height } = prepare(canvas, Math.min(360, Math.max(240, canvas.clientWidth * 0.32)));
  const hits = [];
  if (!points.length) {
    pen.fillStyle = colours.soft;
    pen.font = font(13);
    pen.fillText('No path of a track has been received.', SIDE, 30);
    return hits;
  }
  const xs = points.map((p) => p[1]);
  const ys = points.map((p) => p[2]);
  const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const pad = 40;
  const scale = Math.min((width - 2 * pad) / Math.max(x1 - x0, 1), (height - 2 * pad - 20) / Math.max(y1 - y0, 1));
  const toX = (px) => width / 2 + (px - (x0 + x1) / 2) * scale;
  const toY = (py) => (height - 20) / 2 - (py - (y0 + y1) / 2) * scale;
  const lengths = new Map((line.tracks || []).map((t) => [t.name, t.length_m]));
  const at = (track, chainage) => {
    const path = paths[track];
    if (!path) return null;
    const share = Math.max(0, Math.min(1, chainage / (lengths.get(track) || 1)));
    let k = Math.max(1, path.findIndex((p) => p[0] >= share));
    if (k < 1) k = path.length - 1;
    const [a, b] = [path[k - 1], path[k]];
    const part = (share - a[0]) / Math.max(b[0] - a[0], 1e-9);
    return [a[1] + (b[1] - a[1]) * part, a[2] + (b[2] - a[2]) * part];
  };
  const stroke = (track, low, high, colour, thick) => {
    const size = lengths.get(track) || 1;
    const inner = (paths[track] || []).filter((p) => p[0] * size > low && p[0] * size < high);
    const chain = [at(track, low), ...inner.map((p) => [p[1], p[2]]), at(track, high)].filter(Boolean);
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.beginPath();
    chain.forEach((p, k) => (k ? pen.lineTo(toX(p[0]), toY(p[1])) : pen.moveTo(toX(p[0]), toY(p[1]))));
    pen.stroke();
  };
  const groups = groupColours(line);
  for (const track of line.tracks || []) stroke(track.name, 0, track.length_m, colours.line, 2);
  for (const each of (line.rows || []).filter((row) => row.on_track).flatMap((row) => row.stretches)) {
    stroke(each.track, each.start_m, each.end_m, groups.get(each.group || 0).colour, 7);
  }
  pen.font = font(11);
  const names = [];
  for (const mark of (line.rows || []).flatMap((row) => row.marks)) {
    if (!mark.map_m) continue;
    const [px, py] = [toX(mark.map_m[0]), toY(mark.map_m[1])];
    pen.fillStyle = colours.ink;
    pen.beginPath(); pen.arc(px, py, 2.5, 0, 7); pen.fill();
    if (names.every(([nx, ny]) => Math.hypot(nx - px, ny - py) > 46)) {
      pen.fillStyle = colours.soft;
      pen.strokeStyle = colours.paper;
      pen.lineWidth = 4;
      pen.textAlign = 'center';
      pen.strokeText(mark.name, px, py + 20);
      pen.fillText(mark.name, px, py + 20);
      names.push([px, py]);
    }
  }
  pen.font = font(12, true);
  const spots = (frame.trains || []).map((train) => {
    const place = placeOf(train);
    const spot = place && at(place.track, place.at);
    return spot && { train, place, x: toX(spot[0]), y: toY(spot[1]), width: pen.measureText(train.name).width, first: train.name === options.train };
  }).filter(Boolean);
  const placed = levels(spots, 3);
  for (const [k, { train, place, x: px, y: py }] of spots.entries()) {
    const picked = train.name === options.train;
    pen.fillStyle = pen.strokeStyle = picked ? colours.pick : colours.ink;
    pen.lineWidth = 2;
    pen.beginPath(); pen.arc(px, py, 7, 0, 7);
    if (place.known) pen.fill(); else pen.stroke();
    pen.lineWidth = 1.5;
    pen.strokeStyle = colours.paper;
    pen.beginPath(); pen.arc(px, py, 7, 0, 7); pen.stroke();
    pen.font = font(12, true);
    pen.textAlign = 'center';
    pen.fillText(place.known ? train.name : `${train.name} ?`, Math.max(40, Math.min(width - 40, px)), py - 13 - 14 * Math.max(0, placed[k]));
    hits.push({ name: train.name, x: px, y: py });
  }
  bar(pen, colours, scale, width, height);
  canvas.dataset.trains = hits.length;
  return hits;
}

function bar(pen, colours, scale, width, height) {
  const { step } = ticks(0, 120 / scale, 2);
  const y = height - 12;
  pen.strokeStyle = pen.fillStyle = colours.soft;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(SIDE, y - 4); pen.lineTo(SIDE, y); pen.lineTo(SIDE + step * scale, y); pen.lineTo(SIDE + step * scale, y - 4);
  pen.stroke();
  pen.textAlign = 'left';
  pen.font = font(11);
  pen.fillText(`${engineering(step, 'm')}, north is up`, SIDE + step * scale + 8, y + 1);
}
