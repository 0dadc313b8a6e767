// The data of the page and poses at any time. SPDX-License-Identifier: BSD-3-Clause
//
// Lengths are in units of the view: (x - centre) / length. Quaternions are [w, x, y, z], body to world.
'use strict';

function textOf(id) { return document.getElementById(id).textContent; }

// Little-endian numbers in base 64; `read` names a method of DataView.
function numbersOf(id, Type, read) {
  const text = atob(textOf(id));
  const view = new DataView(new ArrayBuffer(text.length));
  for (let i = 0; i < text.length; ++i) view.setUint8(i, text.charCodeAt(i));
  const out = new Type(text.length / Type.BYTES_PER_ELEMENT);
  for (let i = 0; i < out.length; ++i) out[i] = view[read](i * Type.BYTES_PER_ELEMENT, true);
  return out;
}

function readFilm() {
  const data = JSON.parse(textOf('film-data'));
  data.positions = numbersOf('film-positions', Float32Array, 'getFloat32');
  data.orientations = numbersOf('film-orientations', Int16Array, 'getInt16');
  data.contactNumbers = numbersOf('film-contacts', Float32Array, 'getFloat32');
  data.moving = data.bodies.filter(b => b.film !== null).length;
  data.firstContact = [0];
  for (const count of data.contacts) data.firstContact.push(data.firstContact[data.firstContact.length - 1] + count);
  // Nine tenths of the impulses are smaller: beside an impact those of rest would not be seen.
  const impulses = [];
  for (let k = 0; k < data.contactNumbers.length; k += 9) {
    const impulse = Math.hypot(...data.contactNumbers.subarray(k + 3, k + 6));
    if (impulse > 0) impulses.push(impulse);
  }
  impulses.sort((a, b) => a - b);
  data.largeImpulse = impulses.length > 0 ? impulses[Math.floor(0.9 * (impulses.length - 1))] : 0;
  data.start = data.times[0];
  data.end = data.times[data.times.length - 1];
  return data;
}

// The last frame not after `time`.
function frameAt(data, time) {
  let low = 0, high = data.times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (data.times[middle] <= time) low = middle; else high = middle - 1;
  }
  return low;
}

// Poses of all bodies, 7 numbers each: between frames positions are linear, turns go the short way.
function posesAt(data, time, poses) {
  const a = frameAt(data, time), b = Math.min(a + 1, data.times.length - 1);
  const span = data.times[b] - data.times[a];
  const share = span > 0 ? Math.min(1, Math.max(0, (time - data.times[a]) / span)) : 0;
  data.bodies.forEach((body, i) => {
    const out = poses.subarray(7 * i, 7 * i + 7);
    if (body.film === null) return out.set([...body.position, ...body.orientation]);
    const of = (numbers, size, frame) => numbers.subarray(size * (frame * data.moving + body.film)).subarray(0, size);
    const pa = of(data.positions, 3, a), pb = of(data.positions, 3, b), qa = of(data.orientations, 4, a), qb = of(data.orientations, 4, b);
    for (let k = 0; k < 3; ++k) out[k] = pa[k] + share * (pb[k] - pa[k]);
    const sign = qa.reduce((sum, x, k) => sum + x * qb[k], 0) < 0 ? -1 : 1;
    for (let k = 0; k < 4; ++k) out[3 + k] = (1 - share) * qa[k] + share * sign * qb[k];
    const norm = Math.hypot(out[3], out[4], out[5], out[6]) || 1;
    for (let k = 3; k < 7; ++k) out[k] /= norm;
  });
  return a;
}
