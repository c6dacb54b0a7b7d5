/** Where the canvas of the picture lies in the window: scale, and the place of its origin, in CSS pixels. */
export class Viewport {
  scale = 1;
  x = 0;
  y = 0;
  width = 1;
  height = 1;
  /** Whether the picture is kept as large as fits. */
  fitting = true;

  /** @param {number} x @param {number} y in the window @returns {[number, number]} on the canvas */
  toCanvas(x, y) { return [(x - this.x) / this.scale, (y - this.y) / this.scale]; }

  /** @param {number} x @param {number} y on the canvas @returns {[number, number]} in the window */
  toScreen(x, y) { return [x * this.scale + this.x, y * this.scale + this.y]; }

  /** Makes the picture as large as fits. @param {number[]} size @param {number} margin */
  fit([w, h], margin = 40) {
    const space = Math.min(margin, this.width * 0.06, this.height * 0.06);
    this.scale = Math.max(0.01, Math.min((this.width - 2 * space) / w, (this.height - 2 * space) / h, 8));
    this.x = Math.round((this.width - w * this.scale) / 2);
    this.y = Math.round((this.height - h * this.scale) / 2);
    this.fitting = true;
  }

  /** Zooms so that the point of the canvas under (x, y) stays there. @param {number} factor @param {number} x @param {number} y */
  zoom(factor, x = this.width / 2, y = this.height / 2) {
    const scale = Math.min(64, Math.max(0.02, this.scale * factor));
    this.x = x - ((x - this.x) * scale) / this.scale;
    this.y = y - ((y - this.y) * scale) / this.scale;
    this.scale = scale;
    this.fitting = false;
  }

  /** @param {number} dx @param {number} dy */
  pan(dx, dy) {
    this.x += dx;
    this.y += dy;
    this.fitting = false;
  }

  /** Part of the canvas that is seen, or null. @param {number[]} size @returns {[number, number, number, number]|null} x, y, width, height */
  seen([w, h]) {
    const [x0, y0] = this.toCanvas(0, 0), [x1, y1] = this.toCanvas(this.width, this.height);
    const left = Math.max(0, Math.floor(x0)), top = Math.max(0, Math.floor(y0));
    const right = Math.min(w, Math.ceil(x1)), bottom = Math.min(h, Math.ceil(y1));
    return right > left && bottom > top ? [left, top, right - left, bottom - top] : null;
  }
}
