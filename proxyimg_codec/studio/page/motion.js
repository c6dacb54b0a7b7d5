/** The motion that is being made: a preset or one's own handles, what is simulated of it, and its playing. */
import { act, edit, say } from "./actions.js";
import { later } from "./dom.js";
import { poses } from "./server.js";
import * as scene from "./scene.js";
import { draw, playsWhen, unrest } from "./stage.js";
import { emit, layerOf, moved, on, store, targets } from "./store.js";

/** @typedef {{layer: string, at: number[], radius: number, keys: {time: number, offset: number[], scale: number, turn: number}[]}} Handle */

/** What the panel and the timeline set. */
export const draft = {
  /** @type {string|null} */ preset: null,
  strength: 1, pace: 1, duration: 4, fps: 24, loop: true, seed: 0,
  /** Sides that stay; null leaves it to the preset. @type {string[]|null} */ sides: null,
  /** @type {{layer: string, at: number[], radius: number}[]} */ discs: [],
  /** @type {Handle[]} */ handles: [],
};

/** Playing: the moment in seconds, and whether it runs. */
export const player = { time: 0, running: false, loop: true, onion: false, busy: false };

/** Poses that were simulated. @type {any} */
let played = null;
/** Motion that made them, whole. @type {any} */
export let motion = null;

/** Names of the layers that move: those selected, or all but the back. */
export function movers() {
  const back = store.state.opaque ? store.state.layers[0]?.name : null;
  const chosen = moved(targets()).map((l) => l.name).filter((n) => n !== back);
  return chosen.length ? chosen : store.state.layers.map((/** @type {any} */ l) => l.name).filter((/** @type {string} */ n) => n !== back);
}
/** Layers of the draft; fixed when it begins, so that selecting something later changes nothing. @type {string[]|null} */
let layers = null;

/** The motion to simulate: the preset's own, with the strength and pace of the draft. @param {any} base */
function adjusted(base) {
  const whole = structuredClone(base), { strength: k, pace } = draft;
  if (whole.wind) {
    whole.wind.strength *= k;
    whole.wind.frequency = Math.min(100, (whole.wind.frequency ?? 0.5) * pace);
  }
  if (whole.gravity) whole.gravity = whole.gravity.map((/** @type {number} */ v) => v * k);
  for (const [name, layer] of Object.entries(whole.layers ?? {})) {
    for (const push of layer.impulses ?? []) push.velocity = push.velocity.map((/** @type {number} */ v) => v * k);
    for (const handle of layer.handles ?? []) for (const key of handle.keys) if (key.scale) key.scale = 1 + (key.scale - 1) * k;
    const discs = draft.discs.filter((d) => d.layer === name).map(({ at, radius }) => ({ at, radius }));
    const pins = [...(draft.sides ?? layer.pins ?? []), ...discs];
    if (pins.length) layer.pins = pins; else delete layer.pins;
    const handles = draft.handles.filter((h) => h.layer === name).map(({ at, radius, keys }) => ({ at, radius, keys }));
    if (handles.length) layer.handles = [...(layer.handles ?? []), ...handles];
  }
  return whole;
}

/** @type {Map<string, any>} */
const bases = new Map();

/** The motion of the preset alone. */
async function baseOf() {
  const { preset, duration, fps, loop, seed } = draft;
  const common = { version: 1, duration, fps, loop, seed };
  if (!preset) return { ...common, layers: Object.fromEntries((layers ?? []).map((n) => [n, { material: "jelly", upright: true }])) };
  const key = JSON.stringify([preset, common, layers, store.state.version]);
  if (!bases.has(key)) {
    const got = await poses({ motion: { ...common, preset, layers: Object.fromEntries((layers ?? []).map((n) => [n, {}])) }, layers, together: true });
    bases.clear();
    bases.set(key, got);
  }
  return bases.get(key).motion;
}

const plain = () => draft.strength === 1 && draft.pace === 1 && !draft.sides && !draft.discs.length && !draft.handles.length;

let turn = 0;
async function simulate() {
  const mine = ++turn;
  if (!draft.preset && !draft.handles.length) return;
  layers ??= movers();
  if (!layers.length) { say("There is no layer that could move. Point at things first."); return; }
  player.busy = true;
  emit("motion");
  try {
    const base = await baseOf();
    const whole = adjusted(base);
    const key = [...bases.values()][0];
    const got = draft.preset && plain() ? key : await poses({ motion: whole, layers, together: true });
    if (mine !== turn) return;
    await take({ ...got, motion: whole });
    if (!player.running) toggle(true);
  } catch (error) {
    if (mine === turn) say(/** @type {Error} */ (error).message, { kind: "error" });
  } finally {
    if (mine === turn) { player.busy = false; emit("motion"); }
  }
}

/** Takes over poses, with the meshes that they move. @param {any} got */
async function take(got) {
  const names = [...got.layers.keys()].filter((n) => layerOf(n));
  await Promise.all(names.map((n) => scene.meshOf(n)));
  played = got;
  motion = got.motion;
  player.loop = got.loop;
}

/** The draft changed: simulates it, soon. */
export const renew = later(simulate, 180);

/** Begins a preset. @param {string} name */
export function preset(name) {
  layers = movers();
  Object.assign(draft, { preset: name, strength: 1, pace: 1, sides: null });
  renew();
  emit("motion");
}

/** Forgets the draft. */
export function forget() {
  renew.cancel();
  turn++;
  stop();
  played = motion = layers = null;
  Object.assign(draft, { preset: null, strength: 1, pace: 1, sides: null, discs: [], handles: [] });
  player.busy = false;
  emit("motion");
}

/** Keeps the motion in the file. */
export async function keep() {
  if (!motion) return;
  const whole = { ...motion, loop: player.loop };
  const state = await edit([{ op: "animate", motion: whole }]);
  if (state) say("The motion is in the file now. Export makes a clip of it.", { kind: "done" });
}

/** Takes the motion out of the file. */
export async function still() {
  forget();
  await edit(store.state.layers.filter((/** @type {any} */ l) => l.moves).map((/** @type {any} */ l) => ({ op: "still", layer: l.name })));
}

/** A handle at a point of a layer at rest. @param {string} layer @param {number[]} at @returns {Handle} */
export function handle(layer, at) {
  const { bounds: b } = /** @type {any} */ (layerOf(layer));
  const made = { layer, at, radius: Math.round(Math.max(6, (0.12 * Math.hypot(b[2] - b[0], b[3] - b[1])) / scene.enlarged(layer))), keys: [{ time: 0, offset: [0, 0], scale: 1, turn: 0 }] };
  layers ??= movers();
  if (!layers.includes(layer)) layers.push(layer);
  draft.handles.push(made);
  emit("motion");
  return made;
}

/** Sets a key of a handle at the present moment. @param {Handle} h @param {{offset?: number[], scale?: number, turn?: number}} values */
export function setKey(h, values) {
  const time = Math.min(draft.duration, Math.round(player.time * draft.fps) / draft.fps);
  const near = h.keys.find((k) => Math.abs(k.time - time) < 0.5 / draft.fps);
  if (near) Object.assign(near, values);
  else h.keys.push({ time, ...{ ...at(h, time), ...values } });
  h.keys.sort((a, b) => a.time - b.time);
  renew();
  emit("motion");
}

/** Offset, scale and angle of a handle at a time. @param {Handle} h @param {number} time */
export function at(h, time) {
  const after = h.keys.findIndex((k) => k.time > time), last = h.keys[h.keys.length - 1];
  if (after < 0) return { offset: [...last.offset], scale: last.scale, turn: last.turn };
  const b = h.keys[after], a = h.keys[after - 1] ?? b, span = b.time - a.time, u = span ? (time - a.time) / span : 0, s = u * u * (3 - 2 * u);
  const between = (/** @type {number} */ p, /** @type {number} */ q) => p + s * (q - p);
  return { offset: [0, 1].map((i) => between(a.offset[i], b.offset[i])), scale: between(a.scale, b.scale), turn: between(a.turn, b.turn) };
}

// Playing.
export const seconds = () => played?.seconds ?? draft.duration;
export const has = () => played !== null;

/** Displacements at a time, between the two nearest frames. @param {number} time @param {Map<string, Float32Array>} into */
export function pose(time, into) {
  into.clear();
  if (!played) return;
  const place = (time * played.fps) % Math.max(played.frames, 1), a = Math.floor(place) % played.frames;
  const b = played.loop ? (a + 1) % played.frames : Math.min(a + 1, played.frames - 1), u = place - Math.floor(place);
  for (const [name, { nodes, data }] of played.layers) {
    const out = new Float32Array(2 * nodes), p = a * 2 * nodes, q = b * 2 * nodes;
    for (let i = 0; i < out.length; i++) out[i] = data[p + i] + u * (data[q + i] - data[p + i]);
    into.set(name, out);
  }
}

let before = 0;
on("frame", (now) => {
  if (!player.running) { before = 0; return; }
  if (before) player.time += (now - before) / 1000;
  before = now;
  const end = seconds();
  if (player.time >= end) {
    if (player.loop) player.time %= end;
    else { player.time = end - 1e-3; toggle(false); }
  }
  pose(player.time, scene.sway);
  emit("time");
  draw();
});
playsWhen(() => player.running || scene.sway.size > 0);

/** Starts or halts. @param {boolean} [run] */
export function toggle(run = !player.running) {
  if (run && !played) { if (draft.preset || draft.handles.length) renew(); return; }
  if (run && !player.loop && player.time >= seconds() - 0.01) player.time = 0;
  player.running = run;
  emit("motion");
  draw();
}

/** Goes to a moment. @param {number} time */
export function seek(time) {
  player.running = false;
  player.time = Math.min(Math.max(0, time), seconds() - 1e-3);
  pose(player.time, scene.sway);
  emit("time");
  emit("motion");
  draw();
}

/** Back to the still picture. */
export function stop() {
  player.running = false;
  player.time = 0;
  scene.sway.clear();
  emit("time");
  unrest();
}

/** Loads the motion that the file has. */
async function fromFile() {
  const { timeline } = store.state;
  if (!timeline || played) return;
  await act(async () => { await take({ ...(await poses()), motion: timeline.motion }); });
  Object.assign(draft, { duration: timeline.seconds, fps: timeline.fps, loop: timeline.loop });
  emit("motion");
}

on("mode", () => {
  if (store.mode === "motion") fromFile();
  else { player.running = false; scene.sway.clear(); unrest(); }
  emit("motion");
});
on("state", (old) => {
  if (old.stage !== store.state.stage || old.file !== store.state.file) forget();
  if (played && [...played.layers].some(([n]) => !layerOf(n))) forget();
});
