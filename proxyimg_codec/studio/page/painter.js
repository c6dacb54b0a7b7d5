import { pathData, sampled } from "./bezier.js";

/**
 * Draws layers with WebGL2: a texture each, one draw call each, blended premultiplied from the back.
 *
 * What is drawn is a list of items {key, matrix, box, colour, opacity, mesh}: `key` names a texture that
 * was given, `box` is what it covers at rest. A `mesh` {key, positions, uvs, triangles} takes the place
 * of the box when the layer is bent; a `clip` is an outline on the canvas that cuts it.
 */

/** @typedef {{key: string, matrix: number[], box: number[], colour: number[]|null, opacity: number, clip?: number[][][]|null,
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
out vec4 result;
void main() {
#ifdef BENT
  if (place.x < 0.0 || place.y < 0.0 || place.x > 1.0 || place.y > 1.0) discard;
#endif
  vec4 c = texture(image, place);
#ifdef CHANGED
  if (c.a > 0.0) c.rgb = clamp((colour * vec4(c.rgb / c.a, 1.0)).rgb, 0.0, 1.0) * c.a;
#endif
  result = c * opacity;
}`;

export class Painter {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { alpha: true, antialias: false, stencil: true, premultipliedAlpha: true });
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
    const { gl } = this;
    this.programs = [0, 1, 2, 3].map((kind) => this.#program((kind & 1 ? "#define BENT\n" : "") + (kind & 2 ? "#define CHANGED\n" : "")));
    this.square = [gl.createBuffer(), gl.createBuffer()];
    this.buffers = { at: gl.createBuffer(), uv: gl.createBuffer(), index: gl.createBuffer() };
    gl.bindBuffer(gl.ARRAY_BUFFER, this.square[0]);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.enableVertexAttribArray(1);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
  }

  /** Program for a kind of layer, so that each costs only what it needs. @param {string} defines */
  #program(defines) {
    const { gl } = this, program = /** @type {WebGLProgram} */ (gl.createProgram());
    for (const [kind, source] of /** @type {[number, string][]} */ ([[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT.replace("es\n", `es\n${defines}`)]])) {
      const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "at");
    gl.bindAttribLocation(program, 1, "uv");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) ?? "link");
    return { program, uniforms: Object.fromEntries(["row0", "row1", "colour", "opacity"].map((n) => [n, gl.getUniformLocation(program, n)])) };
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
    const { gl, canvas } = this;
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
      const { program, uniforms } = this.programs[(item.mesh ? 1 : 0) + (item.colour ? 2 : 0)];
      gl.useProgram(program);
      // The first one covers what is empty: nothing to mix it with.
      if (this.calls) gl.enable(gl.BLEND); else gl.disable(gl.BLEND);
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
      if (item.colour) {
        const m = item.colour;
        gl.uniformMatrix4fv(uniforms.colour, false, [m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0, m[3], m[7], m[11], 1]);
      }
      if (item.clip) this.#clip(item.clip, [sx, tx, sy, ty]);
      this.#shape(item.mesh);
      gl.disable(gl.STENCIL_TEST);
      this.calls++;
    }
  }

  /** Lets what is drawn next show in an outline alone. @param {number[][][]} paths @param {number[]} view scale and shift of x, then of y */
  #clip(paths, [sx, tx, sy, ty]) {
    const { gl, buffers } = this;
    gl.clear(gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.STENCIL_TEST);
    gl.colorMask(false, false, false, false);
    gl.stencilFunc(gl.ALWAYS, 0, 1);
    gl.stencilOp(gl.INVERT, gl.INVERT, gl.INVERT);
    const using = gl.getParameter(gl.CURRENT_PROGRAM), { program, uniforms } = this.programs[0];
    gl.useProgram(program);
    gl.uniform3f(uniforms.row0, sx, 0, tx);
    gl.uniform3f(uniforms.row1, 0, sy, ty);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.at);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    gl.vertexAttribPointer(1, 2, gl.FLOAT, false, 0, 0);
    for (const path of paths) {
      const points = new Float32Array(sampled(path));
      gl.bufferData(gl.ARRAY_BUFFER, points, gl.STREAM_DRAW);
      gl.drawArrays(gl.TRIANGLE_FAN, 0, points.length / 2);
    }
    gl.useProgram(using);
    gl.colorMask(true, true, true, true);
    gl.stencilFunc(gl.EQUAL, 1, 1);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.KEEP);
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

/** Whether there is a graphics card: software that plays one is slower than a 2-D canvas. */
export function accelerated() {
  const gl = document.createElement("canvas").getContext("webgl2", { failIfMajorPerformanceCaveat: true });
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl ? String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER)) : "software";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return !/swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/** The same with a 2-D canvas, where there is no graphics card. */
export class FlatPainter {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    this.calls = 0;
    /** @type {Map<string, HTMLCanvasElement>} */
    this.textures = new Map();
    /** The last changed colours of each texture. @type {Map<string, {colour: string, sheet: HTMLCanvasElement}>} */
    this.coloured = new Map();
  }

  /** @param {string} key */
  has(key) { return this.textures.has(key); }

  /** @param {string} key @param {{width: number, height: number, data: Uint8ClampedArray}} pixels */
  give(key, { width, height, data }) {
    const sheet = Object.assign(document.createElement("canvas"), { width, height });
    sheet.getContext("2d", { willReadFrequently: true })?.putImageData(new ImageData(/** @type {any} */ (data), width, height), 0, 0);
    this.drop(key);
    this.textures.set(key, sheet);
  }

  /** @param {string} key */
  drop(key) {
    this.textures.delete(key);
    this.coloured.delete(key);
  }

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
      const sheet = this.#sheet(item);
      if (!sheet) continue;
      c.globalAlpha = item.opacity;
      if (item.clip) {
        c.save();
        c.setTransform(base);
        c.clip(new Path2D(pathData(item.clip)), "evenodd");
      }
      c.setTransform(base.multiply(new DOMMatrix(item.matrix)));
      if (item.mesh) this.#bent(sheet, item.mesh);
      else c.drawImage(sheet, item.box[0], item.box[1], item.box[2], item.box[3]);
      if (item.clip) c.restore();
      this.calls++;
    }
    c.restore();
  }

  /** Texture of an item in its colours. @param {Item} item */
  #sheet({ key, colour: m }) {
    const sheet = this.textures.get(key), name = String(m);
    if (!m || !sheet) return sheet;
    const last = this.coloured.get(key);
    if (last?.colour === name) return last.sheet;
    const { width, height } = sheet, made = Object.assign(document.createElement("canvas"), { width, height });
    const image = sheet.getContext("2d")?.getImageData(0, 0, width, height), d = image?.data ?? [];
    for (let i = 0; i < d.length; i += 4) {
      const r = d[i], g = d[i + 1], b = d[i + 2];
      for (let k = 0; k < 3; k++) d[i + k] = m[4 * k] * r + m[4 * k + 1] * g + m[4 * k + 2] * b + 255 * m[4 * k + 3];
    }
    if (image) made.getContext("2d")?.putImageData(image, 0, 0);
    this.coloured.set(key, { colour: name, sheet: made });
    return made;
  }

  /** Fills triangle after triangle, each a little larger so that no seams show. */
  #bent(sheet, { positions, uvs, triangles }) {
    const { context: c } = this, { width, height } = sheet, grow = 0.4;
    const pattern = /** @type {CanvasPattern} */ (c.createPattern(sheet, "no-repeat")), place = new DOMMatrix();
    c.fillStyle = pattern;
    for (let t = 0; t < triangles.length; t += 3) {
      const i = 2 * triangles[t], j = 2 * triangles[t + 1], k = 2 * triangles[t + 2];
      const u0 = uvs[i] * width, v0 = uvs[i + 1] * height;
      const ux = uvs[j] * width - u0, uy = uvs[j + 1] * height - v0, vx = uvs[k] * width - u0, vy = uvs[k + 1] * height - v0;
      const det = ux * vy - vx * uy;
      if (!det) continue;
      const x = positions[i], y = positions[i + 1], px = positions[j] - x, py = positions[j + 1] - y, qx = positions[k] - x, qy = positions[k + 1] - y;
      place.a = (px * vy - qx * uy) / det;
      place.b = (py * vy - qy * uy) / det;
      place.c = (qx * ux - px * vx) / det;
      place.d = (qy * ux - py * vx) / det;
      place.e = x - place.a * u0 - place.c * v0;
      place.f = y - place.b * u0 - place.d * v0;
      pattern.setTransform(place);
      const mx = x + (px + qx) / 3, my = y + (py + qy) / 3;
      c.beginPath();
      for (const n of [i, j, k]) {
        const dx = positions[n] - mx, dy = positions[n + 1] - my, f = 1 + grow / (Math.abs(dx) + Math.abs(dy) + 1e-6);
        if (n === i) c.moveTo(mx + f * dx, my + f * dy); else c.lineTo(mx + f * dx, my + f * dy);
      }
      c.fill();
    }
  }
}
