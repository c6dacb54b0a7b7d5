/** What people do, as requests; what the server refuses is said in place. */
import { post, Refused, upload } from "./server.js";
import { preview, meshOf, textureOf } from "./scene.js";
import { arrived, emit, layerOf, on, select, store } from "./store.js";
import { h, size } from "./dom.js";

/** Says something in place. @param {string} text @param {{kind?: "info"|"error"|"done", actions?: [string, () => void][]}} [options] */
export const say = (text, options = {}) => emit("message", { text, ...options });

/** Takes the last message away. */
export const quiet = () => emit("message", null);

/** @type {Promise<any>} */
let last = Promise.resolve();

/**
 * Does one request after the other, and takes over the state that it answers with.
 * @param {() => Promise<any>} work @returns {Promise<any>} null if it was refused
 */
export function act(work) {
  const mine = last.then(async () => {
    try {
      const answer = await work();
      if (answer?.stage) arrived(answer);
      return answer;
    } catch (error) {
      if (error instanceof Refused && error.kind === "cancelled") say("Cancelled.");
      else { console.warn(error); say(/** @type {Error} */ (error).message.replace(/^edit 1: /, ""), { kind: "error" }); }
      return null;
    }
  });
  last = mine;
  return mine;
}

/** @param {any[]} edits @returns {Promise<any>} */
export const edit = (edits) => act(() => post("/api/edit", { edits }));

/**
 * Edits that are already shown as a preview, which goes when the server has caught up.
 * @param {any[]} edits @param {Iterable<string>} names
 */
export async function commit(edits, names) {
  const shown = [...names].map((n) => /** @type {[string, any]} */ ([n, preview.get(n)]));
  const state = await edit(edits);
  await Promise.all(shown.flatMap(([n, p]) => (state && layerOf(n) ? [p?.bent && meshOf(n), p?.clip && textureOf(n)] : [])).map((v) => v?.catch(() => {})));
  for (const [name, mine] of shown) if (preview.get(name) === mine) preview.delete(name);
  emit("drawn");
  return state;
}

export const undo = () => act(() => post(store.state.stage === "pointing" ? "/api/regions/undo" : "/api/undo", { steps: 1 }));
export const redo = () => act(() => post(store.state.stage === "pointing" ? "/api/regions/redo" : "/api/redo", { steps: 1 }));

/** @param {number} to */
export const jump = (to) => act(() => post("/api/jump", { to }));

export const cancel = () => post("/api/cancel").catch(() => {});

/** @param {string} path @param {any} body */
export const regions = (path, body) => act(() => post(`/api/regions/${path}`, body));

/** Opens a file as the document. @param {File} file @param {string} [how] */
export function open(file, how = "") {
  quiet();
  emit("opening", file.name);
  return act(() => upload(`/api/open?name=${encodeURIComponent(file.name || "pasted.png")}${how}`, file)).finally(() => emit("opening", null));
}

/** Gives the server a picture that edits may name. @param {File} file @returns {Promise<string|null>} */
export async function lend(file) {
  const answer = await act(() => upload(`/api/files?name=${encodeURIComponent(file.name || "picture.png")}`, file));
  return answer?.name ?? null;
}

/** Asks for a file. @param {string} accept @param {(file: File) => void} done */
export function choose(accept, done) {
  const input = h("input", { type: "file", accept, class: "away", "aria-label": "File", onchange: () => { const [file] = input.files; input.remove(); if (file) done(file); } });
  document.body.append(input);
  input.click();
}

/** Saves; what has no file of its own, as it was dropped, is downloaded. */
export async function save() {
  if (!store.state.target) {
    say("Writing the file\u2026");
    await act(() => post("/api/export", { kind: "pxi" }));
    return;
  }
  const state = await act(() => post("/api/save", { replace: true }));
  if (state) say(`Saved ${store.state.target ?? store.state.name}.`, { kind: "done" });
}

/** Names that are new in the state after an edit. @param {any[]} edits */
async function selecting(edits) {
  const before = new Set(store.state.layers.map((/** @type {any} */ l) => l.name));
  const state = await edit(edits);
  if (state) select(state.layers.map((/** @type {any} */ l) => l.name).filter((/** @type {string} */ n) => !before.has(n)));
  return state;
}

/** @param {string[]} names */
export const duplicate = (names) => selecting(names.map((layer) => ({ op: "duplicate", layer })));

/** @param {File} file @param {number[]} [at] */
export async function insert(file, at) {
  const source = await lend(file);
  if (source) await selecting([{ op: "insert", source, ...(at && { at: at.map((v) => Math.round(v)) }) }]);
}

/** @param {string} layer @param {File} file */
export async function textureFrom(layer, file) {
  const source = await lend(file);
  if (source) await edit([{ op: "texture", layer, source }]);
}

/** Removes layers, and offers what to show in their place. @param {string[]} names */
export async function remove(names) {
  const { state } = store;
  const back = state.layers[0];
  const edits = names.map((layer) => ({ op: "remove", layer }));
  if (!(await edit(edits)) || !state.opaque || names.includes(back.name)) return;
  offer(names.length > 1 ? `${names.length} layers` : names[0], back.name);
}

/** Offers other ways to fill what a removed layer hid. @param {string} what @param {string} back */
function offer(what, back) {
  const at = store.state.at;
  const renew = async (/** @type {any[]} */ edits) => {
    if (store.state.at > at) await act(() => post("/api/undo", { steps: store.state.at - at }));
    if (edits.length) await edit(edits);
    offer(what, back);
  };
  say(`${what} removed. Fill with:`, {
    actions: [
      ["As stored", () => renew([])],
      ...(layerOf(back)?.can_complete ? /** @type {[string, () => void][]} */ ([["Smooth", () => renew([{ op: "complete", layer: back, method: "smooth" }])], ["Surroundings", () => renew([{ op: "complete", layer: back }])]]) : []),
      ["Picture\u2026", () => choose("image/*", async (file) => { const source = await lend(file); if (source) renew([{ op: "texture", layer: back, source }]); })],
      ["Undo", () => { quiet(); act(() => post("/api/undo", { steps: store.state.at - at + 1 })); }],
    ],
  });
}

/** Puts a finished file where downloads go. @param {{url: string, name: string}} file */
function download({ url, name }) {
  const link = h("a", { href: url, download: name, class: "away" });
  document.body.append(link);
  link.click();
  link.remove();
}

on("job-end", (job) => {
  if (job.ok && job.kind === "export") {
    download(job.result);
    say(`${job.result.name}, ${size(job.result.bytes)}.`, { kind: "done" });
  }
  if (!job.ok && job.error && job.error.kind !== "cancelled") say(job.error.message, { kind: "error" });
});
