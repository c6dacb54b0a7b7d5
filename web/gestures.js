/** What hands do to the view: mouse and touch on a canvas, and keys. */

import { panned, zoomed } from "./viewport.js";

const STEP = 64; // screen pixels that an arrow moves
const FACTOR = 1.25; // that a key zooms

/**
 * Listens to a canvas. `view()` is the present view, or null without a picture; `move(view)` takes another;
 * `picture()` is {width, height}.
 */
export function listen(canvas, { view, move, picture }) {
  const zoom = (factor, x, y) => move(zoomed(view(), factor, x, y, picture()));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 16 : 1;
    if (view()) zoom(Math.exp(-event.deltaY * lines * 0.002), event.offsetX, event.offsetY);
  }, { passive: false });
  const hands = new Map(); // fingers, or the mouse, on the canvas: [x, y]
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    hands.set(event.pointerId, [event.offsetX, event.offsetY]);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, ({ pointerId }) => hands.delete(pointerId));
  }
  canvas.addEventListener("pointermove", ({ pointerId, offsetX, offsetY }) => {
    if (!hands.has(pointerId)) return;
    const before = span(hands);
    hands.set(pointerId, [offsetX, offsetY]);
    const after = span(hands);
    if (!view()) return;
    const near = panned(view(), after.x - before.x, after.y - before.y);
    const factor = hands.size > 1 ? after.length / before.length : 1;
    move(zoomed(near, factor, after.x, after.y, picture()));
  });
  addEventListener("keydown", (event) => {
    const taken = event.ctrlKey || event.metaKey || event.altKey || event.target.closest?.("input, button");
    if (!view() || taken) return;
    const [x, y] = [canvas.clientWidth / 2, canvas.clientHeight / 2];
    const keys = {
      ArrowLeft: () => move(panned(view(), STEP, 0)), ArrowRight: () => move(panned(view(), -STEP, 0)),
      ArrowUp: () => move(panned(view(), 0, STEP)), ArrowDown: () => move(panned(view(), 0, -STEP)),
      "+": () => zoom(FACTOR, x, y), "=": () => zoom(FACTOR, x, y), "-": () => zoom(1 / FACTOR, x, y),
      1: () => zoom(1 / view().scale, x, y),
    };
    if (!Object.hasOwn(keys, event.key)) return;
    event.preventDefault();
    keys[event.key]();
  });
}

/** The middle of the first two hands, and how far they are apart in screen pixels. */
function span(hands) {
  const [[x, y], [u, v] = [x, y]] = hands.values();
  return { x: (x + u) / 2, y: (y + v) / 2, length: Math.max(Math.hypot(x - u, y - v), 1) };
}
