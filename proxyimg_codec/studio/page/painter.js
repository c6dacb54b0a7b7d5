/**
 * Draws layers with WebGL2: a texture each, one draw call each, blended premultiplied from the back.
 *
 * What is drawn is a list of items {key, matrix, box, colour, opacity, mesh}: `key` names a texture that
 * was given, `box` is what it covers at rest. A `mesh` {key, positions, uvs, triangles} takes the place
 * of the box when the layer is bent.
 */

/** @typedef {{key: string, matrix: number[], box: number[], colour: number[]|null, opacity: number,
 *   mesh?: {key: string, positions: Float32Array, uvs: Float32Array, triangles: Uint32Array}|null}} Item */

const VERTEX = `#version 300 es
in vec2 at; in vec2 uv;
uniform vec3 row0, row1;
out vec2 place;
void main() {
  vec3 p = vec3(at, 1.0);
  place = uv;
  gl_Position = vec4(dot(row0, p), dot(row1, p), 0.0, 1.0);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec2 place;
uniform sampler2D image;
uniform mat4 colour;
uniform float opacity;
uniform bool changed;
out vec4 result;
void main() {
  vec4 c = texture(image, place);
  if (changed && c.a > 0.0) c.rgb = clamp((colour * vec4(c.rgb / c.a, 1.0)).rgb, 0.0, 1.0) * c.a;
  result = c * opacity;
}`;

export class Painter {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { alpha: true, antialias: false, premultipliedAlpha: true, desynchronized: true });
    if (!gl) throw new Error("no WebGL2");
    this.gl = gl;
    this.canvas = canvas;
    this.calls = 0;
    /** @type {Map<string, {texture: WebGLTexture, width: number, height: number}>} */
    this.textures = new Map();
    this.#prepare();
    canvas.addEventListener("webglcontextlost", (e) => e.preventDefault());
  }

  #prepare() {
    const { gl } = this, program = /** @type {WebGLProgram} */ (gl.createProgram());
    for (const [kind, source] of /** @type {[number, string][]} */ ([[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]])) {
      const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "at");
    gl.bindAttribLocation(program, 1, "uv");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) ?? "link");
    gl.useProgram(program);
    this.uniforms = Object.fromEntries(["row0", "row1", "colour", "opacity", "changed"].map((n) => [n, gl.getUniformLocation(program, n)]));
    this.square = [gl.createBuffer(), gl.createBuffer()];
    this.buffers = { at: gl.createBuffer(), uv: gl.createBuffer(), index: gl.createBuffer() };
    gl.bindBuffer(gl.ARRAY_BUFFER, this.square[0]);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.enableVertexAttribArray(1);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
  }

  /** @param {string} key */
  has(key) { return this.textures.has(key); }

  /** @param {string} key @param {{width: number, height: number, data: Uint8ClampedArray}} pixels RGBA, straight */
  give(key, { width, height, data }) {
    const { gl } = this;
    const texture = /** @type {WebGLTexture} */ (gl.createTexture());
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, new ImageData(/** @type {any} */ (data), width, height));
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_NEAREST);
    this.drop(key);
    this.textures.set(key, { texture, width, height });
  }

  /** @param {string} key */
  drop(key) {
    const old = this.textures.get(key);
    if (old) this.gl.deleteTexture(old.texture);
    this.textures.delete(key);
  }

  /**
   * @param {Item[]} items back to front @param {import("./viewport.js").Viewport} view
   * @param {number} ratio device pixels in a CSS pixel @param {number[]} size of the canvas
   */
  draw(items, view, ratio, size) {
    const { gl, canvas, uniforms } = this;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    const [x0, y0] = view.toScreen(0, 0), [x1, y1] = view.toScreen(size[0], size[1]);
    const left = Math.round(x0 * ratio), right = Math.round(x1 * ratio), top = Math.round(y0 * ratio), bottom = Math.round(y1 * ratio);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(left, canvas.height - bottom, Math.max(0, right - left), Math.max(0, bottom - top));
    const sx = (2 * view.scale * ratio) / canvas.width, sy = (-2 * view.scale * ratio) / canvas.height;
    const tx = (2 * view.x * ratio) / canvas.width - 1, ty = 1 - (2 * view.y * ratio) / canvas.height;
    this.calls = 0;
    for (const item of items) {
      const texture = this.textures.get(item.key);
      if (!texture || item.opacity <= 0) continue;
      gl.bindTexture(gl.TEXTURE_2D, texture.texture);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, view.scale * ratio > 8 ? gl.NEAREST : gl.LINEAR);
      let [a, b, c, d, e, f] = item.matrix;
      if (!item.mesh) {
        const [x, y, w, h] = item.box;
        [a, b, c, d, e, f] = [a * w, b * w, c * h, d * h, a * x + c * y + e, b * x + d * y + f];
      }
      gl.uniform3f(uniforms.row0, a * sx, c * sx, e * sx + tx);
      gl.uniform3f(uniforms.row1, b * sy, d * sy, f * sy + ty);
      gl.uniform1f(uniforms.opacity, item.opacity);
      gl.uniform1i(uniforms.changed, item.colour ? 1 : 0);
      if (item.colour) {
        const m = item.colour;
        gl.uniformMatrix4fv(uniforms.colour, false, [m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0, m[3], m[7], m[11], 1]);
      }
      this.#shape(item.mesh);
      this.calls++;
    }
  }

  #shape(mesh) {
    const { gl, buffers } = this;
    if (!mesh) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.square[0]);
      gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
      gl.vertexAttribPointer(1, 2, gl.FLOAT, false, 0, 0);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
      return;
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.at);
    gl.bufferData(gl.ARRAY_BUFFER, mesh.positions, gl.STREAM_DRAW);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.uv);
    gl.bufferData(gl.ARRAY_BUFFER, mesh.uvs, gl.STREAM_DRAW);
    gl.vertexAttribPointer(1, 2, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.index);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.triangles, gl.STREAM_DRAW);
    gl.drawElements(gl.TRIANGLES, mesh.triangles.length, gl.UNSIGNED_INT, 0);
  }
}

/** The same with a 2-D canvas, where there is no WebGL2. Colour changes show when the exact picture comes. */
export class FlatPainter {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    this.calls = 0;
    /** @type {Map<string, HTMLCanvasElement>} */
    this.textures = new Map();
  }

  /** @param {string} key */
  has(key) { return this.textures.has(key); }

  /** @param {string} key @param {{width: number, height: number, data: Uint8ClampedArray}} pixels */
  give(key, { width, height, data }) {
    const sheet = Object.assign(document.createElement("canvas"), { width, height });
    sheet.getContext("2d")?.putImageData(new ImageData(/** @type {any} */ (data), width, height), 0, 0);
    this.textures.set(key, sheet);
  }

  /** @param {string} key */
  drop(key) { this.textures.delete(key); }

  /** @param {Item[]} items @param {import("./viewport.js").Viewport} view @param {number} ratio @param {number[]} size */
  draw(items, view, ratio, size) {
    const { context: c, canvas } = this;
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, canvas.width, canvas.height);
    c.save();
    c.setTransform(view.scale * ratio, 0, 0, view.scale * ratio, view.x * ratio, view.y * ratio);
    c.beginPath();
    c.rect(0, 0, size[0], size[1]);
    c.clip();
    const base = c.getTransform();
    this.calls = 0;
    for (const item of items) {
      const sheet = this.textures.get(item.key);
      if (!sheet) continue;
      c.globalAlpha = item.opacity;
      c.setTransform(base.multiply(new DOMMatrix(item.matrix)));
      if (item.mesh) this.#bent(sheet, item.mesh);
      else c.drawImage(sheet, item.box[0], item.box[1], item.box[2], item.box[3]);
      this.calls++;
    }
    c.restore();
  }

  #bent(sheet, { positions, uvs, triangles }) {
    const { context: c } = this, base = c.getTransform();
    for (let t = 0; t < triangles.length; t += 3) {
      const [i, j, k] = [2 * triangles[t], 2 * triangles[t + 1], 2 * triangles[t + 2]];
      const u = [i, j, k].map((n) => [uvs[n] * sheet.width, uvs[n + 1] * sheet.height]);
      const p = [i, j, k].map((n) => [positions[n], positions[n + 1]]);
      const det = (u[1][0] - u[0][0]) * (u[2][1] - u[0][1]) - (u[2][0] - u[0][0]) * (u[1][1] - u[0][1]);
      if (!det) continue;
      const across = (axis) => [
        ((p[1][axis] - p[0][axis]) * (u[2][1] - u[0][1]) - (p[2][axis] - p[0][axis]) * (u[1][1] - u[0][1])) / det,
        ((p[2][axis] - p[0][axis]) * (u[1][0] - u[0][0]) - (p[1][axis] - p[0][axis]) * (u[2][0] - u[0][0])) / det,
      ];
      const [a, cc] = across(0), [b, d] = across(1);
      c.save();
      c.setTransform(base);
      c.beginPath();
      p.forEach(([x, y], n) => (n ? c.lineTo(x, y) : c.moveTo(x, y)));
      c.clip();
      c.transform(a, b, cc, d, p[0][0] - a * u[0][0] - cc * u[0][1], p[0][1] - b * u[0][0] - d * u[0][1]);
      c.drawImage(sheet, 0, 0);
      c.restore();
    }
  }
}
