/** What can be changed of what is selected, with the tool in use. */
import { choose, commit, edit, textureFrom } from "../actions.js";
import { button, h, number, slider } from "../dom.js";
import { about, recoloured, rotation } from "../matrix.js";
import * as scene from "../scene.js";
import { draw } from "../stage.js";
import { ancestors, layerOf, moved, on, single, store, targets } from "../store.js";
import { anchor, chosenSmooth, setSmooth } from "../tools/points.js";
import { chosen, pins, turn, unpin } from "../tools/pins.js";
import { frameOf, transform } from "../tools/select.js";
import { pointing } from "./pointing.js";

export const root = h("div", { class: "properties" });

/** @param {string} title @param {...any} children */
export const section = (title, ...children) => h("section", {}, h("h3", {}, title), ...children);
const note = (/** @type {string} */ text) => h("p", { class: "note" }, text);

/** Angle and slant of a matrix, in degrees. @param {number[]} m */
function angles([a, b, c, d]) {
  const turned = (Math.atan2(b, a) * 180) / Math.PI;
  const slant = (Math.atan2(a * c + b * d, a * d - b * c) * 180) / Math.PI;
  return { turned, slant };
}

function place() {
  const layers = moved(targets());
  const edge = (/** @type {number} */ i) => (i < 2 ? Math.min : Math.max)(...layers.map((l) => l.bounds[i]));
  const [x0, y0, x1, y1] = [edge(0), edge(1), edge(2), edge(3)], layer = single();
  const pivot = [x0, y0].map((v) => Number(v.toFixed(2))), middle = [(x0 + x1) / 2, (y0 + y1) / 2].map((v) => Number(v.toFixed(2)));
  const { turned, slant } = angles(layer?.matrix ?? [1, 0, 0, 1, 0, 0]);
  const move = (/** @type {number} */ dx, /** @type {number} */ dy) => { if (dx || dy) transform({ op: "move", by: [dx, dy] }, [1, 0, 0, 1, dx, dy]); };
  const scale = (/** @type {number} */ fx, /** @type {number} */ fy) => { if (fx > 0 && fy > 0) transform({ op: "scale", by: [fx, fy], pivot }, about([fx, 0, 0, fy, 0, 0], pivot[0], pivot[1])); };
  const flip = (/** @type {string} */ axis) => transform({ op: "flip", axis, pivot: middle }, about(axis === "horizontal" ? [-1, 0, 0, 1, 0, 0] : [1, 0, 0, -1, 0, 0], middle[0], middle[1]));
  return section("Place",
    h("div", { class: "grid" },
      number({ label: "X", value: x0, title: "Left edge in pixels", onchange: (v) => move(v - x0, 0) }),
      number({ label: "Y", value: y0, title: "Upper edge in pixels", onchange: (v) => move(0, v - y0) }),
      number({ label: "W", value: x1 - x0, title: "Width in pixels", onchange: (v) => scale(v / (x1 - x0), 1) }),
      number({ label: "H", value: y1 - y0, title: "Height in pixels", onchange: (v) => scale(1, v / (y1 - y0)) }),
      number({ label: "\u2220", value: turned, unit: "\u00b0", title: "Angle, clockwise", onchange: (v) => transform({ op: "rotate", degrees: Number((v - turned).toFixed(3)), pivot: middle }, about(rotation(v - turned), middle[0], middle[1])) }),
      number({ label: "\u25b1", value: -slant, unit: "\u00b0", title: "Slant", onchange: (v) => { const by = Math.tan((Math.max(-80, Math.min(80, v)) * Math.PI) / 180) + Math.tan((slant * Math.PI) / 180); transform({ op: "shear", by: [Number((-by).toFixed(5)), 0], pivot: middle }, about([1, 0, -by, 1, 0, 0], middle[0], middle[1])); } })),
    h("div", { class: "bar" },
      button({ icon: "flip-horizontal", label: "Mirror left and right", onclick: () => flip("horizontal") }),
      button({ icon: "flip-vertical", label: "Mirror up and down", onclick: () => flip("vertical") })));
}

const CHANGE = { hue: 0, saturation: 1, brightness: 1, tint: /** @type {string|null} */ (null) };

function colour() {
  const names = [...store.selected].flatMap((n) => (layerOf(n) ? [n] : moved([n]).map((l) => l.name)));
  const layers = names.map((n) => layerOf(n)).filter((l) => l !== undefined);
  const change = { ...CHANGE };
  const show = () => {
    for (const layer of layers) scene.preview.set(layer.name, { ...scene.preview.get(layer.name), colour: recoloured(change, layer.colour) });
    draw();
  };
  const keep = () => {
    const what = Object.fromEntries(Object.entries(change).filter(([k, v]) => v !== CHANGE[/** @type {keyof typeof CHANGE} */ (k)]));
    if (Object.keys(what).length) commit([...store.selected].map((layer) => ({ op: "recolour", layer, ...what })), names);
    else { for (const n of names) scene.preview.delete(n); draw(); }
  };
  const one = (/** @type {"hue"|"saturation"|"brightness"} */ key, /** @type {any} */ how) => slider({ label: how.label, min: how.min, max: how.max, step: how.step, unit: how.unit, value: CHANGE[key], neutral: CHANGE[key], oninput: (v) => { change[key] = v; show(); }, onchange: keep });
  const opacity = slider({
    label: "Opacity", min: 0, max: 100, unit: "\u2009%", value: 100 * (layers[0]?.opacity ?? 1), neutral: 100,
    oninput: (v) => { for (const l of layers) scene.preview.set(l.name, { ...scene.preview.get(l.name), opacity: v / 100 }); draw(); },
    onchange: (v) => commit([...store.selected].map((layer) => ({ op: "opacity", layer, value: v / 100 })), names),
  });
  const tint = h("input", { type: "color", value: "#3070c0", id: "tint", oninput: (/** @type {any} */ e) => { change.tint = e.target.value; show(); }, onchange: keep });
  return section("Colour", opacity,
    one("hue", { label: "Hue", min: -180, max: 180, unit: "\u00b0" }),
    one("saturation", { label: "Saturation", min: 0, max: 2, step: 0.05 }),
    one("brightness", { label: "Brightness", min: 0.2, max: 2, step: 0.05 }),
    h("div", { class: "line" }, h("label", { for: "tint" }, "Tint"), tint));
}

/** @param {string} label @param {[string, string][]} options @param {string} value @param {(v: string) => void} onchange */
export function select(label, options, value, onchange) {
  const id = `c-${label.replace(/\W/g, "")}`;
  return h("div", { class: "line" }, h("label", { for: id }, label),
    h("span", { class: "choice" }, h("select", { id, onchange: (/** @type {any} */ e) => onchange(e.target.value) }, ...options.map(([v, text]) => h("option", { value: v, selected: v === value }, text)))));
}

function structure() {
  const layer = single();
  if (!layer) return null;
  const others = store.state.layers.filter((/** @type {any} */ l) => l.name !== layer.name);
  const leaders = [...others, ...store.state.groups].filter((l) => !ancestors(l.name).includes(layer.name));
  const texture = (/** @type {string} */ v) => {
    if (v === "*") choose("image/*,.pxi", (file) => textureFrom(layer.name, file));
    else if (v) edit([{ op: "texture", layer: layer.name, source: v }]);
  };
  return section("Structure",
    select("Follows", [["", "Nothing"], ...leaders.map((l) => /** @type {[string, string]} */ ([l.name, l.name]))], layer.parent ?? "", (v) => edit([{ op: "parent", layer: layer.name, to: v }])),
    select("Texture", [["", "Its own"], ...others.map((/** @type {any} */ l) => [l.name, `From ${l.name}`]), ["*", "From a picture\u2026"]], "", texture));
}

function pinned() {
  const layer = single();
  if (!layer) return section("Puppet pins", note("Choose a layer: click it on the canvas or in the list."));
  const mine = pins.get(layer.name) ?? [], pin = mine[chosen.pin];
  const most = Math.round(Math.hypot(layer.bounds[2] - layer.bounds[0], layer.bounds[3] - layer.bounds[1]) / 3);
  return section("Puppet pins",
    mine.length ? null : note("Click on the layer to set pins. One pin moves it; with two or more, dragging one bends it and the others hold."),
    pin && slider({ label: "Weight", min: 0, max: most, unit: " px", value: pin.reach, oninput: (v) => { pin.reach = v; draw(); } }),
    pin && slider({ label: "Turn", min: -180, max: 180, unit: "\u00b0", value: 0, onchange: (v) => turn(v) }),
    h("label", { class: "check" }, h("input", { type: "checkbox", checked: chosen.mesh, onchange: (/** @type {any} */ e) => { chosen.mesh = e.target.checked; draw(); } }), "Show the mesh"),
    h("div", { class: "bar" },
      pin && button({ text: "Take away", icon: "x", onclick: () => unpin(chosen.pin) }),
      mine.length ? button({ text: `Clear ${mine.length}`, icon: "trash-2", onclick: () => unpin() }) : null));
}

function points() {
  const layer = single();
  if (!layer) return section("Outline", note("Choose a layer: click it on the canvas or in the list."));
  const smooth = chosenSmooth();
  return section("Outline",
    smooth === null ? note(layer.paths?.length ? `${layer.paths.reduce((a, b) => a + b, 0)} points in ${layer.paths.length} ${layer.paths.length === 1 ? "path" : "paths"}. Click one.` : "This layer covers the canvas; it has no outline.") : h("div", { class: "segments", role: "group", "aria-label": "Kind of point" },
      button({ text: "Smooth", pressed: smooth, onclick: () => setSmooth(true) }), button({ text: "Corner", pressed: !smooth, onclick: () => setSmooth(false) })),
    h("label", { class: "check" }, h("input", { type: "checkbox", checked: anchor.follow, onchange: (/** @type {any} */ e) => { anchor.follow = e.target.checked; } }), "The inside goes along"));
}

function picture() {
  const { state } = store;
  return section("Picture",
    h("dl", {}, h("dt", {}, "Canvas"), h("dd", {}, `${state.size[0]} \u00d7 ${state.size[1]}`), h("dt", {}, "Layers"), h("dd", {}, String(state.layers.length)), h("dt", {}, "Edits"), h("dd", {}, String(state.at))),
    note("Click something on the canvas to change it."));
}

function build() {
  const { state, tool } = store;
  if (root.contains(document.activeElement) && /** @type {any} */ (document.activeElement).type === "range" && scene.preview.size) return;
  const parts = state.stage === "pointing" ? pointing()
    : tool === "pins" ? [pinned()] : tool === "points" ? [points()]
    : store.selected.size && frameOf() ? [place(), colour(), structure()] : state.stage === "editing" ? [picture()] : [];
  const name = (/** @type {any} */ e) => e?.labels?.[0]?.textContent ?? null;
  const focused = root.contains(document.activeElement) ? name(document.activeElement) : null;
  root.replaceChildren(...parts.filter(Boolean));
  if (focused) /** @type {any} */ ([...root.querySelectorAll("input, select")].find((e) => name(e) === focused))?.focus();
}

on("state selection tool pins framed", build);
