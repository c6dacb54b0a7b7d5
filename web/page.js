/** The viewer: drop a file, zoom with the wheel, drag to pan, hide layers, play motion. */

import { fit, panned, placed, visible, zoomed } from "./viewport.js";

const $ = (id) => document.getElementById(id);
const DRAFT = 1 / 3; // detail while something moves and pictures are slow
const SLOW = 60; // milliseconds
const CALM = 150; // milliseconds after which the full picture is made

/** Calls to the worker, by number. */
class Decoder {
  #worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
  #waiting = new Map();
  #last = 0;

  constructor() {
    this.#worker.onmessage = ({ data: { id, error, kind, ...answer } }) => {
      const { resolve, reject } = this.#waiting.get(id);
      this.#waiting.delete(id);
      if (error === undefined) resolve(answer);
      else reject(new Error(`${kind}: ${error}`));
    };
    this.#worker.onerror = ({ message }) => this.end(message);
  }

  /** Stops whatever it does. */
  end(reason = "stopped") {
    this.#worker.terminate();
    for (const { reject } of this.#waiting.values()) reject(new Error(reason));
    this.#waiting.clear();
  }

  ask(task, request) {
    const id = ++this.#last;
    this.#worker.postMessage({ id, task, ...request });
    return new Promise((resolve, reject) => this.#waiting.set(id, { resolve, reject }));
  }
}

let decoder = new Decoder();
const canvas = $("screen");
const state = {
  picture: null, // {width, height, layers, duration}
  view: null,
  drawn: [], // numbers of layers
  time: null, // seconds, null for the still
  playing: false,
  shown: null, // the last picture {bitmap, region}
  busy: false,
  stale: false,
  cost: 0, // milliseconds of the last full picture
  touched: 0, // when something moved last
};

const screen = () => ({ width: canvas.clientWidth, height: canvas.clientHeight });

/** Draws what there is at once, and asks for what there should be. */
function update(moving) {
  if (moving) state.touched = performance.now();
  paint();
  state.stale = true;
  if (!state.busy) refresh();
}

function paint() {
  const ratio = devicePixelRatio;
  const { width, height } = screen();
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d");
  if (!state.shown) return;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.imageSmoothingEnabled = state.shown.draft;
  const place = placed(state.view, state.shown.region);
  context.drawImage(state.shown.bitmap, place.x, place.y, place.width, place.height);
}

/** Renders as long as something has changed: one picture at a time, the newest view next. */
async function refresh() {
  state.busy = true;
  document.body.dataset.idle = false;
  while (state.stale && state.picture) {
    state.stale = false;
    const calm = !state.playing && performance.now() - state.touched > CALM;
    const draft = !calm && state.cost > SLOW;
    if (draft && !state.playing) setTimeout(() => update(false), CALM + 20);
    const { picture, drawn, time } = state;
    const detail = devicePixelRatio * (draft ? DRAFT : 1);
    const wanted = visible(state.view, picture, screen(), detail);
    if (!wanted) break;
    const started = performance.now();
    try {
      const answer = await decoder.ask("render", { ...wanted, layers: drawn, t: time });
      const data = new ImageData(answer.pixels, answer.width, answer.height);
      if (state.picture !== picture) continue;
      state.shown = { bitmap: await createImageBitmap(data), region: wanted.region, draft };
      if (!draft) state.cost = performance.now() - started;
      $("status").textContent = `${picture.width} × ${picture.height}, ` +
        `${Math.round(state.view.scale * 100)} %, ${Math.round(performance.now() - started)} ms`;
      document.body.dataset.request = JSON.stringify(wanted);
    } catch (error) {
      $("status").textContent = error.message;
    }
    paint();
  }
  state.busy = false;
  document.body.dataset.idle = !state.playing && !state.shown?.draft;
}

async function open(name, bytes) {
  $("error").textContent = "";
  decoder.end();
  decoder = new Decoder();
  try {
    const picture = await decoder.ask("open", { bytes });
    Object.assign(state, { picture, shown: null, time: null, playing: false, cost: 0 });
  } catch (error) {
    state.picture = null;
    state.shown = null;
    $("hint").hidden = false;
    $("panel").hidden = true;
    $("error").textContent = error.message;
    paint();
    return;
  }
  $("hint").hidden = true;
  $("panel").hidden = false;
  $("name").textContent = name;
  state.view = fit(state.picture, screen());
  listLayers();
  $("motion").hidden = !state.picture.duration;
  $("play").textContent = "Play";
  $("time").max = state.picture.duration;
  $("time").value = 0;
  update(false);
}

/** Front to back, as one looks at them. */
function listLayers() {
  const { layers } = state.picture;
  state.drawn = layers.flatMap(({ hidden }, k) => (hidden ? [] : [k]));
  const rows = layers.map(({ name, hidden }, k) => {
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: !hidden });
    box.onchange = () => {
      state.drawn = state.drawn.filter((n) => n !== k).concat(box.checked ? [k] : []);
      update(false);
    };
    const row = document.createElement("label");
    row.append(box, name);
    return row;
  });
  $("layers").replaceChildren(...rows.reverse());
}

function play() {
  state.playing = !state.playing;
  $("play").textContent = state.playing ? "Pause" : "Play";
  const began = performance.now() - 1000 * Number($("time").value);
  const { picture } = state;
  const tick = () => {
    if (!state.playing || state.picture !== picture) return;
    $("time").value = ((performance.now() - began) / 1000) % picture.duration;
    state.time = Number($("time").value);
    update(true);
    requestAnimationFrame(tick);
  };
  if (state.playing) tick();
  else update(false);
}

canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  if (!state.picture) return;
  const lines = event.deltaMode === 1 ? 16 : 1;
  const factor = Math.exp(-event.deltaY * lines * 0.002);
  state.view = zoomed(state.view, factor, event.offsetX, event.offsetY, state.picture);
  update(true);
}, { passive: false });
canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  if (!state.picture || !event.buttons) return;
  state.view = panned(state.view, event.movementX, event.movementY);
  update(true);
});
canvas.addEventListener("dblclick", () => {
  if (!state.picture) return;
  state.view = fit(state.picture, screen());
  update(false);
});
addEventListener("resize", () => state.picture && update(false));
addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("over");
});
addEventListener("dragleave", () => document.body.classList.remove("over"));
addEventListener("drop", async (event) => {
  event.preventDefault();
  document.body.classList.remove("over");
  const [file] = event.dataTransfer.files;
  if (file) await open(file.name, await file.arrayBuffer());
});
$("file").onchange = async ({ target: { files: [file] } }) => {
  if (file) await open(file.name, await file.arrayBuffer());
};
$("play").onclick = play;
$("time").oninput = () => {
  state.time = Number($("time").value);
  state.playing = false;
  $("play").textContent = "Play";
  update(true);
};

// ?file=URL shows a file from the start.
const address = new URLSearchParams(location.search).get("file");
if (address) {
  const answer = await fetch(address);
  if (answer.ok) await open(address.split("/").pop(), await answer.arrayBuffer());
  else $("error").textContent = `${address}: ${answer.status}`;
}
