// A cloud on a canvas: what report/viewer.py packed, unpacked and drawn with WebGL 2 by hand.
//
// Coordinates are the camera's: x right, y down, z forward. The projection is parallel, so that one
// scale holds for all of the view. The page runs this file and viewer.js as one script.

const POINT_BIT = 16;

const VERTEX = `#version 300 es
  in vec3 place;  // in steps of the quantisation
  in vec3 normal;
  in float level;
  uniform mat3 turn;
  uniform vec3 middle;
  uniform vec3 scale;
  uniform vec2 shift;
  uniform float dot_size;
  centroid out vec3 facing;  // at the rim of a triangle no value beyond its corners
  centroid out float shade;
  void main() {
    gl_Position = vec4(turn * (place - middle) * scale + vec3(shift, 0.0), 1.0);
    gl_PointSize = dot_size;
    facing = turn * normal;
    shade = level;
  }`;

// Lambert, the lamp above to the left of whoever looks; what is seen from behind is greyed.
const FRAGMENT = `#version 300 es
  precision highp float;
  centroid in vec3 facing;
  centroid in float shade;
  uniform sampler2D colours;
  out vec4 pixel;
  const vec3 LAMP = normalize(vec3(-0.40, -0.50, -0.77));
  void main() {
    vec3 outward = gl_FrontFacing ? facing : -facing;
    float size = length(outward);
    float lit = size > 0.0 ? max(dot(outward / size, LAMP), 0.0) : 0.5;
    vec3 colour = texture(colours, vec2((shade * 255.0 + 0.5) / 256.0, 0.5)).rgb;
    if (!gl_FrontFacing) colour = mix(colour, vec3(0.5), 0.75);
    pixel = vec4(colour * (0.45 + 0.55 * lit), 1.0);
  }`;

function decode(text, Type) {
  return new Type(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
}

// Corners of the triangles that the cells tell, then the points that belong to none.
function indicesOf(cells, columns) {
  const number = new Uint32Array(cells.length);
  let count = 0;
  cells.forEach((cell, node) => { number[node] = count; if (cell & POINT_BIT) count++; });
  const indices = [], joined = new Uint8Array(count);
  cells.forEach((cell, node) => {
    const corners = [node, node + 1, node + columns + 1, node + columns];
    for (let without = 0; without < 4; without++) {
      if (!(cell >> without & 1)) continue;
      for (let next = 1; next < 4; next++) {
        const vertex = number[corners[(without + next) % 4]];
        indices.push(vertex);
        joined[vertex] = 1;
      }
    }
  });
  const closed = indices.length;
  joined.forEach((is, vertex) => { if (!is) indices.push(vertex); });
  return { indices: Uint32Array.from(indices), closed };
}

// Middle and half extent of the points, in steps.
function boxOf(points) {
  const low = [65535, 65535, 65535], high = [0, 0, 0];
  points.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3], value);
    high[i % 3] = Math.max(high[i % 3], value);
  });
  const half = low.map((value, i) => (high[i] - value) / 2);
  return { middle: low.map((value, i) => value + half[i]), half, reach: Math.hypot(...half) };
}

function compile(gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  ["place", "normal", "level"].forEach((name, i) => gl.bindAttribLocation(program, i, name));
  gl.linkProgram(program);
  return gl.getProgramParameter(program, gl.LINK_STATUS) ? program : null;
}

function upload(gl, values, kind = gl.ARRAY_BUFFER) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(kind, buffer);
  gl.bufferData(kind, values, gl.STATIC_DRAW);
  return buffer;
}

function feed(gl, location, buffer, size, type, normalised) {
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.enableVertexAttribArray(location);
  gl.vertexAttribPointer(location, size, type, normalised, 0, 0);
}

// What draws a cloud on a canvas: null where there is no WebGL 2.
function paintingOn(canvas, data) {
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  const program = gl && compile(gl);
  if (!program) return null;
  gl.useProgram(program);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.enable(gl.DEPTH_TEST);
  gl.frontFace(gl.CW);                        // as cells go round when the camera looks
  const points = decode(data.points, Uint16Array), box = boxOf(points);
  const { indices, closed } = indicesOf(decode(data.cells, Uint8Array), data.columns);
  feed(gl, 0, upload(gl, points), 3, gl.UNSIGNED_SHORT, false);
  feed(gl, 1, upload(gl, decode(data.normals, Int8Array)), 3, gl.BYTE, true);
  upload(gl, indices, gl.ELEMENT_ARRAY_BUFFER);
  const levels = data.modes.map((mode) => upload(gl, decode(mode.levels, Uint8Array)));
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
    gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
  const uniform = (name) => gl.getUniformLocation(program, name);

  function colour(mode) {
    feed(gl, 2, levels[mode], 1, gl.UNSIGNED_BYTE, true);
    const colours = decode(data.modes[mode].colours, Uint8Array);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, colours);
  }

  function paint(pose, pxPerMm, { width, height, density }) {
    const px = pxPerMm * data.step;           // px for a step
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix3fv(uniform("turn"), true, pose.turn);
    gl.uniform3fv(uniform("middle"), box.middle);
    gl.uniform3f(uniform("scale"), 2 * px / width, -2 * px / height, 1 / (box.reach || 1));
    gl.uniform2f(uniform("shift"), 2 * pose.right / width, -2 * pose.down / height);
    gl.uniform1f(uniform("dot_size"), 1.5 * density);
    gl.drawElements(gl.TRIANGLES, closed, gl.UNSIGNED_INT, 0);
    gl.drawElements(gl.POINTS, indices.length - closed, gl.UNSIGNED_INT, 4 * closed);
  }
  return { halfMm: box.half.map((steps) => steps * data.step || 1), colour, paint };
}
