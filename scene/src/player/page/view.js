// Vectors, and the camera. SPDX-License-Identifier: BSD-3-Clause

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dotted = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const crossed = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const lengthOf = a => Math.hypot(a[0], a[1], a[2]);
function unit(a) {
  const length = lengthOf(a);
  return length > 0 ? scaled(a, 1 / length) : [0, 0, 1];
}
function rotated(q, v) {  // q: [w, x, y, z]
  const u = [q[1], q[2], q[3]], t = scaled(crossed(u, v), 2);
  return add(add(v, scaled(t, q[0])), crossed(u, t));
}
function product(a, b) {  // of quaternions
  const u = [a[1], a[2], a[3]], v = [b[1], b[2], b[3]];
  const w = add(add(scaled(v, a[0]), scaled(u, b[0])), crossed(u, v));
  return [a[0] * b[0] - dotted(u, v), w[0], w[1], w[2]];
}
// The turn that takes z to the unit vector n.
function turnTo(n) {
  if (n[2] < -0.999999) return [0, 1, 0, 0];
  const w = 1 + n[2], norm = Math.hypot(w, n[0], n[1]);
  return [w / norm, -n[1] / norm, n[0] / norm, 0];
}

const kFieldOfView = 0.6;  // rad, of the smaller side

// A view of `target` from `distance`; angles as in a globe whose axis is `up`.
class Camera {
  constructor(up) {
    this.up = unit(up);
    const other = Math.abs(this.up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
    this.front = unit(subtract(other, scaled(this.up, dotted(other, this.up))));
    this.side = crossed(this.up, this.front);
    this.target = [0, 0, 0];
    this.distance = 4;
    this.azimuth = 0.45;
    this.elevation = 0.3;
  }
  // Right, up and towards the viewer.
  axes() {
    const [ca, sa] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    const level = add(scaled(this.front, sa), scaled(this.side, -ca));
    const towards = add(scaled(level, ce), scaled(this.up, se));
    const right = add(scaled(this.front, ca), scaled(this.side, sa));
    return { right, towards, above: crossed(towards, right) };
  }
  turn(dx, dy) {
    this.azimuth -= dx;
    this.elevation = Math.max(-1.55, Math.min(1.55, this.elevation + dy));
  }
  // By parts of the picture's smaller side.
  shift(dx, dy) {
    const { right, above } = this.axes(), reach = 2 * Math.tan(kFieldOfView / 2) * this.distance;
    this.target = add(this.target, add(scaled(right, -dx * reach), scaled(above, dy * reach)));
  }
  zoom(factor) { this.distance = Math.max(1e-4, Math.min(1e5, this.distance * factor)); }
  eye() { return add(this.target, scaled(this.axes().towards, this.distance)); }
  // Column by column, for points of the view.
  matrix(aspect) {
    const { right, towards, above } = this.axes(), eye = this.eye();
    const near = this.distance * 0.02, far = this.distance * 60;
    const focal = 1 / Math.tan(kFieldOfView / 2);
    const fx = aspect > 1 ? focal / aspect : focal, fy = aspect > 1 ? focal : focal * aspect;
    const depth = (far + near) / (far - near), offset = 2 * far * near / (far - near);
    const rows = [
      [...scaled(right, fx), -fx * dotted(right, eye)],
      [...scaled(above, fy), -fy * dotted(above, eye)],
      [...scaled(towards, -depth), depth * dotted(towards, eye) - offset],
      [...scaled(towards, -1), dotted(towards, eye)],
    ];
    const out = new Float32Array(16);
    for (let i = 0; i < 4; ++i) for (let k = 0; k < 4; ++k) out[4 * k + i] = rows[i][k];
    return out;
  }
}

// Place of a point of the view on a canvas of the size given; null: behind the eye.
function onScreen(matrix, p, width, height) {
  const at = i => matrix[i] * p[0] + matrix[4 + i] * p[1] + matrix[8 + i] * p[2] + matrix[12 + i];
  const w = at(3);
  return w > 0 ? [(at(0) / w + 1) / 2 * width, (1 - at(1) / w) / 2 * height] : null;
}
