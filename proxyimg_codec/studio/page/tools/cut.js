/** Makes a part of a layer a layer of its own, where one points. */
import { edit } from "../actions.js";
import * as scene from "../scene.js";
import { draw, tools } from "../stage.js";
import { hover, select, single, store } from "../store.js";
import { outlineNodes } from "./select.js";

tools.cut = {
  id: "cut", label: "Cut a part out", icon: "scissors", keys: "C", cursor: "crosshair",
  hint: "Click a part of a layer: it becomes a layer of its own, and moves by itself",
  async up(p) {
    const layer = single()?.name ?? scene.hit(p.x, p.y) ?? store.state.layers[0]?.name;
    if (!layer) return;
    const before = new Set(store.state.layers.map((/** @type {any} */ l) => l.name));
    const state = await edit([{ op: "cut", layer, points: [[Number(p.x.toFixed(1)), Number(p.y.toFixed(1))]] }]);
    const made = state?.layers.find((/** @type {any} */ l) => !before.has(l.name));
    if (made) select([made.name]);
  },
  hover(p) {
    const name = scene.hit(p.x, p.y);
    hover(name);
    if (name) scene.outlineOf(name).then(draw, () => {});
  },
  overlay(add) { outlineNodes(add, false); },
};
