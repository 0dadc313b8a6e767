// Everything that is drawn at a time: instances of forms. SPDX-License-Identifier: BSD-3-Clause

// Okabe and Ito: safe for colour-blind readers.
const kColours = [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [230, 159, 0], [86, 180, 233],
  [140, 140, 140]].map(c => c.map(x => x / 255));
const kFixed = [0.72, 0.72, 0.72], kJoint = [0.13, 0.13, 0.13], kSpring = [0.35, 0.2, 0.55], kForce = [0.85, 0.1, 0.15];

// Triangles with normals of a form, round ones with vertices in common, given by points and convex faces, counter-clockwise from outside.
function triangles(form) {
  const positions = [], normals = [], sums = form.points.map(() => [0, 0, 0]);
  const faceNormal = face => {
    let sum = [0, 0, 0];
    for (let k = 1; k + 1 < face.length; ++k)
      sum = add(sum, crossed(subtract(form.points[face[k]], form.points[face[0]]),
        subtract(form.points[face[k + 1]], form.points[face[0]])));
    return sum;
  };
  const faceNormals = form.faces.map(faceNormal);
  form.faces.forEach((face, f) => { for (const k of face) sums[k] = add(sums[k], faceNormals[f]); });
  const corners = [];  // of the triangles, three by three
  if (form.round) form.points.forEach((p, k) => { positions.push(...p); normals.push(...unit(sums[k])); });
  form.faces.forEach((face, f) => {
    const first = positions.length / 3;
    if (!form.round) for (const k of face) { positions.push(...form.points[k]); normals.push(...unit(faceNormals[f])); }
    const corner = k => form.round ? face[k] : first + k;
    for (let k = 1; k + 1 < face.length; ++k) corners.push(corner(0), corner(k), corner(k + 1));
  });
  return { positions, normals, corners, round: form.round };
}

// A surface around z by its rings, [radius, height] each, from below.
function lathe(rings, round) {
  const around = 12, points = [], faces = [];
  rings.forEach(([radius, height], r) => {
    for (let k = 0; k < around; ++k) {
      const angle = 2 * Math.PI * k / around, at = r * around + k, next = r * around + (k + 1) % around;
      points.push([radius * Math.cos(angle), radius * Math.sin(angle), height]);
      if (r + 1 < rings.length) faces.push([at, next, next + around, at + around]);
    }
  });
  return { points, faces, round };
}

// Instances of each form: 14 numbers each (position, quaternion, scale, colour, pattern). Bodies
// come first, one after the other, so that an instance knows its body.
class Instances {
  constructor(forms) { this.forms = forms.map(() => ({ numbers: new Float32Array(14 * 16), bodies: [], count: 0 })); }
  clear() { for (const form of this.forms) form.count = 0; }
  add(form, position, q, scale, colour, pattern, body) {
    const to = this.forms[form], at = 14 * to.count;
    if (at + 14 > to.numbers.length) {
      const more = new Float32Array(2 * to.numbers.length);
      more.set(to.numbers);
      to.numbers = more;
    }
    to.numbers.set(position, at);
    to.numbers.set(q, at + 3);
    to.numbers.set(scale, at + 7);
    to.numbers.set(colour, at + 10);
    to.numbers[at + 13] = pattern;
    to.bodies[to.count++] = body;
  }
}

const kNone = [1, 0, 0, 0];

class Shapes {
  // `size` of the view and `reach` of a typical body, which markers are parts of.
  constructor(data, size, reach) {
    this.data = data;
    this.forms = data.forms.map(triangles);
    const extra = form => this.forms.push(triangles(form)) - 1;
    this.ball = extra(lathe([0, 1, 2, 3, 4, 5, 6, 7].map(r => [Math.sin(Math.PI * r / 7), -Math.cos(Math.PI * r / 7)]), true));
    this.rod = extra(lathe([[0, 0], [1, 0], [1, 1], [0, 1]], false));
    this.head = extra(lathe([[0, 0], [1, 0], [0, 1]], false));  // of an arrow
    this.solid = new Instances(this.forms);
    this.above = new Instances(this.forms);  // drawn over all bodies
    this.marker = reach > 0 ? Math.max(0.002 * size, Math.min(0.009 * size, 0.12 * reach)) : 0.009 * size;
    this.reach = 14 * this.marker;  // of the arrow of a large impulse
  }
  colour(b) { return this.data.bodies[b].film === null ? kFixed : kColours[b % kColours.length]; }

  update(poses, frame, show) {
    this.poses = poses;
    this.solid.clear();
    this.above.clear();
    this.data.bodies.forEach((body, b) => this.addBody(body, b, show));
    for (const spring of this.data.springs) this.addSpring(spring);
    for (const at of this.data.centres) this.addBall(this.solid, at, 2 * this.marker, kFixed, -1);
    for (const joint of this.data.joints) {
      if (joint.kind === 'distance') this.addRod(this.solid, this.place(joint.first), this.place(joint.second), 0.5 * this.marker, kJoint);
      if (show.joints) this.addJoint(joint);
    }
    if (show.contacts) this.addContacts(frame);
  }
  pose(b) {
    const p = this.poses.subarray(7 * b, 7 * b + 7);
    return { position: p.subarray(0, 3), q: p.subarray(3, 7) };
  }
  place(anchor) {
    if (anchor.body < 0) return anchor.at;
    const { position, q } = this.pose(anchor.body);
    return add(position, rotated(q, anchor.at));
  }
  addBody(body, b, show) {
    const selected = show.selected === b, through = show.through && body.film === null;
    const { position, q } = this.pose(b);
    const colour = selected ? this.colour(b).map(x => 0.35 + 0.65 * x) : this.colour(b);
    const pattern = selected ? 1 : 0.72;
    if (body.parts.length === 0) this.addBall(this.solid, position, 2.5 * this.marker, colour, b);
    for (const part of body.parts) {
      if (part.normal) continue;
      const at = add(position, rotated(q, part.position));
      if (part.dots) {
        for (const dot of part.dots)
          this.addBall(this.solid, add(at, rotated(q, rotated(part.orientation, dot))), this.marker, colour, b);
        continue;
      }
      this.solid.add(part.form, at, product(q, part.orientation), part.scale, colour,
        through ? -1 : this.forms[part.form].round ? pattern : 1, b);
    }
  }
  addBall(to, at, radius, colour, b) { to.add(this.ball, at, kNone, [radius, radius, radius], colour, 1, b); }
  addRod(to, from, end, radius, colour, form = this.rod) {
    const along = subtract(end, from), length = lengthOf(along);
    if (length > 0) to.add(form, from, turnTo(scaled(along, 1 / length)), [radius, radius, length], colour, 1, -1);
  }
  addSpring(spring) {
    const from = this.place(spring.first), end = this.place(spring.second);
    if (spring.rings) {
      const points = [from, ...spring.rings.map(each => this.place(each)), end];
      for (let k = 1; k < points.length; ++k) this.addRod(this.solid, points[k - 1], points[k], 0.3 * this.marker, kSpring);
      return;
    }
    const along = unit(subtract(end, from)), across = unit(crossed(along, Math.abs(along[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
    const turns = 10, width = 2.2 * this.marker;
    let last = from;
    for (let k = 1; k <= turns + 1; ++k) {
      const share = k > turns ? 1 : (k - 0.5) / turns;
      const aside = k > turns ? 0 : (k % 2 ? width : -width);
      const next = add(add(scaled(from, 1 - share), scaled(end, share)), scaled(across, aside));
      this.addRod(this.solid, last, next, 0.3 * this.marker, kSpring);
      last = next;
    }
  }
  // Points as balls, axes as pins through them.
  addJoint(joint) {
    const ends = [this.place(joint.first), this.place(joint.second)];
    for (const at of ends) this.addBall(this.above, at, 0.8 * this.marker, kJoint, -1);
    if (joint.kind !== 'hinge' && joint.kind !== 'slider' && joint.kind !== 'universal') return;
    const axis = joint.axis_body < 0 ? joint.axis : rotated(this.pose(joint.axis_body).q, joint.axis);
    const half = scaled(axis, (joint.kind === 'slider' ? 8 : 3) * this.marker);
    this.addRod(this.above, subtract(ends[0], half), add(ends[0], half), 0.4 * this.marker, kJoint);
  }
  // The impulse, or force, on the first body; a contact without one shows its normal.
  addContacts(frame) {
    const n = this.data.contactNumbers, large = this.data.largeImpulse;
    for (let k = this.data.firstContact[frame]; k < this.data.firstContact[frame + 1]; ++k) {
      const at = n.subarray(9 * k, 9 * k + 3), impulse = n.subarray(9 * k + 3, 9 * k + 6);
      this.addBall(this.above, at, 0.5 * this.marker, kForce, -1);
      if (!(large > 0)) continue;
      // Square roots: the small ones of a heap are seen beside the large ones.
      const length = this.reach * Math.sqrt(Math.min(3, lengthOf(impulse) / large)), along = unit(impulse);
      if (length < this.marker) continue;
      const neck = add(at, scaled(along, Math.max(0, length - 2 * this.marker)));
      this.addRod(this.above, at, neck, 0.35 * this.marker, kForce);
      this.addRod(this.above, neck, add(at, scaled(along, length)), this.marker, kForce, this.head);
    }
  }
}
