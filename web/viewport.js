/**
 * Which part of a picture the screen shows: a view {scale, x, y} has `scale` screen pixels a canvas
 * pixel, and the canvas point (x, y) in the upper left corner of the screen.
 */

const SCALE_MAX = 256;

/** The view that shows all of a picture in the middle of the screen; both {width, height}. */
export function fit(picture, screen) {
  const scale = Math.min(screen.width / picture.width, screen.height / picture.height);
  return {
    scale,
    x: (picture.width - screen.width / scale) / 2,
    y: (picture.height - screen.height / scale) / 2,
  };
}

/** Zooms so that what is at the screen point (x, y) stays there. */
export function zoomed(view, factor, x, y, picture) {
  const least = 16 / Math.max(picture.width, picture.height);
  const scale = Math.min(Math.max(view.scale * factor, least), SCALE_MAX);
  return {
    scale,
    x: view.x + x / view.scale - x / scale,
    y: view.y + y / view.scale - y / scale,
  };
}

/** Moves the picture by screen pixels. */
export function panned(view, dx, dy) {
  return { ...view, x: view.x - dx / view.scale, y: view.y - dy / view.scale };
}

/** Where a region of the canvas lies on the screen: {x, y, width, height}. */
export function placed(view, [x, y, w, h]) {
  const { scale } = view;
  return { x: (x - view.x) * scale, y: (y - view.y) * scale, width: w * scale, height: h * scale };
}

/**
 * What to render: {region, width, height}, or null if the picture is not on the screen.
 *
 * Regions are whole canvas pixels, so it may reach a little beyond the screen. `detail` is output
 * pixels a screen pixel.
 */
export function visible(view, picture, screen, detail) {
  const axis = (from, length, size) => {
    const first = Math.max(Math.floor(from), 0);
    return [first, Math.min(Math.ceil(from + length / view.scale), size) - first];
  };
  const [x, w] = axis(view.x, screen.width, picture.width);
  const [y, h] = axis(view.y, screen.height, picture.height);
  if (w < 1 || h < 1) return null;
  const pixels = (size) => Math.max(Math.round(size * view.scale * detail), 1);
  return { region: [x, y, w, h], width: pixels(w), height: pixels(h) };
}
