/** Points at things in a raster: click, box, scribble, brush and eraser make, extend and split regions. */
import { regions, say } from "../actions.js";
import { h, s } from "../dom.js";
import { backdrops, draw, placed, root, tools, view } from "../stage.js";
import { hover, on, select, store } from "../store.js";

export const brush = { radius: 12 };

/** Colours of regions, readable on most pictures. */
const COLOURS = ["#5b9dff", "#ffb03a", "#3fd08a", "#ff6f91", "#b98cff", "#39cfd8", "#f3e04c", "#ff8a4c", "#9ad94a", "#e98be0"];

/** @param {any} region */
export const colourOf = (region) => (region.back ? "#9aa0a8" : COLOURS[(region.index - 1 + COLOURS.length) % COLOURS.length]);

const regionOf = (/** @type {string|null} */ name) => (store.state.regions ?? []).find((/** @type {any} */ r) => r.name === name);

/** The region that is extended by what is done now, or undefined: never the back. */
const current = () => { const region = store.selected.size === 1 ? regionOf([...store.selected][0]) : undefined; return region?.back ? undefined : region; };

/** @type {{version: number, shapes: {region: any, d: string, path: Path2D}[]}} */
let cache = { version: -1, shapes: [] };
const pen = /** @type {CanvasRenderingContext2D} */ (document.createElement("canvas").getContext("2d"));

/** Points of a polygon along the borders of pixels, with its corners cut so that stairs become slopes. @param {number[]} flat */
function rounded(flat) {
  const n = flat.length, out = [];
  for (let i = 0; i < n; i += 2) {
    const x = flat[i], y = flat[i + 1];
    for (const j of [(i + n - 2) % n, (i + 2) % n]) {
      const dx = flat[j] - x, dy = flat[j + 1] - y, part = Math.min(0.5, 1 / (Math.hypot(dx, dy) || 1));
      out.push(`${(x + part * dx).toFixed(2)} ${(y + part * dy).toFixed(2)}`);
    }
  }
  return out;
}

function shapes() {
  const { state } = store;
  if (cache.version !== state.version) {
    cache = { version: state.version, shapes: (state.regions ?? []).map((/** @type {any} */ region) => {
      const d = region.outline.map((/** @type {number[][]|number[]} */ ring) => {
        return `M${rounded(/** @type {any} */ (ring).flat()).join("L")}Z`;
      }).join("");
      return { region, d, path: new Path2D(d) };
    }) };
  }
  return cache.shapes;
}

/** Front region at a point. @param {number} x @param {number} y */
function hit(x, y) {
  const found = [...shapes()].reverse().find(({ path, region }) => !region.back && pen.isPointInPath(path, x, y, "evenodd"));
  return found?.region ?? regionOf("back") ?? store.state.regions?.find((/** @type {any} */ r) => r.back);
}

backdrops.push((add) => {
  if (store.state.stage !== "pointing") return;
  const group = s("g", { transform: placed() });
  for (const { region, d } of shapes()) {
    if (region.back) continue;
    const colour = colourOf(region), chosen = store.selected.has(region.name), over = store.hovered === region.name;
    const fill = chosen ? 0.22 : over ? 0.3 : 0.1;
    group.append(s("path", { d, "fill-rule": "evenodd", fill: colour, "fill-opacity": fill, class: "region-under" }));
    group.append(s("path", { d, class: `region${chosen ? " on" : ""}`, stroke: colour }));
  }
  add(group);
});

const at = (/** @type {any} */ p) => {
  const [w, h] = store.state.size, clamp = (/** @type {number} */ v, /** @type {number} */ n) => Math.min(n - 0.5, Math.max(0.5, v));
  return [Number(clamp(p.x, w).toFixed(1)), Number(clamp(p.y, h).toFixed(1))];
};

/** Sends hints for the chosen region, or for a new one whose name is asked for. @param {any} hints @param {boolean} fresh */
async function prompt(hints, fresh) {
  const region = fresh ? undefined : current();
  const before = new Set(store.state.regions.map((/** @type {any} */ r) => r.name));
  const state = await regions("point", { name: region?.name ?? null, inside: [], outside: [], box: null, strokes: [], radius: brush.radius / 2, ...hints });
  if (state && !region) named(state, before);
}

/** Selects the region that is new, and asks for its name. @param {any} state @param {Set<string>} before */
function named(state, before) {
  const made = state.regions.find((/** @type {any} */ r) => !before.has(r.name));
  if (!made) return;
  select([made.name]);
  ask(made);
}

/** A field for the name, at the region. @param {any} region */
function ask(region) {
  root.querySelector(".christen")?.remove();
  const [x, y] = view.toScreen((region.bounds[0] + region.bounds[2]) / 2, region.bounds[1]);
  let over = false;
  const done = (/** @type {boolean} */ keep) => {
    if (over) return;
    over = true;
    const value = input.value.trim();
    box.remove();
    if (keep && value && value !== region.name) regions("rename", { name: region.name, to: value }).then((state) => { if (state) select([value]); });
  };
  const input = h("input", {
    value: region.name, "aria-label": "Name of the new layer", spellcheck: false, maxLength: 100, autocomplete: "off",
    onblur: () => done(true),
    onkeydown: (/** @type {KeyboardEvent} */ e) => { e.stopPropagation(); if (e.key === "Enter") { done(true); root.focus(); } if (e.key === "Escape") { done(false); root.focus(); } },
  });
  const box = h("label", { class: "christen float", style: `left:${Math.max(90, Math.min(view.width - 90, x))}px;top:${Math.max(44, y)}px` }, h("span", {}, "Name"), input);
  root.append(box);
  input.focus();
  input.select();
}

/** @type {null | {start: any, now: any, stroke: number[][], how: string}} */
let work = null;

/** A tool that draws strokes. @param {string} how @param {(stroke: number[][], e: any) => void} done */
function stroking(how, done) {
  return {
    cursor: "none",
    down: (/** @type {any} */ p) => { work = { start: p, now: p, stroke: [at(p)], how }; },
    drag: (/** @type {any} */ p) => { if (work) { work.now = p; const [x, y] = at(p), [u, v] = work.stroke[work.stroke.length - 1]; if (Math.hypot(x - u, y - v) > 1) work.stroke.push([x, y]); } },
    up: (/** @type {any} */ _p, /** @type {any} */ e) => { const w = work; work = null; if (w) done(w.stroke.length > 1 ? w.stroke : [...w.stroke, ...w.stroke], e); draw(); },
    escape: () => { const was = Boolean(work); work = null; draw(); return was; },
    hover: (/** @type {any} */ p) => { work = null; pointer = p; draw(); return "none"; },
    overlay: (/** @type {(node: any) => void} */ add) => {
      const radius = how === "scribble" ? brush.radius / 2 : brush.radius, p = work?.now ?? pointer;
      if (work) {
        const region = current(), colour = how === "erase" ? "#ffffff" : region ? colourOf(region) : "var(--accent)";
        add(s("polyline", { points: work.stroke.map(([x, y]) => view.toScreen(x, y).join(",")).join(" "), class: "stroke", stroke: colour, "stroke-width": 2 * radius * view.scale }));
      }
      if (p) {
        add(s("circle", { cx: p.sx, cy: p.sy, r: Math.max(2, radius * view.scale), class: "brush under" }));
        add(s("circle", { cx: p.sx, cy: p.sy, r: Math.max(2, radius * view.scale), class: "brush" }));
      }
    },
  };
}
/** @type {any} */
let pointer = null;
on("pointer", (p) => { pointer = p; if (!p) draw(); });

const over = (/** @type {any} */ p) => { const region = hit(p.x, p.y); hover(region?.back ? null : region?.name ?? null); return region; };

tools.point = {
  id: "point", label: "Point", icon: "crosshair", keys: "P",
  hint: "Click a thing to make it a layer \u00b7 Shift-click adds to the chosen one, Alt-click takes away",
  cursor: "crosshair",
  up(p, e) {
    const region = hit(p.x, p.y), mine = current();
    if (e.shiftKey && mine) return prompt({ inside: [at(p)] }, false);
    if (e.altKey && mine) return prompt({ outside: [at(p)] }, false);
    if (region && !region.back) return select([region.name]);
    if (p.x < 0 || p.y < 0 || p.x > store.state.size[0] || p.y > store.state.size[1]) return select([]);
    return prompt({ inside: [at(p)] }, true);
  },
  hover(p) { over(p); return "crosshair"; },
  overlay(add) {
    const marks = current()?.prompt;
    for (const [list, kind] of /** @type {[number[][], string][]} */ ([[marks?.inside ?? [], "in"], [marks?.outside ?? [], "out"]])) {
      for (const q of list) { const [x, y] = view.toScreen(q[0], q[1]); add(s("circle", { cx: x, cy: y, r: 4.5, class: `mark ${kind}` })); }
    }
  },
};

tools.box = {
  id: "box", label: "Box", icon: "square-dashed", keys: "R", hint: "Draw a box around a thing \u00b7 Shift: for the chosen one", cursor: "crosshair",
  down(p) { work = { start: p, now: p, stroke: [], how: "box" }; },
  drag(p) { if (work) work.now = p; },
  up(p, e) {
    const w = work;
    work = null;
    draw();
    if (!w || Math.hypot(p.sx - w.start.sx, p.sy - w.start.sy) < 6) return;
    const a = at(w.start), b = at(p), x = Math.min(a[0], b[0]), y = Math.min(a[1], b[1]);
    prompt({ box: [x, y, Math.abs(a[0] - b[0]), Math.abs(a[1] - b[1])].map((v) => Math.round(v * 10) / 10) }, !e.shiftKey);
  },
  escape() { const was = Boolean(work); work = null; draw(); return was; },
  hover(p) { over(p); return "crosshair"; },
  overlay(add) {
    if (!work) return;
    const box = { x: Math.min(work.start.sx, work.now.sx), y: Math.min(work.start.sy, work.now.sy), width: Math.abs(work.start.sx - work.now.sx), height: Math.abs(work.start.sy - work.now.sy) };
    add(s("rect", { ...box, class: "under" }));
    add(s("rect", { ...box, class: "rubber" }));
  },
};

tools.scribble = {
  id: "scribble", label: "Scribble", icon: "activity", keys: "S",
  hint: "Scribble over a thing: its edges are found \u00b7 Shift adds to the chosen one, Alt takes away",
  ...stroking("scribble", (stroke, e) => (e.altKey && current() ? prompt({ outside: stroke.filter((_, i) => i % 4 === 0).slice(0, 40) }, false) : prompt({ strokes: [stroke] }, !e.shiftKey))),
};

tools.brush = {
  id: "brush", label: "Brush", icon: "brush", keys: "B", hint: "Paint exactly these pixels into the chosen layer",
  ...stroking("paint", (stroke) => paint(stroke, false)),
};

tools.eraser = {
  id: "eraser", label: "Eraser", icon: "eraser", keys: "E", hint: "Take exactly these pixels out of the chosen layer",
  ...stroking("erase", (stroke) => paint(stroke, true)),
};

/** @param {number[][]} stroke @param {boolean} erase */
function paint(stroke, erase) {
  const region = current() ?? (erase ? hit(stroke[0][0], stroke[0][1]) : null);
  if (!region || region.back) return say(erase ? "Choose the layer to erase from: click it in the list." : "Choose the layer to paint into: click it in the list, or point at a thing first.");
  regions("paint", { name: region.name, strokes: [stroke], radius: brush.radius, erase });
}

tools.split = {
  id: "split", label: "Split", icon: "scissors", keys: "X", hint: "Click a part of a layer: it becomes a layer of its own", cursor: "crosshair",
  async up(p) {
    const region = hit(p.x, p.y);
    if (!region || region.back) return;
    const before = new Set(store.state.regions.map((/** @type {any} */ r) => r.name));
    const state = await regions("split", { name: region.name, inside: [at(p)], outside: [], to: null });
    if (state) named(state, before);
  },
  hover(p) { over(p); return "crosshair"; },
};

tools.hand = { id: "hand", label: "Hand", icon: "hand", keys: "H", hint: "Drag to move the view \u00b7 the space bar does it with every tool", cursor: "grab" };

on("view state", () => root.querySelector(".christen input:not(:focus)")?.parentElement?.remove());
