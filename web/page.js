/** The viewer: drop a file, zoom and move it with mouse, fingers or keys, hide layers, play motion, save. */

import { listen } from "./gestures.js";
import { Picture } from "./pxi-wasm/beside.js";
import { fit, placed, visible } from "./viewport.js";

const $ = (id) => document.getElementById(id);
const COARSE = 1 / 8; // detail of the first picture of a file
const DRAFT = 1 / 3; // detail while something moves and pictures are slow
const SLOW = 60; // milliseconds
const CALM = 150; // milliseconds after which the full picture is made

let opening = null; // controller of the file that is read
const canvas = $("screen");
const state = {
  name: "",
  picture: null, // beside.js
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

/** Of the motion, in seconds. */
const duration = () => (state.picture.motion?.duration ?? 0) / 1000;
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
    const { picture, drawn, time } = state;
    const coarse = !state.shown;
    const draft = coarse || (!calm && state.cost > SLOW);
    if (draft && !coarse && !state.playing) setTimeout(() => update(false), CALM + 20);
    const wanted = visible(state.view, picture, screen(), devicePixelRatio * (coarse ? COARSE : draft ? DRAFT : 1));
    if (!wanted) break;
    if (!drawn.length) {
      state.shown = null;
      break;
    }
    const started = performance.now();
    try {
      const bitmap = await picture.bitmap({ ...wanted, layers: drawn, t: time, draft: coarse });
      if (state.picture !== picture) continue;
      state.shown = { bitmap, region: wanted.region, draft };
      state.stale ||= coarse;
      if (!draft) state.cost = performance.now() - started;
      $("status").textContent = `${picture.width} × ${picture.height}, ` +
        `${Math.round(state.view.scale * 100)} %, ${Math.round(performance.now() - started)} ms`;
      document.body.dataset.request = JSON.stringify(wanted);
    } catch (error) {
      if (state.picture === picture) $("status").textContent = error.message;
    }
    paint();
  }
  paint();
  state.busy = false;
  document.body.dataset.idle = !state.playing && !state.shown?.draft;
}

/** Shows a file: its address or its content. */
async function open(name, source) {
  $("error").textContent = "";
  opening?.abort();
  opening = new AbortController();
  const { signal } = opening;
  state.picture?.close();
  Object.assign(state, { name, picture: null, shown: null, time: null, playing: false, cost: 0 });
  try {
    state.picture = await Picture.open(source, { signal });
  } catch (error) {
    if (signal.aborted) return;
    $("hint").hidden = false;
    $("panel").hidden = true;
    $("error").textContent = error.kind ? `${error.kind}: ${error.message}` : error.message;
    paint();
    return;
  }
  $("hint").hidden = true;
  $("panel").hidden = false;
  $("name").textContent = name;
  state.view = fit(state.picture, screen());
  listLayers();
  $("motion").hidden = !state.picture.motion;
  $("play").textContent = "Play";
  $("time").max = duration();
  $("time").value = 0;
  update(false);
}

/** Front to back, as one looks at them. */
function listLayers() {
  const layers = state.picture.names;
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
    $("time").value = ((performance.now() - began) / 1000) % duration();
    state.time = Number($("time").value);
    update(true);
    requestAnimationFrame(tick);
  };
  if (state.playing) tick();
  else update(false);
}

/** Shows the whole picture. */
function showAll() {
  if (!state.picture) return;
  state.view = fit(state.picture, screen());
  update(false);
}

/** Saves what is shown as PNG, with the colours of the picture. */
async function save() {
  const { name, picture, view, drawn, time } = state;
  const wanted = picture && drawn.length && visible(view, picture, screen(), devicePixelRatio);
  if (!wanted) return;
  try {
    const png = await picture.png({ ...wanted, layers: drawn, t: time });
    const href = URL.createObjectURL(new Blob([png], { type: "image/png" }));
    Object.assign(document.createElement("a"), { href, download: name.replace(/(\.pxi)?$/i, ".png") }).click();
    setTimeout(() => URL.revokeObjectURL(href), 60000);
  } catch (error) {
    $("status").textContent = error.message;
  }
}

listen(canvas, {
  view: () => state.picture && state.view,
  picture: () => state.picture,
  move(view) {
    state.view = view;
    update(true);
  },
});
canvas.addEventListener("dblclick", showAll);
addEventListener("keydown", (event) => {
  const keys = { 0: showAll, s: save, " ": () => state.picture?.motion && play() };
  const taken = event.ctrlKey || event.metaKey || event.altKey || event.target.closest?.("input, button");
  if (taken || !Object.hasOwn(keys, event.key)) return;
  event.preventDefault();
  keys[event.key]();
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
  if (file) await open(file.name, file);
});
$("file").onchange = async ({ target: { files: [file] } }) => {
  if (file) await open(file.name, file);
};
$("play").onclick = play;
$("save").onclick = save;
$("time").oninput = () => {
  state.time = Number($("time").value);
  state.playing = false;
  $("play").textContent = "Play";
  update(true);
};

// ?file=URL shows a file from the start.
const address = new URLSearchParams(location.search).get("file");
if (address) await open(address.split("/").pop(), new URL(address, document.baseURI));
