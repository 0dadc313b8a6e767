// Draws instances with WebGL 2. SPDX-License-Identifier: BSD-3-Clause

const kVertex = `#version 300 es
layout(location=0) in vec3 point; layout(location=1) in vec3 normal;
layout(location=2) in vec3 place; layout(location=3) in vec4 turn; layout(location=4) in vec3 size;
layout(location=5) in vec4 colour;
uniform mat4 view; uniform vec4 ground; uniform vec3 light; uniform bool shadow;
out vec3 across, local, tint; out float pattern;
vec3 turned(vec3 v) { vec3 t = 2.0 * cross(turn.yzw, v); return v + turn.x * t + cross(turn.yzw, t); }
void main() {
  vec3 p = place + turned(size * point);
  if (shadow) p -= light * ((dot(ground.xyz, p) - ground.w) / dot(ground.xyz, light));
  across = turned(normal / size); local = point; tint = colour.rgb; pattern = colour.a;
  gl_Position = view * vec4(p, 1.0);
}`;
const kFragment = `#version 300 es
precision highp float;
in vec3 across, local, tint; in float pattern;
uniform vec3 light, towards; uniform int mode;
out vec4 pixel;
void main() {
  // Bodies to be seen through have one pixel in four, and none where a body is looked for.
  if (pattern < 0.0 && (mode == 2 || mod(gl_FragCoord.x, 2.0) > 1.0 || mod(gl_FragCoord.y, 2.0) > 1.0)) discard;
  if (mode == 1) { pixel = vec4(0.0, 0.0, 0.0, 0.16); return; }
  if (mode == 2) { pixel = vec4(tint, 1.0); return; }
  vec3 n = normalize(across);
  float lit = 0.58 + 0.3 * max(dot(n, light), 0.0) + 0.28 * max(dot(n, towards), 0.0);
  float dark = local.x * local.y * local.z < 0.0 ? abs(pattern) : 1.0;  // turning spheres are seen to turn
  pixel = vec4(tint * lit * dark + 0.06, 1.0);
}`;
const kGroundVertex = `#version 300 es
uniform mat4 view; uniform vec3 middle, first, second; uniform float half_edge;
out vec2 at;
void main() {
  at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
  gl_Position = view * vec4(middle + half_edge * (at.x * first + at.y * second), 1.0);
}`;
const kGroundFragment = `#version 300 es
precision highp float;
in vec2 at;
uniform vec2 origin; uniform float half_edge, cell, strength;
out vec4 pixel;
void main() {
  vec2 c = (origin + half_edge * at) / cell, width = fwidth(c);
  vec2 line = smoothstep(vec2(0.0), 1.5 * width, abs(fract(c - 0.5) - 0.5));
  float drawn = (1.0 - min(line.x, line.y)) * clamp(1.0 - 4.0 * max(width.x, width.y), 0.0, 1.0);
  float faded = 1.0 - smoothstep(0.3, 1.0, length(at));
  pixel = vec4(mix(vec3(0.93, 0.925, 0.91), vec3(0.72), drawn), faded * strength);
}`;

// Without a graphics processor smooth edges cost four times the pixels.
function drawnBySoftware() {
  const gl = document.createElement('canvas').getContext('webgl2');
  const info = gl && gl.getExtension('WEBGL_debug_renderer_info');
  return Boolean(info) && /swiftshader|llvmpipe|softpipe|software|basic render/i.test(gl.getParameter(info.UNMASKED_RENDERER_WEBGL));
}

class Renderer {
  constructor(canvas, shapes) {
    this.software = drawnBySoftware();
    const gl = canvas.getContext('webgl2', { antialias: !this.software, stencil: true, alpha: false });
    if (!gl) throw new Error('This browser has no WebGL 2, which the drawing needs. The curves below are whole.');
    this.gl = gl;
    this.canvas = canvas;
    this.solid = this.program(kVertex, kFragment);
    this.plane = this.program(kGroundVertex, kGroundFragment);
    this.meshes = shapes.forms.map(form => this.mesh(form));
    this.empty = gl.createVertexArray();
  }
  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const setters = { [gl.FLOAT]: 'uniform1f', [gl.FLOAT_VEC2]: 'uniform2fv', [gl.FLOAT_VEC3]: 'uniform3fv', [gl.FLOAT_VEC4]: 'uniform4fv',
      [gl.INT]: 'uniform1i', [gl.BOOL]: 'uniform1i' }, places = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++i) {
      const { name, type } = gl.getActiveUniform(program, i);
      places[name] = [gl.getUniformLocation(program, name), setters[type]];
    }
    return uniforms => {
      gl.useProgram(program);
      for (const [name, value] of Object.entries(uniforms)) {
        const [place, setter] = places[name];
        if (setter) gl[setter](place, value); else gl.uniformMatrix4fv(place, false, value);
      }
    };
  }
  mesh(form) {
    const gl = this.gl, vertices = gl.createVertexArray();
    gl.bindVertexArray(vertices);
    [form.positions, form.normals].forEach((numbers, location) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, 3, gl.FLOAT, false, 0, 0);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(form.corners), gl.STATIC_DRAW);
    const instances = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, instances);
    [[2, 3, 0], [3, 4, 3], [4, 3, 7], [5, 4, 10]].forEach(([location, count, offset]) => {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, count, gl.FLOAT, false, 56, 4 * offset);
      gl.vertexAttribDivisor(location, 1);
    });
    return { vertices, instances, count: form.corners.length };
  }
  // `fresh`: they have changed since they were drawn last.
  draw(instances, fresh) {
    const gl = this.gl;
    instances.forms.forEach((form, f) => {
      if (form.count === 0) return;
      gl.bindBuffer(gl.ARRAY_BUFFER, this.meshes[f].instances);
      if (fresh) gl.bufferData(gl.ARRAY_BUFFER, form.numbers.subarray(0, 14 * form.count), gl.DYNAMIC_DRAW);
      gl.bindVertexArray(this.meshes[f].vertices);
      gl.drawElementsInstanced(gl.TRIANGLES, this.meshes[f].count, gl.UNSIGNED_INT, 0, form.count);
    });
  }
  // planes: { middle, first, second, normal, origin, edge, cell, shaded }
  render(shapes, camera, planes, shadows) {
    const gl = this.gl, { canvas } = this, matrix = camera.matrix(canvas.width / canvas.height);
    const { towards, right } = camera.axes();
    const light = unit(add(add(scaled(camera.up, 1.6), scaled(towards, 0.7)), scaled(right, -0.6)));
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    this.solid({ view: matrix, light, towards, shadow: 0, mode: 0 });
    gl.enable(gl.CULL_FACE);
    this.draw(shapes.solid, true);
    gl.disable(gl.CULL_FACE);
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    for (const plane of planes) this.drawPlane(plane, matrix, camera);
    if (shadows) for (const plane of planes) if (plane.shaded) this.drawShadows(shapes, plane, camera);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    this.solid({ light, shadow: 0, mode: 0 });
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.draw(shapes.above, true);
  }
  drawPlane({ middle, first, second, normal, origin, edge, cell }, matrix, camera) {
    const gl = this.gl, above = dotted(subtract(camera.eye(), middle), normal) > 0;
    this.plane({ view: matrix, middle, first, second, half_edge: edge, origin, cell, strength: above ? 1 : 0.3 });
    gl.bindVertexArray(this.empty);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 1);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.disable(gl.POLYGON_OFFSET_FILL);
  }
  // The stencil darkens a pixel once.
  drawShadows(shapes, { middle, normal }, camera) {
    const gl = this.gl;
    if (dotted(subtract(camera.eye(), middle), normal) <= 0) return;
    this.solid({ shadow: 1, mode: 1, light: unit(add(normal, scaled(camera.front, -0.15))), ground: [...normal, dotted(normal, middle)] });
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 0xff);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    this.draw(shapes.solid, false);
    gl.disable(gl.STENCIL_TEST);
  }
  // The body drawn at a pixel of the canvas, -1: none. Its number is drawn as a colour.
  bodyAt(shapes, camera, x, y) {
    const gl = this.gl, { canvas } = this;
    const colours = shapes.solid.forms.map(form => form.numbers.slice(0, 14 * form.count));
    shapes.solid.forms.forEach(form => {
      for (let i = 0; i < form.count; ++i) {
        const number = form.bodies[i] + 1;
        form.numbers.set([number >> 16, number >> 8 & 255, number & 255].map(c => c / 255), 14 * i + 10);
      }
    });
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.solid({ view: camera.matrix(canvas.width / canvas.height), shadow: 0, mode: 2 });
    this.draw(shapes.solid, true);
    const pixel = new Uint8Array(4);
    gl.readPixels(x, canvas.height - 1 - y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    shapes.solid.forms.forEach((form, f) => form.numbers.set(colours[f]));
    const body = (pixel[0] << 16 | pixel[1] << 8 | pixel[2]) - 1;
    return body < shapes.data.bodies.length ? body : -1;
  }
}
