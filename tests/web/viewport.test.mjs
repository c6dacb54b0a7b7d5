/** The geometry of the viewer: `node --test`. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { fit, panned, placed, visible, zoomed } from "../../web/viewport.js";

const picture = { width: 300, height: 100 };
const screen = { width: 600, height: 400 };

test("a picture fits into the middle", () => {
  assert.deepEqual(fit(picture, screen), { scale: 2, x: 0, y: -50 });
  assert.deepEqual(placed(fit(picture, screen), [0, 0, 300, 100]), {
    x: 0, y: 100, width: 600, height: 200,
  });
});

test("zooming keeps the point under the pointer", () => {
  const before = fit(picture, screen);
  const after = zoomed(before, 1.7, 123, 210, picture);
  assert.ok(Math.abs(before.x + 123 / before.scale - (after.x + 123 / after.scale)) < 1e-9);
  assert.ok(Math.abs(before.y + 210 / before.scale - (after.y + 210 / after.scale)) < 1e-9);
  assert.equal(after.scale, 3.4);
});

test("zooming ends where a pixel fills the screen, or the picture is a speck", () => {
  assert.equal(zoomed({ scale: 200, x: 0, y: 0 }, 2, 0, 0, picture).scale, 256);
  assert.equal(zoomed({ scale: 0.1, x: 0, y: 0 }, 0.01, 0, 0, picture).scale, 16 / 300);
});

test("panning moves by screen pixels", () => {
  assert.deepEqual(panned({ scale: 4, x: 10, y: 20 }, 8, -4), { scale: 4, x: 8, y: 21 });
});

test("only what is on the screen is rendered, in whole canvas pixels", () => {
  const view = { scale: 10, x: 250.5, y: 30.2 };
  assert.deepEqual(visible(view, picture, screen, 1), {
    region: [250, 30, 50, 41], width: 500, height: 410,
  });
  assert.deepEqual(visible(view, picture, screen, 0.5), {
    region: [250, 30, 50, 41], width: 250, height: 205,
  });
  assert.equal(visible({ ...view, x: 400 }, picture, screen, 1), null);
});
