/** The panel of a motion: presets, how strong, what stays. */
import { button, h, slider } from "../dom.js";
import { at, draft, forget, has, keep, movers, motion, player, preset, renew, setKey, still } from "../motion.js";
import { get } from "../server.js";
import { emit, on, store, use } from "../store.js";
import { chosen } from "../tools/motion.js";
import { section } from "./properties.js";

export const root = h("div", { class: "properties motion", hidden: true });

/** @type {{name: string, meaning: string, pins: string[]}[]} */
let presets = [];

const SIDES = ["top", "bottom", "left", "right", "centre"];

/** Sides that stay: those chosen, or those of the preset and where the canvas cuts layers off. @returns {string[]} */
function staying() {
  const mine = Object.values(motion?.layers ?? {}).flatMap((/** @type {any} */ l) => l.pins ?? []).filter((p) => typeof p === "string");
  return draft.sides ?? (mine.length ? [...new Set(mine)] : presets.find((p) => p.name === draft.preset)?.pins ?? []);
}

function sides() {
  const now = staying();
  return h("div", { class: "segments", role: "group", "aria-label": "Sides that stay" }, ...SIDES.map((side) => button({
    text: side[0].toUpperCase() + side.slice(1), pressed: now.includes(side),
    onclick: () => { draft.sides = now.includes(side) ? now.filter((s) => s !== side) : [...now, side]; renew(); emit("motion"); },
  })));
}

function handle() {
  const h0 = draft.handles[chosen.handle];
  if (!h0) return null;
  const now = at(h0, player.time);
  return section(`Handle on ${h0.layer}`,
    slider({ label: "Size", min: 0.2, max: 3, step: 0.05, value: now.scale, neutral: 1, onchange: (v) => setKey(h0, { scale: v }) }),
    slider({ label: "Turn", min: -180, max: 180, unit: "\u00b0", value: now.turn, neutral: 0, onchange: (v) => setKey(h0, { turn: v }) }),
    slider({ label: "Reach", min: 4, max: Math.round(Math.max(...store.state.size) / 3), unit: " px", value: h0.radius, onchange: (v) => { h0.radius = v; renew(); } }),
    h("div", { class: "bar" },
      button({ text: "Set a key", icon: "diamond", onclick: () => setKey(h0, {}) }),
      button({ text: "Take away", icon: "x", onclick: () => { draft.handles.splice(chosen.handle, 1); chosen.handle = -1; renew(); emit("motion"); } })));
}

function build() {
  root.hidden = store.mode !== "motion" || store.state.stage !== "editing";
  if (root.hidden || root.contains(document.activeElement) && /** @type {any} */ (document.activeElement).type === "range") return;
  const names = movers();
  const parts = [
    section("Presets",
      h("div", { class: "presets", role: "group", "aria-label": "Presets" }, ...presets.map((p) => button({ text: p.name[0].toUpperCase() + p.name.slice(1), label: p.meaning, class: "kind", pressed: draft.preset === p.name, onclick: () => preset(p.name) }))),
      h("p", { class: "note" }, draft.preset ? presets.find((p) => p.name === draft.preset)?.meaning ?? "" : names.length ? `Moves ${names.slice(0, 3).join(", ")}${names.length > 3 ? ` and ${names.length - 3} more` : ""}.` : "There is no layer that could move.")),
    (draft.preset || draft.handles.length > 0) && section("Motion",
      draft.preset && slider({ label: "Strength", min: 0, max: 3, step: 0.05, value: draft.strength, neutral: 1, oninput: (v) => { draft.strength = v; renew(); } }),
      motion?.wind && slider({ label: "Gusts", min: 0.2, max: 3, step: 0.05, value: draft.pace, neutral: 1, oninput: (v) => { draft.pace = v; renew(); } }),
      slider({ label: "Length", min: 1, max: 12, step: 0.5, unit: " s", value: draft.duration, oninput: (v) => { draft.duration = v; renew(); } }),
      h("div", { class: "bar" }, button({ text: "Another wind", icon: "dices", onclick: () => { draft.seed++; renew(); } }))),
    draft.preset && section("What stays", sides(),
      h("div", { class: "bar" }, button({ text: "Pin by click", icon: "pin", pressed: store.tool === "keep", onclick: () => use(store.tool === "keep" ? "select" : "keep") }))),
    handle(),
    h("div", { class: "bar foot" },
      has() && button({ text: "Keep in the file", icon: "check", class: "primary", id: "keep-motion", disabled: player.busy, onclick: keep }),
      (draft.preset || draft.handles.length > 0) && button({ text: "Discard", onclick: forget }),
      store.state.timeline && button({ text: "Remove", icon: "trash-2", label: "Remove the motion from the file", onclick: still })),
  ];
  root.replaceChildren(...parts.filter(Boolean).map((p) => /** @type {any} */ (p)));
}

on("motion state selection tool mode", build);
on("mode", async () => {
  if (store.mode !== "motion" || presets.length) return;
  presets = await get("/api/presets").catch(() => []);
  build();
});
