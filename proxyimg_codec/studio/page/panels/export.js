/** Export, in place: what kind, how large, and the finished file. */
import { act, cancel } from "../actions.js";
import { button, h, number, size, slider } from "../dom.js";
import { post } from "../server.js";
import { on, store } from "../store.js";

/** @type {[string, string, string, "picture"|"layers"|"clip"][]} */
const KINDS = [
  ["png", "PNG", "A picture at any size, without loss.", "picture"], ["jpg", "JPEG", "A picture at any size, small.", "picture"],
  ["webp", "WebP", "A picture at any size, small, with transparency.", "picture"], ["tif", "TIFF", "A picture for print.", "picture"],
  ["pxi", "PXI", "Layers, editable, with the history.", "layers"], ["ora", "ORA", "Layers for Krita, GIMP and MyPaint.", "layers"],
  ["psd", "PSD", "Layers for Photoshop, Affinity and Photopea.", "layers"],
  ["svg", "SVG", "Outlines of the layers.", "layers"], ["html", "HTML", "A page of its own that shows the picture without a network.", "layers"],
  ["mp4", "MP4", "A clip.", "clip"], ["webm", "WebM", "A clip with transparency.", "clip"], ["gif", "GIF", "A clip that plays everywhere.", "clip"],
  ["webp-clip", "WebP", "A clip, small, with transparency.", "clip"], ["apng", "APNG", "A clip without loss.", "clip"],
];
const SORTS = { picture: "Picture", layers: "Layers and pages", clip: "Clip" };
const chosen = { kind: "png", width: 0, quality: 90, fps: 24, baked: false, purged: false };

export const root = h("div", { class: "popover export float", hidden: true, role: "region", "aria-label": "Export" });
/** @type {string|null} */
let job = null;
/** @type {any} */
let progress = null;

export function toggle(open = root.hidden) {
  root.hidden = !open;
  document.getElementById("export")?.setAttribute("aria-expanded", String(open));
  if (open) { build(); root.querySelector("[aria-pressed=true]")?.focus(); }
}

function build() {
  if (root.hidden || store.state.stage !== "editing") { root.hidden = true; return; }
  const [kind, title, meaning, sort] = /** @type {any} */ (KINDS.find(([k]) => k === chosen.kind));
  const moves = store.state.timeline, [w, hh] = store.state.size;
  const kinds = Object.entries(SORTS).flatMap(([name, heading]) => [h("h3", {}, heading), h("div", { class: "kinds", role: "group", "aria-label": heading },
    ...KINDS.filter(([, , , s]) => s === name).map(([k, text, , s]) => button({
      text, class: "kind", pressed: k === kind, disabled: s === "clip" && !moves, label: s === "clip" && !moves ? "Animate the picture first, and keep the motion" : undefined,
      onclick: () => { chosen.kind = k; build(); },
    })))]);
  const sized = sort === "picture" || sort === "clip";
  const width = chosen.width || w, sides = /** @type {[string, number, string][]} */ ([["W", w, "Width in pixels"], ["H", hh, "Height in pixels"]]);
  const sizing = h("div", {},
    h("div", { class: "grid" }, ...sides.map(([label, side, title]) => number({ label, title, unit: "px", digits: 0, value: Math.round((width * side) / w), onchange: (v) => wide((v * w) / side) }))),
    h("div", { class: "bar" }, ...[0.5, 1, 2, 4].map((f) => button({ text: f < 1 ? "\u00bd\u00d7" : `${f}\u00d7`, label: `${f} times the size of the canvas`, pressed: width === Math.round(w * f), onclick: () => wide(w * f) }))));
  root.replaceChildren(
    h("h2", {}, "Export"), ...kinds, h("p", { class: "note" }, meaning),
    ...[
      sized && sizing,
      ["jpg", "webp", "mp4", "webm", "webp-clip"].includes(kind) && slider({ label: "Quality", min: 1, max: 100, value: chosen.quality, oninput: (v) => { chosen.quality = v; } }),
      sort === "clip" && slider({ label: "Frames", min: 6, max: 60, unit: "/s", value: chosen.fps, oninput: (v) => { chosen.fps = v; } }),
      kind === "pxi" && check("Forget the history", "baked"), kind === "pxi" && check("Purge what was removed, for good", "purged"),
    ].filter(Boolean),
    (progress = h("progress", { max: 1, hidden: !job, "aria-label": "Exporting" })),
    h("div", { class: "bar foot" }, h("span", { class: "result", role: "status" }),
      job ? button({ text: "Cancel", onclick: cancel }) : button({ text: `Export ${title}`, icon: "download", class: "primary", id: "do-export", onclick: start })));
}

/** Sets the width of what is exported. @param {number} v */
function wide(v) {
  chosen.width = Math.max(1, Math.min(16384, Math.round(v)));
  build();
}

/** @param {string} text @param {"baked"|"purged"} key */
const check = (text, key) => h("label", { class: "check" }, h("input", { type: "checkbox", checked: chosen[key], onchange: (/** @type {any} */ e) => { chosen[key] = e.target.checked; } }), text);

async function start() {
  const { kind, width, quality, fps, baked, purged } = chosen;
  const sort = KINDS.find(([k]) => k === kind)?.[3];
  const body = { kind, ...(width && (sort === "picture" || sort === "clip") && { width }), ...(["jpg", "webp", "mp4", "webm", "webp-clip"].includes(kind) && { quality }), ...(sort === "clip" && { fps }), ...(kind === "pxi" && { baked, purged }) };
  job = "*";
  build();
  const answer = await act(() => post("/api/export", body));
  if (!answer) { job = null; build(); }
}

on("job", (j) => { if (j.kind === "export" && progress) { job = j.id; if (j.total) progress.value = j.done / j.total; } });
on("job-end", (j) => {
  if (j.kind !== "export") return;
  job = null;
  build();
  if (!j.ok) return;
  const done = root.querySelector(".result");
  done?.append(h("a", { href: j.result.url, download: j.result.name }, `${j.result.name}`), ` ${size(j.result.bytes)}`);
});
on("state", (before) => {
  if (store.state.stage !== "editing") root.hidden = true;
  if (String(before.size) !== String(store.state.size)) chosen.width = 0;
});
