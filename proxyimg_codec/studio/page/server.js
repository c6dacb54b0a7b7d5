/** Requests to the server, as README.md beside this folder says. */

export class Refused extends Error {
  /** @param {string} kind @param {string} message */
  constructor(kind, message) { super(message); this.kind = kind; }
}

/** @param {string} path @param {RequestInit} [init] */
async function ask(path, init) {
  let answer;
  try { answer = await fetch(path, init); } catch (error) {
    if (/** @type {any} */ (error).name === "AbortError") throw error;
    throw new Refused("gone", "The studio's server does not answer. Start pxi-studio again; your work was saved.");
  }
  if (answer.ok) return answer;
  const body = await answer.json().catch(() => null);
  throw new Refused(body?.error?.kind ?? "failed", body?.error?.message ?? `${path}: the server answered ${answer.status}`);
}

/** @param {string} path @param {any} [body] @returns {Promise<any>} */
export async function post(path, body = {}) {
  const answer = await ask(path, { method: "POST", body: JSON.stringify(body), headers: { "Content-Type": "application/json" } });
  return answer.json();
}

/** @param {string} path @returns {Promise<any>} */
export const get = async (path) => (await ask(path)).json();

/** @param {string} path @param {Blob} file @returns {Promise<any>} */
export async function upload(path, file) {
  return (await ask(path, { method: "POST", body: file, headers: { "Content-Type": "application/octet-stream" } })).json();
}

/**
 * Raw pixels.
 * @param {string} path @param {AbortSignal} [signal]
 * @returns {Promise<{width: number, height: number, data: Uint8ClampedArray, box: number[]}>}
 */
export async function pixels(path, signal) {
  const answer = await ask(path, { signal });
  const head = (/** @type {string} */ name) => answer.headers.get(name) ?? "";
  const data = new Uint8ClampedArray(await answer.arrayBuffer());
  return { width: Number(head("X-Width")), height: Number(head("X-Height")), data, box: head("X-Box").split(",").map(Number) };
}

/** Poses of a motion. @param {any} [request] what to simulate; without, the motion of the picture */
export async function poses(request) {
  const answer = await ask("/api/motion", request && { method: "POST", body: JSON.stringify(request), headers: { "Content-Type": "application/json" } });
  const bytes = await answer.arrayBuffer();
  const length = new DataView(bytes).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
  const start = (4 + length + 3) & ~3;
  const layers = new Map(header.layers.map((/** @type {any} */ l) => [l.name, { nodes: l.nodes, data: new Float32Array(bytes, start + l.offset, header.frames * l.nodes * 2) }]));
  const whole = answer.headers.get("X-Motion");
  return { ...header, layers, motion: whole ? JSON.parse(whole) : request?.motion };
}

/** Listens to the server. @param {Record<string, (data: any) => void>} handlers @param {(open: boolean) => void} changed */
export function listen(handlers, changed) {
  const source = new EventSource("/api/events");
  for (const [name, fn] of Object.entries(handlers)) {
    source.addEventListener(name, (event) => fn(JSON.parse(/** @type {MessageEvent} */ (event).data)));
  }
  source.onopen = () => changed(true);
  source.onerror = () => changed(false);
}
