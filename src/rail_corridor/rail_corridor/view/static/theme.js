// Colours and the small things that every drawing needs.

// Okabe and Ito's palette: told apart by colour-blind people as well.
const OKABE_ITO = {
  blue: '#0072B2', orange: '#E69F00', green: '#009E73', purple: '#CC79A7',
  sky: '#56B4E9', vermillion: '#D55E00', yellow: '#F0E442',
};
const GROUPS = ['blue', 'orange', 'green', 'purple', 'sky', 'vermillion', 'yellow'];
const DARK_TEXT_ON = new Set(['orange', 'sky', 'yellow', 'purple']);

export function theme(dark) {
  return dark
    ? { ink: '#e8eaed', soft: '#a6adb8', faint: '#3a414c', paper: '#171a1f', truth: '#ffffff',
      pick: '#ff8c42', band: 'rgba(255,140,66,0.30)', grant: '#2fc59a', line: '#c3cad4',
      i: '#56B4E9', q: '#E69F00', bad: '#ff7a5c', claim: '#56B4E9', shade: 'rgba(86,180,233,0.28)', dark: true }
    : { ink: '#1d2229', soft: '#5b6470', faint: '#dfe3e8', paper: '#ffffff', truth: '#000000',
      pick: '#D55E00', band: 'rgba(213,94,0,0.22)', grant: '#00795a', line: '#414a57',
      i: '#0072B2', q: '#B87400', bad: '#b93a12', claim: '#0072B2', shade: 'rgba(0,114,178,0.20)', dark: false };
}

// Colour of each group of the stretches that are drawn onto the tracks, in rising order.
export function groupColours(line) {
  const groups = new Map();
  const all = (line.rows || []).filter((row) => row.on_track).flatMap((row) => row.stretches.map((stretch) => ({ ...stretch, legend: row.legend })));
  for (const { group = 0, group_label: label = '', legend } of all.sort((a, b) => (a.group || 0) - (b.group || 0))) {
    if (!groups.has(group)) {
      const name = GROUPS[groups.size % GROUPS.length];
      groups.set(group, { colour: OKABE_ITO[name], text: DARK_TEXT_ON.has(name) ? '#101317' : '#ffffff', label, legend });
    }
  }
  return groups;
}

// A canvas at the resolution of the screen; returns its context and its size in CSS pixels.
export function prepare(canvas, height) {
  const width = canvas.clientWidth;
  const ratio = window.devicePixelRatio || 1;
  if (height) canvas.style.height = `${height}px`;
  height = height || canvas.clientHeight;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const pen = canvas.getContext('2d');
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.lineJoin = 'round';
  return { pen, width, height };
}

export const font = (size, bold) => `${bold ? '600 ' : ''}${size}px system-ui, "DejaVu Sans", sans-serif`;

// Round steps (1, 2, 5 times a power of ten) that divide a span into at most `most` parts.
export function ticks(low, high, most) {
  const span = Math.max(high - low, 1e-12);
  let step = 10 ** Math.floor(Math.log10(span / most));
  for (const factor of [1, 2, 5, 10]) {
    if (span / (step * factor) <= most) { step *= factor; break; }
  }
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * span; k += 1) found.push(k * step);
  return { step, found };
}

// Steps of a clock: seconds, then minutes, then hours.
export function timeTicks(low, high, most) {
  const steps = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 43200];
  const step = steps.find((s) => (high - low) / s <= most) || 86400;
  const found = [];
  for (let t = Math.ceil(low / step - 1e-9) * step; t <= high + 1e-9; t += step) found.push(t);
  return found;
}

export function clock(time_s, tenths) {
  const sign = time_s < 0 ? '−' : '';
  const all = Math.abs(time_s);
  const hours = Math.floor(all / 3600);
  const minutes = String(Math.floor(all / 60) % 60).padStart(2, '0');
  const seconds = tenths
    ? (Math.floor(all * 10) / 10 % 60).toFixed(1).padStart(4, '0')
    : String(Math.floor(all) % 60).padStart(2, '0');
  return `${sign}${hours ? `${hours}:` : ''}${minutes}:${seconds}`;
}

// A number with a fitting prefix: 2.4 GHz, 960 kHz, 1.2 ms.
export function engineering(value, unit, digits = 3) {
  if (!Number.isFinite(value)) return 'none';
  if (value === 0) return `0 ${unit}`;
  const prefixes = { '-4': 'p', '-3': 'n', '-2': 'µ', '-1': 'm', 0: '', 1: 'k', 2: 'M', 3: 'G' };
  const power = Math.max(-4, Math.min(3, Math.floor(Math.log10(Math.abs(value)) / 3 + 1e-9)));
  return `${Number((value / 1000 ** power).toPrecision(digits))} ${prefixes[power]}${unit}`;
}

// Where labels of a row of things go: the lowest level at which they touch no other; -1 if there
// is none. `items` are {x, width, first}, drawn around x; those that are first choose first.
export function levels(items, count) {
  const taken = Array.from({ length: count }, () => []);
  const placed = new Array(items.length).fill(-1);
  const order = items.map((_, index) => index)
    .sort((a, b) => Boolean(items[b].first) - Boolean(items[a].first) || items[a].x - items[b].x);
  for (const index of order) {
    const { x, width } = items[index];
    const apart = (other) => Math.abs(x - other.x) > (width + other.width) / 2 + 6;
    const level = taken.findIndex((others) => others.every(apart));
    if (level >= 0) { taken[level].push(items[index]); placed[index] = level; }
  }
  return placed;
}
