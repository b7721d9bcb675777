// The line to scale: as a strip along the chainage.

import { font, groupColours, levels, prepare, theme, ticks } from '/assets/theme.js';

const SIDE = 14; // px kept free to either side

// Where each track begins on the common axis: a branch at its junction.
export function offsets(line) {
  const found = new Map();
  const tracks = new Map((line.tracks || []).map((track) => [track.name, track]));
  const of = (name, depth = 0) => {
    if (found.has(name)) return found.get(name);
    const track = tracks.get(name);
    if (!track || depth > 100) return 0;
    const at = track.from ? of(track.from, depth + 1) + track.from_m : 0;
    found.set(name, at);
    return at;
  };
  for (const name of tracks.keys()) of(name);
  return found;
}

export function extent(line) {
  const from = offsets(line);
  const ends = (line.tracks || []).map((track) => from.get(track.name) + track.length_m);
  return Math.max(1, ...ends);
}

// Place and sense of a train as it is said to be; null while it is not on the line.
export function placeOf(train) {
  if (!train.on) return null;
  if (train.at_m != null && train.track) {
    return { track: train.track, at: train.at_m, known: train.known === true && !train.gone };
  }
  return train.true ? { track: train.true[0], at: train.true[1], known: false } : null;
}

// The strip. `view` is {span_m, centre_m} of the common axis, or null for the whole line.
export function drawStrip(canvas, line, frame, options) {
  const colours = theme(options.dark);
  const from = offsets(line);
  const whole = extent(line);
  const rows = line.tracks || [];
  const onTrack = (line.rows || []).filter((row) => row.on_track);
  const below = (line.rows || []).filter((row) => !row.on_track);
  const rowHeight = 110 + below.reduce((sum, row) => sum + heightOf(row), 0);
  const { pen, width, height } = prepare(canvas, rows.length * rowHeight + 30);
  const span = options.span_m || whole;
  const first = options.span_m ? options.centre_m - span / 2 : 0;
  const scale = (width - 2 * SIDE) / span;
  const x = (u) => SIDE + (u - first) * scale;
  const groups = groupColours(line);
  const out = new Set([...(frame.off || []), ...(frame.failed || [])]);
  const hits = [];
  axis(pen, colours, x, first, first + span, width, height, rows.length * rowHeight);
  rows.forEach((track, row) => {
    const u0 = from.get(track.name);
    const top = row * rowHeight;
    const yBar = top + 72;
    pen.fillStyle = colours.soft;
    pen.font = font(12, true);
    const label = track.from ? `${track.name}, from ${track.from} at ${(track.from_m / 1000).toFixed(2)} km` : track.name;
    const labelX = Math.max(SIDE, Math.min(x(u0) + (track.from ? 7 : 0), width - pen.measureText(label).width - 4));
    if (track.from) junction(pen, colours, x(u0), yBar, rowHeight);
    pen.fillStyle = colours.paper;
    pen.fillRect(labelX - 3, top + 2, pen.measureText(label).width + 6, 15);
    pen.fillStyle = colours.soft;
    pen.fillText(label, labelX, top + 13);
    const place = { track, u0, x, width, out };
    bed(pen, colours, onTrack, yBar, place);
    for (const each of onTrack) {
      coloured(pen, each, groups, yBar, place);
      posts(pen, colours, each, stateOf(frame, each), yBar, place);
    }
    let y = yBar + 36;
    for (const each of below) {
      stretches(pen, colours, each, stateOf(frame, each), y, place);
      marks(pen, colours, each, stateOf(frame, each), y + (each.stretches.length ? 22 : 0), place);
      y += heightOf(each);
    }
    trains(pen, colours, line, frame, track, u0, x, top, scale, options, hits, width);
  });
  canvas.dataset.trains = hits.length;
  return hits;
}

function axis(pen, colours, x, low, high, width, height, y) {
  const { step, found } = ticks(low, high, Math.max(3, width / 110));
  pen.strokeStyle = colours.faint;
  pen.lineWidth = 1;
  pen.font = font(11);
  pen.textAlign = 'center';
  for (const u of found) {
    const at = x(u);
    pen.beginPath(); pen.moveTo(at, 18); pen.lineTo(at, y + 6); pen.stroke();
    pen.fillStyle = colours.soft;
    const text = step >= 100 ? `${(u / 1000).toFixed(step >= 1000 ? 0 : 1)} km` : `${u.toFixed(step >= 1 ? 0 : 1)} m`;
    const half = pen.measureText(text).width / 2;
    if (at > 0 && at < width) pen.fillText(text, Math.max(half, Math.min(width - half, at)), y + 20);
  }
  pen.textAlign = 'left';
}

function junction(pen, colours, at, yBar, rowHeight) {
  pen.strokeStyle = colours.soft;
  pen.lineWidth = 1.5;
  pen.setLineDash([4, 3]);
  pen.beginPath(); pen.moveTo(at, yBar - rowHeight + 16); pen.lineTo(at, yBar + 8); pen.stroke();
  pen.setLineDash([]);
}

// Marks stand below the stretches of their row.
const heightOf = (row) => (row.stretches.length ? 22 : 0) + (row.marks.length ? 16 : 0);

// State of each element of a row by its name: [word, active, tone].
function stateOf(frame, row) {
  return new Map(Object.entries((frame.states || {})[row.name] || {}));
}

// The track itself, up to where something is drawn onto it.
function bed(pen, colours, rows, y, { track, u0, x, width }) {
  const starts = rows.flatMap((row) => row.stretches).filter((each) => each.track === track.name).map((each) => each.start_m);
  const left = Math.max(0, x(u0));
  const right = Math.min(width, x(u0 + (starts.length ? Math.min(...starts) : track.length_m)));
  pen.fillStyle = colours.line;
  pen.fillRect(left, y + 6, Math.max(0, right - left), 4);
}

// Stretches drawn onto the track in the colours of their groups.
function coloured(pen, row, groups, y, { track, u0, x, width }) {
  for (const stretch of row.stretches) {
    if (stretch.track !== track.name) continue;
    const [a, b] = [x(u0 + stretch.start_m), x(u0 + stretch.end_m)];
    if (b < 0 || a > width) continue;
    const group = groups.get(stretch.group || 0);
    pen.fillStyle = group.colour;
    pen.fillRect(a + 0.5, y, Math.max(1, b - a - 1), 16);
    const [shownA, shownB] = [Math.max(a, 0), Math.min(b, width)];
    pen.font = font(11, true);
    const text = shownB - shownA > 120 ? `${stretch.name}: ${group.label}` : group.label;
    if (pen.measureText(text).width + 8 < shownB - shownA) {
      pen.fillStyle = group.text;
      pen.textAlign = 'center';
      pen.fillText(text, (shownA + shownB) / 2, y + 12.5);
      pen.textAlign = 'left';
    }
  }
}

// Marks that stand on the track, their names below it where there is room.
function posts(pen, colours, row, states, y, { track, u0, x, width, out }) {
  pen.font = font(11);
  let last = -Infinity;
  for (const mark of row.marks) {
    const at = x(u0 + mark.at_m);
    if (mark.track !== track.name || at < -20 || at > width + 20) continue;
    const { bad, text } = wording(mark, states, out);
    pen.fillStyle = bad ? colours.bad : colours.ink;
    pen.fillRect(at - 1, y + 16, 2, 7);
    if (out.has(mark.node)) cross(pen, at, y + 8, 7, colours.bad);
    const half = pen.measureText(text).width / 2;
    if (at - half > last + 6 || bad) {
      pen.textAlign = 'center';
      pen.fillText(text, Math.max(half + 2, Math.min(width - half - 2, at)), y + 34);
      pen.textAlign = 'left';
      last = at + half;
    }
  }
}

// Name of a mark with the word for its state; one whose node is off or failed is off.
function wording(mark, states, out) {
  const [word, , tone] = out.has(mark.node) ? ['off', true, 'bad'] : states.get(mark.name) || ['', false, ''];
  return { bad: tone === 'bad', text: word ? `${mark.name} ${word}` : mark.name };
}

function cross(pen, x, y, size, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = 3;
  pen.beginPath();
  pen.moveTo(x - size, y - size); pen.lineTo(x + size, y + size);
  pen.moveTo(x - size, y + size); pen.lineTo(x + size, y - size);
  pen.stroke();
}

// A row of stretches below the track: outlines, filled where they are active.
function stretches(pen, colours, row, states, y, { track, u0, x, width }) {
  for (const stretch of row.stretches) {
    if (stretch.track !== track.name) continue;
    const [a, b] = [x(u0 + stretch.start_m), x(u0 + stretch.end_m)];
    if (b < 0 || a > width) continue;
    const [word, active, tone] = states.get(stretch.name) || ['', false, ''];
    const colour = tone === 'bad' ? colours.bad : colours.ink;
    pen.strokeStyle = colours.soft;
    pen.lineWidth = 1;
    pen.strokeRect(a + 1.5, y + 4.5, Math.max(1, b - a - 3), 7);
    if (active) { pen.fillStyle = colour; pen.fillRect(a + 1, y + 4, Math.max(1, b - a - 2), 8); }
    pen.font = font(10);
    const text = word ? `${stretch.name} ${word}` : stretch.name;
    if (pen.measureText(text).width + 10 < b - a) {
      pen.fillStyle = word ? colour : colours.soft;
      pen.textAlign = 'center';
      pen.fillText(text, (a + b) / 2, y + 22);
      pen.textAlign = 'left';
    }
  }
}

const SYMBOLS = {
  tick(pen, at, y) { pen.fillRect(at - 1, y + 1, 2, 10); },
  triangle(pen, at, y) {
    pen.beginPath(); pen.moveTo(at, y + 1); pen.lineTo(at - 5, y + 11); pen.lineTo(at + 5, y + 11); pen.fill();
  },
  diamond(pen, at, y) {
    pen.beginPath(); pen.moveTo(at, y + 1); pen.lineTo(at - 5, y + 6); pen.lineTo(at, y + 11); pen.lineTo(at + 5, y + 6); pen.fill();
  },
  circle(pen, at, y) { pen.beginPath(); pen.arc(at, y + 6, 4.5, 0, 7); pen.fill(); },
  square(pen, at, y) { pen.fillRect(at - 4, y + 2, 8, 8); },
};

// A row of marks below the track, each with its name.
function marks(pen, colours, row, states, y, { track, u0, x, width, out }) {
  const sign = SYMBOLS[row.symbol] || SYMBOLS.tick;
  pen.font = font(10);
  for (const mark of row.marks) {
    const at = x(u0 + mark.at_m);
    if (mark.track !== track.name || at < 0 || at > width) continue;
    const { bad, text } = wording(mark, states, out);
    pen.fillStyle = bad ? colours.bad : colours.soft;
    sign(pen, at, y);
    if (out.has(mark.node)) cross(pen, at, y + 7, 6, colours.bad);
    const room = pen.measureText(text).width + 8;
    pen.fillText(text, at + room > width ? at - room : at + 8, y + 11);
  }
}

function trains(pen, colours, line, frame, track, u0, x, top, scale, options, hits, width) {
  const y = top + 58;
  const described = new Map((line.trains || []).map((t) => [t.name, t]));
  const here = [];
  for (const train of frame.trains || []) {
    const place = placeOf(train);
    if (!place || place.track !== track.name) continue;
    here.push({ train, place, at: x(u0 + place.at) });
  }
  pen.font = font(12, true);
  const labels = here.map(({ train, at }) => ({ x: at, width: pen.measureText(`${train.name} ?`).width, first: train.name === options.train }));
  const placed = levels(labels, 2);
  here.forEach(({ train, place, at }, index) => {
    const picked = train.name === options.train;
    const about = described.get(train.name) || { length_m: 0, direction: 1 };
    if (train.end_m != null) authority(pen, colours, at, x(u0 + train.end_m), y + 9, picked);
    if (place.known && train.sigma_m != null) {
      const half = 2 * train.sigma_m * scale;
      pen.fillStyle = colours.band;
      pen.fillRect(at - half, y - 13, 2 * half, 25);
      if (half > 1) {
        pen.fillStyle = colours.pick;
        pen.fillRect(at - half - 0.5, y - 13, 1.5, 25);
        pen.fillRect(at + half - 0.5, y - 13, 1.5, 25);
      }
    }
    body(pen, colours, at, y, about, train, place, scale, picked, width);
    for (const claim of train.intervals || []) {
      if (claim.track === track.name) interval(pen, colours, x(u0 + claim.low_m), x(u0 + claim.high_m), y - 11);
    }
    if (train.true && train.true[0] === track.name) {
      const truth = x(u0 + train.true[1]);
      pen.fillStyle = colours.truth;
      pen.fillRect(truth - 0.75, y - 15, 1.5, 29);
    }
    if (placed[index] >= 0 || picked) {
      const level = Math.max(0, placed[index]);
      const text = place.known ? train.name : `${train.name} ?`;
      const half = pen.measureText(text).width / 2;
      pen.font = font(12, true);
      pen.fillStyle = picked ? colours.pick : colours.ink;
      pen.textAlign = 'center';
      const inside = Math.max(half + 2, Math.min(width - half - 2, at));
      if (at > -30 && at < width + 30) pen.fillText(text, inside, y - 17 - 13 * level);
      pen.textAlign = 'left';
    }
    hits.push({ name: train.name, x: at, y });
  });
}

function body(pen, colours, at, y, about, train, place, scale, picked, width) {
  const colour = picked ? colours.pick : colours.ink;
  const sense = (train.speed_kmh || about.direction || 1) < 0 ? -1 : 1;
  const length = Math.max(16, about.length_m * scale);
  // The reference point is the front in the first direction of travel.
  const back = at - (about.direction || 1) * length;
  const [a, b] = [Math.max(-20, Math.min(at, back)), Math.min(width + 20, Math.max(at, back))];
  pen.lineWidth = 1.5;
  pen.strokeStyle = pen.fillStyle = colour;
  if (place.known) {
    pen.fillRect(sense > 0 ? a : a + 8, y - 4, Math.max(0, b - a - 8), 8);
  } else {
    pen.setLineDash([3, 2]);
    pen.strokeRect(a, y - 4, b - a, 8);
    pen.setLineDash([]);
  }
  const tip = sense > 0 ? b : a;
  pen.beginPath();
  pen.moveTo(tip, y);
  pen.lineTo(tip - sense * 9, y - 7);
  pen.lineTo(tip - sense * 9, y + 7);
  pen.closePath();
  if (place.known) pen.fill(); else pen.stroke();
}

// An interval that is claimed to hold the train.
function interval(pen, colours, low, high, y) {
  if (high - low < 3) return;
  pen.strokeStyle = colours.claim;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(low, y - 4); pen.lineTo(low, y + 4);
  pen.moveTo(low, y); pen.lineTo(high, y);
  pen.moveTo(high, y - 4); pen.lineTo(high, y + 4);
  pen.stroke();
}

function authority(pen, colours, from, to, y, picked) {
  pen.strokeStyle = colours.grant;
  pen.lineWidth = picked ? 3 : 1.5;
  pen.beginPath();
  pen.moveTo(from, y); pen.lineTo(to, y);
  pen.moveTo(to, y - 6); pen.lineTo(to, y + 4);
  pen.stroke();
}
