// The scope: one block of a waveform over time, as a spectrum, and in the I/Q plane.

import { font, prepare, theme, ticks } from '/assets/theme.js';
import { frameOf, rule, text, upright } from '/assets/chart.js';

const MARGIN = { left: 62, right: 14, top: 10, bottom: 36 };

function plot(canvas, colours, height, [x0, x1], [y0, y1], labels) {
  const { pen, width } = prepare(canvas, height);
  const { left, right, top, bottom } = MARGIN;
  const [plotW, plotH] = [width - left - right, height - top - bottom];
  const x = (v) => left + ((v - x0) / (x1 - x0 || 1)) * plotW;
  const y = (v) => top + plotH - ((v - y0) / (y1 - y0 || 1)) * plotH;
  frameOf(pen, colours, { left, top, plotW, plotH });
  pen.font = font(11);
  const across = ticks(x0 * labels.xFactor, x1 * labels.xFactor, Math.max(4, plotW / 56));
  for (const v of across.found) {
    rule(pen, colours, x(v / labels.xFactor), top, x(v / labels.xFactor), top + plotH);
    text(pen, colours.soft, `${Number(v.toPrecision(6))}`, x(v / labels.xFactor), top + plotH + 14, 'center');
  }
  for (const v of ticks(y0, y1, Math.max(3, plotH / 28)).found) {
    rule(pen, colours, left, y(v), left + plotW, y(v));
    text(pen, colours.soft, labels.yText ? labels.yText(v) : `${Number(v.toPrecision(6))}`, left - 4, y(v) + 4, 'right');
  }
  text(pen, colours.soft, labels.x, left + plotW / 2, height - 4, 'center');
  upright(pen, colours.soft, labels.y, 11, top + plotH / 2);
  pen.save();
  pen.beginPath(); pen.rect(left, top, plotW, plotH); pen.clip();
  return { pen, x, y };
}

function unitOf(span, unit) {
  const power = Math.max(-4, Math.min(3, Math.floor(Math.log10(Math.max(span, 1e-12)) / 3 + 1e-9)));
  const prefix = { '-4': 'p', '-3': 'n', '-2': 'µ', '-1': 'm', 0: '', 1: 'k', 2: 'M', 3: 'G' }[power];
  return { factor: 1000 ** -power, unit: `${prefix}${unit}` };
}

export function drawTime(canvas, shown, dark) {
  const colours = theme(dark);
  const time = shown.time;
  const parts = ['i', 'q'].filter((name) => time[name] || time[`${name}_low`]);
  const all = parts.flatMap((name) => time[name] || [...time[`${name}_low`], ...time[`${name}_high`]]);
  const most = Math.max(1e-30, ...all.map(Math.abs));
  const count = (time.i || time.i_low).length;
  const end = time.from_s + time.step_s * Math.max(1, count - 1);
  const across = unitOf(end - time.from_s, 's');
  const { pen, x, y } = plot(canvas, colours, 210, [time.from_s, end], [-1.1 * most, 1.1 * most], {
    x: `time in the block [${across.unit}]`, xFactor: across.factor,
    y: shown.radio ? 'amplitude [√mW]' : 'amplitude [V]', yText: plain,
  });
  for (const name of parts) {
    pen.strokeStyle = pen.fillStyle = colours[name];
    pen.lineWidth = 1.4;
    pen.beginPath();
    if (time[name]) {
      time[name].forEach((v, k) => (k ? pen.lineTo(x(time.from_s + k * time.step_s), y(v)) : pen.moveTo(x(time.from_s), y(v))));
      pen.stroke();
    } else {
      pen.globalAlpha = 0.75;
      time[`${name}_low`].forEach((low, k) => {
        const at = x(time.from_s + k * time.step_s);
        const high = time[`${name}_high`][k];
        pen.moveTo(at, y(low) + 0.5); pen.lineTo(at, y(high) - 0.5);
      });
      pen.stroke();
      pen.globalAlpha = 1;
    }
  }
  pen.restore();
}

const plain = (v) => (v === 0 ? '0' : Math.abs(v) >= 1e-3 && Math.abs(v) < 1e4 ? `${Number(v.toPrecision(2))}` : v.toExponential(0));

export function drawSpectrum(canvas, shown, dark) {
  const colours = theme(dark);
  const { from_hz: from, step_hz: step, db } = shown.spectrum;
  const highest = Math.max(...db);
  const top = Math.ceil((highest + 3) / 10) * 10;
  const end = from + step * (db.length - 1);
  const across = unitOf(Math.max(Math.abs(from), Math.abs(end)), 'Hz');
  const { pen, x, y } = plot(canvas, colours, 210, [from, end], [Math.max(top - 100, Math.min(...db) - 3), top], {
    x: shown.radio ? `frequency off the carrier [${across.unit}]` : `frequency [${across.unit}]`, xFactor: across.factor,
    y: shown.radio ? 'power of a line [dBm]' : 'power of a line [dBV]',
  });
  pen.strokeStyle = colours.i;
  pen.lineWidth = 1.4;
  pen.beginPath();
  db.forEach((v, k) => (k ? pen.lineTo(x(from + k * step), y(v)) : pen.moveTo(x(from), y(v))));
  pen.stroke();
  pen.restore();
}

export function drawPlane(canvas, shown, dark) {
  const colours = theme(dark);
  const plane = shown.plane;
  const most = Math.max(1.05, ...plane.i.map(Math.abs), ...plane.q.map(Math.abs)) * 1.1;
  const limit = plane.kind === 'samples' ? most : Math.min(most, 3);
  const { pen, width } = prepare(canvas, 210);
  const [left, top, size] = [Math.max(40, (width - 168) / 2), 8, 168];
  const x = (v) => left + size / 2 + (v / limit) * (size / 2);
  const y = (v) => top + size / 2 - (v / limit) * (size / 2);
  frameOf(pen, colours, { left, top, plotW: size, plotH: size });
  rule(pen, colours, left, y(0), left + size, y(0));
  rule(pen, colours, x(0), top, x(0), top + size);
  pen.font = font(11);
  const words = plane.kind === 'samples'
    ? `in phase, 1 = ${plain(plane.scale)} ${shown.radio ? '√mW' : 'V'}` : 'in phase';
  text(pen, colours.soft, words, left + size / 2, top + size + 16, 'center');
  upright(pen, colours.soft, 'quadrature', left - 10, top + size / 2);
  pen.save();
  pen.beginPath(); pen.rect(left, top, size, size); pen.clip();
  pen.fillStyle = colours.i;
  pen.globalAlpha = 0.7;
  plane.i.forEach((v, k) => {
    pen.beginPath(); pen.arc(x(v), y(plane.q[k]), 2, 0, 7); pen.fill();
  });
  pen.globalAlpha = 1;
  pen.strokeStyle = colours.pick;
  pen.lineWidth = 1.5;
  for (const [px, py] of plane.points || []) {
    pen.beginPath(); pen.arc(x(px), y(py), 6, 0, 7); pen.stroke();
  }
  pen.restore();
}
