// Curves over time with a cursor. SPDX-License-Identifier: BSD-3-Clause

function shortNumber(x) {
  if (x === null || !isFinite(x)) return '-';
  if (x === 0) return '0';
  const size = Math.abs(x);
  return size >= 1e-3 && size < 1e5 ? String(Number(x.toPrecision(4))) : x.toExponential(1).replace('e+', 'e');
}

// Ends of some five steps of 1, 2 or 5 times a power of ten.
function ticks(low, high, most) {
  const raw = (high - low) / most, power = Math.pow(10, Math.floor(Math.log10(raw)));
  const step = [1, 2, 5, 10].map(k => k * power).find(s => s >= raw) || raw;
  const out = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) out.push(k * step);
  return out;
}

// Curves of a run: those that are zero throughout are left out.
function plotsOf(data) {
  const sum = data.kinetic.map((k, i) => k === null || data.potential[i] === null ? null : k + data.potential[i]);
  const change = sum.map(e => e === null ? null : Math.abs(e - data.start_energy));
  const some = curves => curves.filter(c => c.values.some(v => v !== null && v !== 0));
  const all = [
    { title: 'energy / J', logarithmic: false, curves: some([
      { name: 'kinetic', colour: '#0072b2', values: data.kinetic },
      { name: 'potential', colour: '#e69f00', values: data.potential },
      { name: 'sum', colour: '#202020', values: sum }]) },
    { title: 'errors', logarithmic: true, curves: some([
      { name: '|energy change| / J', colour: '#202020', values: change },
      { name: 'drift', colour: '#d55e00', values: data.drift }]) },
    { title: 'contact', logarithmic: true, curves: some([
      { name: 'residual', colour: '#cc79a7', values: data.residual },
      { name: 'penetration / m', colour: '#009e73', values: data.penetration }]) },
  ];
  return all.filter(plot => plot.curves.length > 0);
}

class Plot {
  constructor(plot, data, place, seek) {
    this.plot = plot;
    this.data = data;
    this.seek = seek;
    this.box = document.createElement('figure');
    this.legend = document.createElement('figcaption');
    this.canvas = document.createElement('canvas');
    this.cursor = document.createElement('i');  // moves without a new painting of the curves
    const panel = document.createElement('div');
    panel.append(this.canvas, this.cursor);
    this.box.append(this.legend, panel);
    place.append(this.box);
    this.legend.append(plot.title);
    this.values = plot.curves.map(curve => {
      const item = document.createElement('span'), value = document.createElement('b');
      item.style.color = curve.colour;
      item.append(curve.name + ' ', value);
      this.legend.append(item);
      return value;
    });
    const drag = event => {
      if (event.type === 'pointerdown') this.canvas.setPointerCapture(event.pointerId);
      if (event.type === 'pointermove' && event.buttons === 0) return;
      const x = event.clientX - this.canvas.getBoundingClientRect().left;
      this.seek(this.timeAt(x));
    };
    this.canvas.addEventListener('pointerdown', drag);
    this.canvas.addEventListener('pointermove', drag);
    this.find();
  }
  // The range of values. Logarithms of zeros lie on the lower edge.
  find() {
    let low = Infinity, high = -Infinity;
    this.floor = 1;
    for (const { values } of this.plot.curves) for (const v of values) if (v > 0) this.floor = Math.min(this.floor, v / 3);
    for (const { values } of this.plot.curves)
      for (const v of values) {
        if (v === null) continue;
        const shown = this.shown(v);
        low = Math.min(low, shown);
        high = Math.max(high, shown);
      }
    if (!(low <= high)) [low, high] = [0, 1];
    const margin = this.plot.logarithmic ? 0.2 : 0.06 * (high - low) || Math.abs(high) || 1;
    this.low = low - margin;
    this.high = high + margin;
  }
  shown(v) { return this.plot.logarithmic ? Math.log10(Math.max(v, this.floor)) : v; }
  x(time) { return this.left + (time - this.data.start) / (this.data.end - this.data.start || 1) * this.width; }
  y(v) { return this.top + (this.high - this.shown(v)) / (this.high - this.low) * this.height; }
  timeAt(x) { return this.data.start + (x - this.left) / this.width * (this.data.end - this.data.start); }

  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), font = parseFloat(getComputedStyle(this.box).fontSize);
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    this.canvas.width = Math.max(1, Math.round(ratio * width));
    this.canvas.height = Math.max(1, Math.round(ratio * height));
    Object.assign(this, { ratio, font, left: 4.2 * font, top: 0.5 * font });
    this.width = Math.max(1, width - this.left - font);
    this.height = Math.max(1, height - this.top - 2.6 * font);
    this.paint();
  }
  paint() {
    const to = this.canvas.getContext('2d');
    to.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    to.fillStyle = '#fff';
    to.fillRect(0, 0, this.canvas.width, this.canvas.height);
    this.cursor.style.height = `${this.height}px`;
    to.font = `${0.85 * this.font}px sans-serif`;
    this.paintAxes(to);
    to.lineWidth = 1.5;
    to.lineJoin = 'round';
    for (const curve of this.plot.curves) this.paintCurve(to, curve);
  }
  paintAxes(to) {
    const bottom = this.top + this.height;
    to.strokeStyle = '#ddd';
    to.fillStyle = '#444';
    to.lineWidth = 1;
    to.textAlign = 'right';
    to.textBaseline = 'middle';
    const rows = Math.max(2, Math.min(6, this.height / (2.2 * this.font)));
    let values = ticks(this.low, this.high, rows);
    if (this.plot.logarithmic) values = [...new Set(values.map(v => Math.round(v)))];
    for (const v of values) {
      const y = this.top + (this.high - v) / (this.high - this.low) * this.height;
      if (y < this.top - 1 || y > bottom + 1) continue;
      this.line(to, this.left, y, this.left + this.width, y);
      to.fillText(this.plot.logarithmic ? `1e${v}` : shortNumber(Math.abs(v) < 1e-9 * this.high ? 0 : v), this.left - 4, y);
    }
    to.textAlign = 'center';
    to.textBaseline = 'top';
    for (const t of ticks(this.data.start, this.data.end, Math.max(2, this.width / (5 * this.font)))) {
      this.line(to, this.x(t), this.top, this.x(t), bottom);
      to.fillText(shortNumber(t), this.x(t), bottom + 3);
    }
    to.fillText('t / s', this.left + this.width / 2, bottom + 3 + 1.1 * this.font);
    to.strokeStyle = '#888';
    this.line(to, this.left, bottom, this.left + this.width, bottom);
    this.line(to, this.left, this.top, this.left, bottom);
  }
  line(to, x1, y1, x2, y2) {
    to.beginPath();
    to.moveTo(x1, y1);
    to.lineTo(x2, y2);
    to.stroke();
  }
  paintCurve(to, curve) {
    to.strokeStyle = curve.colour;
    to.beginPath();
    let open = false;
    curve.values.forEach((v, i) => {
      if (v === null) { open = false; return; }
      const x = this.x(this.data.times[i]), y = this.y(v);
      if (open) to.lineTo(x, y); else to.moveTo(x, y);
      open = true;
    });
    to.stroke();
  }
  move(time) { this.cursor.style.transform = `translate(${this.x(time)}px, ${this.top}px)`; }
  show(frame) {
    this.plot.curves.forEach((curve, i) => { this.values[i].textContent = shortNumber(curve.values[frame]); });
  }
}
