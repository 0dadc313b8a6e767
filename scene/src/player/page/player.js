// The page: time, camera, controls. SPDX-License-Identifier: BSD-3-Clause
//
// After #: t=SECONDS stops there, fps shows frames a second, view=front|side|top.

const kSlow = 0.040;  // s a frame: above it, the drawing gives up shadows and then pixels
const kMostNames = 60;

class Player {
  constructor(data) {
    this.data = data;
    this.time = data.start;
    this.playing = false;
    this.poses = new Float32Array(7 * data.bodies.length);
    this.show = { joints: true, contacts: true, names: data.moving <= 8, through: false, selected: -1 };
    this.quality = { pixels: 1, shadows: true, slow: 0 };
    this.findSize();
    this.camera = new Camera(data.up);
    this.shapes = new Shapes(data, this.size, this.reach);
    this.planes = this.findPlanes();
    this.element = id => document.getElementById(id);
    this.element('name').textContent = data.name || 'Tether';
    this.plots = plotsOf(data).map(plot => new Plot(plot, data, this.element('plots'), t => this.seek(t)));
    this.canvas = this.element('scene');
    try {
      this.renderer = new Renderer(this.canvas, this.shapes);
    } catch (problem) {
      this.say(problem.message);
    }
    this.addControls();
    this.home('start');
    this.addCamera();
    new ResizeObserver(() => this.resize()).observe(this.element('stage'));
    new ResizeObserver(() => this.resize()).observe(this.element('plots'));
    this.resize();
    this.readHash();
    this.drawNow();
    requestAnimationFrame(now => this.frame(now));
  }
  say(text) {
    const place = this.element('message');
    place.textContent = text;
    place.hidden = false;
  }

  // A box around all that moves and what stands there, planes apart, over the run; of runs that
  // leave their start far behind, around the start.
  findSize() {
    const { data } = this, box = () => ({ low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity] });
    const take = (b, p, r) => {
      for (let k = 0; k < 3; ++k) {
        b.low[k] = Math.min(b.low[k], p[k] - r);
        b.high[k] = Math.max(b.high[k], p[k] + r);
      }
    };
    const reaches = data.bodies.map(body => Math.max(0, ...body.parts.filter(p => p.scale).map(part =>
      lengthOf(part.position) + Math.max(...data.forms[part.form].points.map((p) =>
        Math.hypot(p[0] * part.scale[0], p[1] * part.scale[1], p[2] * part.scale[2]))))));
    const sizes = reaches.filter((r, b) => r > 0 && data.bodies[b].film !== null).sort((a, b) => a - b);
    this.reach = sizes.length > 0 ? sizes[sizes.length >> 1] : 0;
    const start = box(), whole = box();
    const step = Math.max(1, Math.floor(data.times.length / 100));
    for (let f = 0; f < data.times.length; f += step) {
      posesAt(data, data.times[f], this.poses);
      data.bodies.forEach((body, b) => {
        if (body.parts.some(part => part.normal)) return;
        const p = this.poses.subarray(7 * b, 7 * b + 3);
        if (f === 0) take(start, p, reaches[b]);
        take(whole, p, reaches[b]);
      });
    }
    for (const joint of data.joints)
      for (const end of [joint.first, joint.second]) if (end.body < 0 && joint.kind !== 'slider') take(start, end.at, 0), take(whole, end.at, 0);
    const measure = b => b.low[0] <= b.high[0] ? lengthOf(subtract(b.high, b.low)) : 0;
    const chosen = measure(whole) > 12 * measure(start) && measure(start) > 0 ? start : whole;
    this.box = measure(chosen) ? chosen : { low: [-1, -1, -1], high: [1, 1, 1] };
    this.size = measure(chosen) || 2;
    this.middle = measure(chosen) ? scaled(add(chosen.low, chosen.high), 0.5) : [0, 0, 0];
  }
  findPlanes() {
    const planes = [], { data } = this;
    posesAt(data, data.start, this.poses);
    data.bodies.forEach((body, b) => {
      for (const part of body.parts) {
        if (!part.normal) continue;
        const q = this.poses.subarray(7 * b + 3, 7 * b + 7), at = add(this.poses.subarray(7 * b, 7 * b + 3), rotated(q, part.position));
        const normal = unit(rotated(q, rotated(part.orientation, part.normal)));
        const middle = subtract(this.middle, scaled(normal, dotted(subtract(this.middle, at), normal)));
        const first = unit(crossed(normal, Math.abs(normal[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0])), second = crossed(normal, first);
        // Lines a round number of metres apart, some eight over the scene.
        const metres = this.size * data.length / 6, power = Math.pow(10, Math.floor(Math.log10(metres)));
        const cell = [1, 2, 5, 10].map(k => k * power).find(c => c >= metres) / data.length;
        const offset = add(middle, scaled(data.centre, 1 / data.length));
        const modulo = x => x - cell * Math.floor(x / cell);
        planes.push({ middle, first, second, normal, cell, edge: 3 * this.size,
          origin: [modulo(dotted(offset, first)), modulo(dotted(offset, second))], shaded: dotted(normal, this.camera ? this.camera.up : unit(data.up)) > 0.3 });
      }
    });
    return planes;
  }

  // The camera as in a view by name; `start` sees motions in a plane y = const from the front.
  home(view) {
    const { camera, data } = this;
    let flat = view === 'start';
    const p = data.positions;
    for (let i = data.moving * 3; flat && i < p.length; i += 3) flat = Math.abs(p[i + 1] - p[i % (data.moving * 3) + 1]) < 1e-5;
    const q = data.orientations;
    for (let i = 0; flat && i < q.length; i += 4) flat = Math.abs(q[i + 1]) < 40 && Math.abs(q[i + 3]) < 40;
    flat = flat && Math.abs(data.up[2]) > 0.9;
    const angles = { start: flat ? [0.18, 0.12] : [0.45, 0.3], front: [0, 0], side: [Math.PI / 2, 0], top: [0, 1.55] };
    [camera.azimuth, camera.elevation] = angles[view] || angles.start;
    camera.target = this.middle;
    camera.distance = this.fittingDistance();
    this.element('follow').value = '-1';
    this.follow(-1);
    this.dirty = true;
  }
  // From where the box fills the picture, with a margin.
  fittingDistance() {
    const { right, towards, above } = this.camera.axes(), { canvas, box } = this;
    const aspect = (canvas.clientWidth || 1) / (canvas.clientHeight || 1), half = Math.tan(kFieldOfView / 2);
    const [wide, high] = aspect > 1 ? [half * aspect, half] : [half, half / aspect];
    let distance = 0;
    for (let corner = 0; corner < 8; ++corner) {
      const p = subtract([0, 1, 2].map(k => (corner >> k & 1 ? box.high : box.low)[k]), this.middle);
      const needed = Math.max(Math.abs(dotted(p, right)) / wide, Math.abs(dotted(p, above)) / high);
      distance = Math.max(distance, dotted(p, towards) + 1.15 * needed);
    }
    return distance || 4;
  }
  follow(body) {
    this.show.selected = body;
    this.before = null;
    this.dirty = true;
  }

  addControls() {
    const { data, element } = this;
    const on = (id, event, action) => element(id).addEventListener(event, action);
    on('play', 'click', () => this.play(!this.playing));
    element('scrub').max = '1000';
    on('scrub', 'input', () => this.seek(data.start + (data.end - data.start) * element('scrub').value / 1000));
    const duration = data.end - data.start;
    const natural = duration >= 2 && duration <= 60 ? 1 : Math.pow(10, Math.round(Math.log10(duration / 10)));
    this.speed = natural;
    for (const factor of [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100]) {
      const speed = Number((factor * natural).toPrecision(3));
      element('speed').append(new Option(`${speed >= 1e-4 && speed < 1e5 ? speed : speed.toExponential(0)} x`, String(speed), factor === 1, factor === 1));
    }
    on('speed', 'change', () => { this.speed = Number(element('speed').value); });
    element('follow').append(new Option('all', '-1', true, true));
    data.bodies.forEach((body, b) => {
      if (body.film !== null) element('follow').append(new Option(body.name, String(b)));
    });
    on('follow', 'change', () => this.follow(Number(element('follow').value)));
    on('view', 'change', () => { if (element('view').value) this.home(element('view').value); element('view').value = ''; });
    const has = { joints: data.joints.length > 0, contacts: data.contactNumbers.length > 0, names: true,
      through: data.bodies.some(body => body.film === null && body.parts.some(part => !part.normal)) };
    for (const what of Object.keys(has)) {
      element(what).checked = this.show[what];
      element(what).parentElement.hidden = !has[what];
      on(what, 'change', () => { this.show[what] = element(what).checked; this.dirty = true; });
    }
    document.addEventListener('keydown', event => this.key(event));
  }
  key(event) {
    if (/^(SELECT|BUTTON)$/.test(event.target.tagName) || event.ctrlKey || event.altKey || event.metaKey) return;
    const frames = { ArrowRight: 1, ArrowLeft: -1 };
    if (event.key === ' ') this.play(!this.playing);
    else if (event.key in frames) {
      const frame = frameAt(this.data, this.time) + frames[event.key];
      this.seek(this.data.times[Math.max(0, Math.min(this.data.times.length - 1, frame))]);
    } else if (event.key === 'Home') this.seek(this.data.start);
    else if (event.key === 'End') this.seek(this.data.end);
    else return;
    event.preventDefault();
  }
  play(playing) {
    if (playing && this.time >= this.data.end) this.time = this.data.start;
    this.playing = playing;
    this.last = null;
    this.element('play').textContent = playing ? 'Pause' : 'Play';
  }
  seek(time) {
    this.play(false);
    this.time = Math.max(this.data.start, Math.min(this.data.end, time));
    this.dirty = true;
  }

  // One pointer turns (with shift or another button: shifts), two shift and zoom.
  addCamera() {
    const { canvas, camera } = this, pointers = new Map();
    let moved = 0;
    const smaller = () => Math.min(canvas.clientWidth, canvas.clientHeight);
    const middle = () => {
      const all = [...pointers.values()], n = all.length;
      const c = [0, 1].map(k => all.reduce((sum, p) => sum + p[k], 0) / n);
      return { c, spread: n > 1 ? Math.hypot(all[0][0] - all[1][0], all[0][1] - all[1][1]) : 0 };
    };
    canvas.addEventListener('pointerdown', event => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      moved = 0;
    });
    canvas.addEventListener('pointermove', event => {
      if (!pointers.has(event.pointerId)) return;
      const before = middle();
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      const after = middle(), dx = after.c[0] - before.c[0], dy = after.c[1] - before.c[1];
      moved += Math.abs(dx) + Math.abs(dy);
      if (pointers.size > 1 || event.shiftKey || event.buttons > 1) camera.shift(dx / smaller(), dy / smaller());
      else camera.turn(4 * dx / smaller(), 4 * dy / smaller());
      if (before.spread > 0 && after.spread > 0) camera.zoom(before.spread / after.spread);
      this.dirty = true;
    });
    const up = event => {
      if (pointers.delete(event.pointerId) && event.type === 'pointerup' && moved < 4 && this.renderer) this.pick(event);
    };
    canvas.addEventListener('pointerup', up);
    canvas.addEventListener('pointercancel', up);
    canvas.addEventListener('contextmenu', event => event.preventDefault());
    canvas.addEventListener('wheel', event => {
      camera.zoom(Math.exp(0.001 * event.deltaY));
      this.dirty = true;
      event.preventDefault();
    }, { passive: false });
  }
  pick(event) {
    const { canvas } = this, box = canvas.getBoundingClientRect();
    const body = this.renderer.bodyAt(this.shapes, this.camera, Math.round((event.clientX - box.left) / box.width * canvas.width),
      Math.round((event.clientY - box.top) / box.height * canvas.height));
    const chosen = body >= 0 && this.data.bodies[body].film !== null ? body : -1;
    this.element('follow').value = String(chosen);
    this.follow(chosen);
  }

  resize() {
    const { canvas } = this, most = this.renderer && this.renderer.software ? 1 : 2,
      ratio = Math.min(window.devicePixelRatio || 1, most) * this.quality.pixels;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    for (const plot of this.plots) plot.resize();
    this.dirty = true;
  }
  readHash() {
    const hash = new URLSearchParams(window.location.hash.slice(1));
    for (const what of ['joints', 'contacts', 'names', 'through'])
      if (hash.has(what)) this.element(what).checked = this.show[what] = hash.get(what) !== '0';
    if (hash.has('view')) this.home(hash.get('view'));
    this.element('fps').hidden = !hash.has('fps');
    this.play(!window.matchMedia('(prefers-reduced-motion: reduce)').matches);
    if (hash.has('t') && isFinite(Number(hash.get('t')))) this.seek(Number(hash.get('t')));
  }

  frame(now) {
    requestAnimationFrame(next => this.frame(next));
    if (this.playing) {
      if (this.last !== null) {
        const passed = Math.min(0.1, (now - this.last) / 1000);
        this.time = Math.min(this.data.end, this.time + this.speed * passed);
        this.watchSpeed((now - this.last) / 1000);
      }
      this.last = now;
      if (this.time >= this.data.end) {
        if (this.element('loop').checked) this.time = this.data.start;
        else this.play(false);
      }
      this.dirty = true;
    }
    if (this.dirty) this.drawNow();
  }
  drawNow() {
    this.dirty = false;
    this.draw();
    document.documentElement.dataset.tether = 'drawn';
  }
  watchSpeed(seconds) {
    const { quality } = this;
    this.mean = this.mean ? 0.9 * this.mean + 0.1 * seconds : seconds;
    this.element('fps').textContent = `${Math.round(1 / this.mean)} frames/s`;
    document.documentElement.dataset.fps = (1 / this.mean).toFixed(1);
    quality.slow = seconds > kSlow ? quality.slow + 1 : Math.max(0, quality.slow - 1);
    if (quality.slow < 8 || (!quality.shadows && quality.pixels < 0.4)) return;
    quality.slow = 0;
    if (quality.shadows) quality.shadows = false;
    else quality.pixels *= 0.75;
    this.resize();
  }
  draw() {
    const { data, show, camera } = this, frame = posesAt(data, this.time, this.poses);
    if (show.selected >= 0) {
      const at = Array.from(this.poses.subarray(7 * show.selected, 7 * show.selected + 3));
      if (this.before) camera.target = add(camera.target, subtract(at, this.before));
      else camera.target = at;
      this.before = at;
    }
    this.shapes.update(this.poses, frame, show);
    if (this.renderer) this.renderer.render(this.shapes, camera, this.planes, this.quality.shadows);
    this.drawNames();
    for (const plot of this.plots) plot.move(this.time);
    // Texts cost a painting of their part of the page: ten times a second are enough to read.
    const now = performance.now();
    if (this.playing && now - (this.said || 0) < 100) return;
    this.said = now;
    for (const plot of this.plots) plot.show(frame);
    this.element('scrub').value = String(1000 * (this.time - data.start) / (data.end - data.start || 1));
    this.element('time').textContent = `t = ${shortNumber(this.time)} s`;
    this.element('where').textContent = show.selected < 0 ? '' : '(' + Array.from(this.poses.subarray(7 * show.selected, 7 * show.selected + 3))
      .map((x, k) => shortNumber(x * data.length + data.centre[k])).join(', ') + ') m';
  }
  // Beside the centres; a name that would cover another one is left out.
  drawNames() {
    const place = this.element('names-layer'), { canvas, data, show } = this;
    const width = canvas.clientWidth, height = canvas.clientHeight, matrix = this.camera.matrix(width / height);
    const wanted = [];
    if (show.selected >= 0) wanted.push(show.selected);
    if (show.names) data.bodies.forEach((body, b) => { if (body.film !== null && b !== show.selected) wanted.push(b); });
    const taken = [];
    let used = 0;
    for (const b of wanted) {
      if (used === kMostNames) break;
      const at = onScreen(matrix, this.poses.subarray(7 * b, 7 * b + 3), width, height);
      if (!at || at[0] < 0 || at[1] < 0 || at[0] > width || at[1] > height) continue;
      let label = place.children[used];
      if (!label) {
        label = document.createElement('span');
        place.append(label);
      }
      if (label.textContent !== data.bodies[b].name) label.textContent = data.bodies[b].name;
      label.hidden = false;
      const w = label.offsetWidth, h = label.offsetHeight;
      const free = [[8, -h - 4], [8, 4], [-w - 8, -h - 4], [-w - 8, 4]].map(([dx, dy]) =>
        [Math.min(Math.max(0, at[0] + dx), Math.max(0, width - w)), Math.min(Math.max(0, at[1] + dy), Math.max(0, height - h))])
        .find(([x, y]) => !taken.some(t => x < t[0] + t[2] && t[0] < x + w && y < t[1] + t[3] && t[1] < y + h));
      if (!free) continue;
      taken.push([...free, w, h]);
      label.style.transform = `translate(${free[0]}px, ${free[1]}px)`;
      ++used;
    }
    for (let k = used; k < place.children.length; ++k) place.children[k].hidden = true;
  }
}

window.addEventListener('error', event => {
  const place = document.getElementById('message');
  place.textContent = `The page failed: ${event.message}`;
  place.hidden = false;
  document.documentElement.dataset.tether = 'failed';
});
const player = new Player(readFilm());
