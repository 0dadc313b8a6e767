// Error against time; a point tells the command that repeats it. SPDX-License-Identifier: BSD-3-Clause
'use strict';

const data = JSON.parse(document.getElementById('cost-data').textContent);
const plot = document.getElementById('plot');
const shapes = { smooth: 'circle', events: 'circle', steps: 'square', accuracy: 'triangle' };
const colours = { smooth: '#0072b2', events: '#d55e00', steps: '#009e73', accuracy: '#cc79a7' };
const drawn = data.rows.map((row, i) => ({ ...row, i })).filter(row => row.failure === '');
let places = [];  // of `drawn`, in pixels
let chosen = -1;  // row

function element(name, attributes, text) {
  const out = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const [key, value] of Object.entries(attributes)) out.setAttribute(key, value);
  if (text !== undefined) out.textContent = text;
  return out;
}
function short(x) {
  const size = Math.abs(x);
  return size >= 1e-3 && size < 1e5 ? String(Number(x.toPrecision(4))) : String(x.toExponential(3)).replace(/\.?0*e\+?/, 'e');
}
function marker(method, x, y, r) {
  const fill = { fill: colours[method], stroke: '#fff', 'stroke-width': 1 };
  if (shapes[method] === 'square') return element('rect', { x: x - 0.9 * r, y: y - 0.9 * r, width: 1.8 * r, height: 1.8 * r, ...fill });
  if (shapes[method] === 'triangle') return element('path', { d: `M${x} ${y - 1.2 * r}L${x + 1.1 * r} ${y + 0.9 * r}H${x - 1.1 * r}Z`, ...fill });
  return element('circle', { cx: x, cy: y, r, ...fill });
}

// Powers of ten, with 2 and 5 between where there are few of them.
function logTicks(low, high) {
  const out = [], factors = high - low < 2.2 ? [1, 2, 5] : [1];
  for (let power = Math.floor(low); power <= high; ++power)
    for (const factor of factors) {
      const at = power + Math.log10(factor);
      if (at >= low && at <= high) out.push([at, factor * Math.pow(10, power)]);
    }
  return out;
}
function range(values) {
  const logs = values.filter(v => v > 0).map(Math.log10);
  if (logs.length === 0) return [-1, 1];
  const low = Math.min(...logs), high = Math.max(...logs), margin = Math.max(0.15, 0.06 * (high - low));
  return [low - margin, high + margin];
}

// Texts keep clear of each other and of the points: each takes the first of its places that is free.
class Texts {
  constructor(to, font) { Object.assign(this, { to, font, taken: [], curves: [] }); }
  block(x, y, width, height) { this.taken.push([x, y, x + width, y + height]); }
  // A curve is crossed only where no other place is left.
  curve(from, to) {
    const parts = Math.ceil(Math.hypot(to[0] - from[0], to[1] - from[1]) / 4);
    for (let k = 0; k <= parts; ++k) {
      const [x, y] = [0, 1].map(i => from[i] + k / Math.max(parts, 1) * (to[i] - from[i]));
      this.curves.push([x - 1, y - 1, x + 1, y + 1]);
    }
  }
  free([l, t, r, b], of) { return of.every(o => r <= o[0] || l >= o[2] || b <= o[1] || t >= o[3]); }
  // `spots`: [x, y, anchor] of the baseline's begin, middle or end.
  put(text, spots, inside, attributes) {
    const width = 0.6 * this.font * text.length + 2, height = 1.1 * this.font;
    for (const [x, y, anchor, crossing] of [...spots, ...spots.map(spot => [...spot, true])]) {
      const left = anchor === 'end' ? x - width : anchor === 'middle' ? x - width / 2 : x;
      const box = [left, y - 0.85 * this.font, left + width, y - 0.85 * this.font + height];
      if (box[0] < inside[0] || box[1] < inside[1] || box[2] > inside[2] || box[3] > inside[3] || !this.free(box, this.taken)) continue;
      if (!crossing && !this.free(box, this.curves)) continue;
      this.taken.push(box);
      this.to.append(element('text', { x, y, 'text-anchor': anchor, ...attributes }, text));
      return true;
    }
    return false;
  }
}

function draw() {
  const width = Math.max(200, plot.clientWidth), height = Math.max(150, plot.clientHeight);
  const font = 0.85 * parseFloat(getComputedStyle(document.documentElement).fontSize);
  const whole = [0, 0, width, height];
  const left = 4.2 * font, right = width - font, top = 1.9 * font, bottom = height - 3.2 * font;
  plot.setAttribute('viewBox', `0 0 ${width} ${height}`);
  plot.replaceChildren();
  const xs = range(drawn.map(r => r.ms)), ys = range([...drawn.map(r => Math.max(r.error, 1e-17)), data.wanted, data.trust].filter(v => v !== null));
  const x = log => left + (log - xs[0]) / (xs[1] - xs[0]) * (right - left);
  const y = log => top + (ys[1] - log) / (ys[1] - ys[0]) * (bottom - top);
  const texts = new Texts(plot, font);
  const line = (x1, y1, x2, y2, attributes) => plot.append(element('line', { x1, y1, x2, y2, ...attributes }));
  for (const [at, value] of logTicks(...xs))
    if (texts.put(short(value), [[x(at), bottom + 1.3 * font, 'middle']], whole, {})) line(x(at), top, x(at), bottom, { stroke: '#e0e0e0' });
  for (const [at, value] of logTicks(...ys))
    if (texts.put(short(value), [[left - 0.4 * font, y(at) + 0.35 * font, 'end']], whole, {})) line(left, y(at), right, y(at), { stroke: '#e0e0e0' });
  line(left, bottom, right, bottom, { stroke: '#888' });
  line(left, top, left, bottom, { stroke: '#888' });
  texts.put('processor time / ms', [[(left + right) / 2, bottom + 2.6 * font, 'middle']], whole, {});
  texts.put('largest error / m, rad', [[0.4 * font, 1.1 * font, 'start']], whole, {});

  places = drawn.map(row => [x(Math.log10(row.ms)), y(Math.log10(Math.max(row.error, 1e-17)))]);
  const r = 0.4 * font;
  for (const [px, py] of places) texts.block(px - r, py - r, 2 * r, 2 * r);
  const inside = [left, top, right, bottom];
  const pathOf = method => places.filter((_, i) => drawn[i].method === method);
  for (const path of data.methods.map(pathOf))
    for (let k = 1; k < path.length; ++k) texts.curve(path[k - 1], path[k]);
  const level = (value, name, colour) => {
    if (!(value > 0)) return;
    const at = y(Math.log10(value));
    line(left, at, right, at, { stroke: colour, 'stroke-dasharray': '6 4', 'stroke-width': 1.5 });
    const spots = [];
    for (const dy of [-0.4, 1.1]) spots.push([right - 4, at + dy * font, 'end'], [left + 4, at + dy * font, 'start'], [(left + right) / 2, at + dy * font, 'middle']);
    texts.put(name, spots, inside, { style: `fill: ${colour}` });
    texts.block(left, at - 1, right - left, 2);
  };
  level(data.wanted, `wanted ${short(data.wanted || 0)}`, '#b00020');
  level(data.trust, 'trust in the reference', '#777');

  for (const method of data.methods) {
    const path = pathOf(method);
    if (path.length > 1) plot.append(element('path', { d: 'M' + path.map(p => p.join(' ')).join('L'), fill: 'none', stroke: colours[method], 'stroke-width': 2 }));
  }
  drawn.forEach((row, i) => {
    const [px, py] = places[i];
    if (row.i === chosen) plot.append(element('circle', { cx: px, cy: py, r: 1.9 * r, fill: 'none', stroke: '#222', 'stroke-width': 2 }));
    const mark = marker(row.method, px, py, r);
    mark.append(element('title', {}, row.command));
    plot.append(mark);
  });
  drawn.forEach((row, i) => {
    const [px, py] = places[i], d = 1.6 * r;
    texts.put(short(row.setting), [[px + d, py - d, 'start'], [px + d, py + d + 0.8 * font, 'start'], [px - d, py - d, 'end'],
      [px - d, py + d + 0.8 * font, 'end'], [px, py - 2 * d, 'middle'], [px, py + 2 * d + 0.8 * font, 'middle']], inside, { style: `fill: ${colours[row.method]}` });
  });
  document.documentElement.dataset.tether = 'drawn';
}

function choose(i) {
  chosen = i;
  document.querySelectorAll('tbody tr').forEach((tr, k) => tr.classList.toggle('chosen', k === i));
  const row = data.rows[i];
  document.getElementById('what').textContent = row.failure !== '' ? `${row.method}, ${row.setting_name} ${short(row.setting)}: fails: ${row.failure}` :
    `${row.method}, ${row.setting_name} ${short(row.setting)}: error ${row.error.toExponential(1)}, ${short(row.ms)} ms, ${row.steps} steps`;
  const command = document.getElementById('command');
  command.textContent = row.command;
  command.hidden = false;
  draw();
}

function nearest(event) {
  const box = plot.getBoundingClientRect(), font = parseFloat(getComputedStyle(document.documentElement).fontSize);
  let best = -1, least = (event.pointerType === 'touch' ? 3 : 1.5) * font;
  places.forEach(([px, py], i) => {
    const away = Math.hypot(event.clientX - box.left - px, event.clientY - box.top - py);
    if (away < least) [best, least] = [i, away];
  });
  return best;
}
const look = event => {
  const i = nearest(event);
  if (i >= 0 && drawn[i].i !== chosen) choose(drawn[i].i);
};
plot.addEventListener('pointermove', event => { if (event.pointerType !== 'touch') look(event); });
plot.addEventListener('pointerdown', look);
plot.addEventListener('keydown', event => {
  const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
  if (!by || drawn.length === 0) return;
  event.preventDefault();
  const now = drawn.findIndex(row => row.i === chosen);
  choose(drawn[(now < 0 ? 0 : now + by + drawn.length) % drawn.length].i);
});
document.querySelectorAll('tbody tr').forEach((tr, i) => tr.addEventListener('click', () => choose(i)));

for (const method of data.methods) {
  const item = document.createElement('span'), sign = element('svg', { viewBox: '0 0 28 20' });
  sign.append(element('line', { x1: 0, y1: 10, x2: 28, y2: 10, stroke: colours[method], 'stroke-width': 3 }), marker(method, 14, 10, 7));
  item.append(sign, ` ${method}: ${data.rows.find(row => row.method === method).setting_name}`);
  document.getElementById('legend').append(item);
}
window.addEventListener('resize', draw);
const first = /^#point=(\d+)$/.exec(location.hash);
if (first && Number(first[1]) < data.rows.length) choose(Number(first[1])); else draw();
