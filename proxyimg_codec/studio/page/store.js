/** What the page knows: the state of the server, and what is chosen here. Everything else listens. */

/** @typedef {{index: number, name: string, parent: string|null, hidden: boolean, opacity: number, bounds: number[], box: number[],
 *   matrix: number[], colour: number[]|null, bent: boolean, moves: boolean, texture: string, mesh: string, can_complete: boolean,
 *   recoloured: boolean, nodes: number, paths: number[]}} Layer */

export const store = {
  /** @type {any} */
  state: { stage: "empty", version: -1, layers: [], regions: [], groups: [], history: [], at: 0 },
  /** Names of layers, groups or regions. @type {Set<string>} */
  selected: new Set(),
  /** @type {string|null} */
  hovered: null,
  /** Names of layers that the canvas leaves alone. @type {Set<string>} */
  locked: new Set(),
  tool: "select",
  /** @type {"edit"|"motion"} */
  mode: "edit",
};

/** @type {Map<string, Set<(data?: any) => void>>} */
const listeners = new Map();

/** @param {string} names separated by spaces @param {(data?: any) => void} fn */
export function on(names, fn) {
  for (const name of names.split(" ")) {
    if (!listeners.has(name)) listeners.set(name, new Set());
    listeners.get(name)?.add(fn);
  }
}

/** @param {string} name @param {any} [data] */
export function emit(name, data) {
  for (const fn of listeners.get(name) ?? []) fn(data);
}

/** @param {Iterable<string>} names */
export function select(names) {
  const next = new Set(names);
  if (next.size === store.selected.size && [...next].every((n) => store.selected.has(n))) return;
  store.selected = next;
  emit("selection");
}

/** @param {string|null} name */
export function hover(name) {
  if (name === store.hovered) return;
  store.hovered = name;
  emit("hover");
}

/** @param {string} tool */
export function use(tool) {
  if (tool === store.tool) return;
  store.tool = tool;
  emit("tool");
}

/** @param {any} state */
export function arrived(state) {
  if (state.version < store.state.version && state.stage !== "empty") return;
  // Each state comes twice, as an answer and as an event.
  if (state.version === store.state.version && state.stage === store.state.stage) return;
  const before = store.state;
  store.state = state;
  const known = new Set([...(state.layers ?? []), ...(state.groups ?? []), ...(state.regions ?? [])].map((v) => v.name));
  const kept = [...store.selected].filter((n) => known.has(n));
  if (before.stage !== state.stage) {
    store.mode = "edit";
    emit("mode");
    use(state.stage === "pointing" ? "point" : "select");
  }
  emit("state", before);
  if (kept.length !== store.selected.size) select(kept);
}

/** @param {string} name @returns {Layer|undefined} */
export const layerOf = (name) => (store.state.layers ?? []).find((/** @type {Layer} */ l) => l.name === name);

/** Names that a layer or group follows, nearest first. @param {string} name @returns {string[]} */
export function ancestors(name) {
  const up = new Map([...(store.state.layers ?? []), ...(store.state.groups ?? [])].map((v) => [v.name, v.parent]));
  const found = [];
  for (let at = up.get(name); at && !found.includes(at); at = up.get(at)) found.push(at);
  return found;
}

/** Selected names of which no ancestor is selected. */
export const targets = () => [...store.selected].filter((n) => !ancestors(n).some((a) => store.selected.has(a)));

/** Layers that move when these layers or groups do, back to front. @param {Iterable<string>} names @returns {Layer[]} */
export function moved(names) {
  const chosen = new Set(names);
  return (store.state.layers ?? []).filter((/** @type {Layer} */ l) => chosen.has(l.name) || ancestors(l.name).some((a) => chosen.has(a)));
}

/** The one selected layer, if it is one. @returns {Layer|undefined} */
export const single = () => (store.selected.size === 1 ? layerOf([...store.selected][0]) : undefined);
