/** The timeline under the canvas: play, go to a moment, keys of handles, loop, onion skin. */
import { button, h, s } from "../dom.js";
import { draft, has, player, renew, seconds, seek, stop, toggle } from "../motion.js";
import { emit, on, store } from "../store.js";
import { draw } from "../stage.js";
import { chosen } from "../tools/motion.js";

const play = button({ icon: "play", label: "Play", keys: "Space", onclick: () => toggle(), id: "play" });
const clock = h("output", { class: "clock" });
const tracks = s("svg", { class: "tracks", role: "slider", tabindex: 0, "aria-label": "Moment in seconds", "aria-valuemin": 0 });
const loop = button({ icon: "repeat", label: "Loop", pressed: true, onclick: () => { player.loop = draft.loop = !player.loop; emit("motion"); renew(); } });
const onion = button({ icon: "layers-2", label: "Onion skin", pressed: false, onclick: () => { player.onion = !player.onion; emit("motion"); draw(); } });
const back = button({ icon: "square", label: "Stop: back to the still picture", onclick: stop });

export const root = h("div", { class: "timeline", hidden: true, role: "region", "aria-label": "Timeline" },
  h("div", { class: "transport" }, play, back, loop, onion, clock, h("span", { class: "spinner small", hidden: true })), tracks);

const LEFT = 12, ROW = 20, TOP = 22;
const width = () => Math.max(50, tracks.clientWidth - 2 * LEFT);
const x = (/** @type {number} */ t) => LEFT + (t / seconds()) * width();

function build() {
  root.hidden = store.mode !== "motion" || store.state.stage !== "editing";
  if (root.hidden) return;
  const end = seconds(), step = [0.1, 0.25, 0.5, 1, 2, 5].find((v) => (v / end) * width() > 46) ?? 10, nodes = [];
  for (let t = 0; t <= end + 1e-6; t += step) {
    nodes.push(s("line", { x1: x(t), x2: x(t), y1: 13, y2: 18, class: "tick" }));
    const label = s("text", { x: x(t) + (t === 0 ? 9 : 0), y: 9, class: "label", "text-anchor": t === 0 ? "start" : t > end - step / 2 ? "end" : "middle" });
    label.textContent = `${Number(t.toFixed(2))}s`;
    nodes.push(label);
  }
  if (!draft.handles.length) {
    const empty = s("text", { x: LEFT + 8, y: TOP + 24, class: "empty-line" });
    empty.textContent = has() || draft.preset ? "Handles with keys show here: choose the diamond, click a layer, drag it at some moment." : "Choose a preset, or hold a layer with a handle and give it keys.";
    nodes.push(empty);
  }
  draft.handles.forEach((handle, i) => {
    const y = TOP + 12 + i * ROW;
    nodes.push(s("line", { x1: LEFT, x2: LEFT + width(), y1: y, y2: y, class: `lane${i === chosen.handle ? " on" : ""}` }));
    handle.keys.forEach((key, k) => nodes.push(s("rect", {
      x: x(key.time) - 5, y: y - 5, width: 10, height: 10, rx: 1, transform: `rotate(45 ${x(key.time)} ${y})`, class: `key${i === chosen.handle ? " on" : ""}`, "data-handle": i, "data-key": k,
    })));
  });
  const head = s("g", { class: "head" }, s("line", { x1: 0, x2: 0, y1: 8, y2: 400 }), s("path", { d: "M-5 8h10v6l-5 5-5-5z" }));
  tracks.style.height = `${Math.max(62, TOP + 16 + draft.handles.length * ROW)}px`;
  tracks.replaceChildren(...nodes, head);
  const next = button({ icon: player.running ? "pause" : "play", label: player.running ? "Pause" : "Play", keys: "Space" });
  play.replaceChildren(...next.childNodes);
  play.setAttribute("aria-label", player.running ? "Pause" : "Play");
  loop.setAttribute("aria-pressed", String(player.loop));
  onion.setAttribute("aria-pressed", String(player.onion));
  root.querySelector(".spinner").hidden = !player.busy;
  tick();
}

function tick() {
  clock.textContent = `${player.time.toFixed(2)} / ${seconds().toFixed(1)} s`;
  tracks.querySelector(".head")?.setAttribute("transform", `translate(${x(player.time)} 0)`);
  tracks.setAttribute("aria-valuenow", player.time.toFixed(2));
  tracks.setAttribute("aria-valuemax", String(seconds()));
}

const time = (/** @type {PointerEvent} */ e) => ((e.clientX - tracks.getBoundingClientRect().left - LEFT) / width()) * seconds();
/** @type {any} */
let held = null;
tracks.addEventListener("pointerdown", (/** @type {PointerEvent} */ e) => {
  tracks.setPointerCapture(e.pointerId);
  const { handle, key } = /** @type {any} */ (e.target).dataset;
  held = handle === undefined ? {} : { handle: draft.handles[handle], key: draft.handles[handle].keys[key] };
  if (handle !== undefined) { chosen.handle = Number(handle); seek(held.key.time); } else seek(time(e));
});
tracks.addEventListener("pointermove", (/** @type {PointerEvent} */ e) => {
  if (!held) return;
  const t = Math.min(seconds(), Math.max(0, time(e)));
  if (held.key && held.handle.keys.indexOf(held.key) > 0) { held.key.time = Math.round(t * draft.fps) / draft.fps; held.moved = true; }
  if (!held.key || held.moved) seek(t);
});
tracks.addEventListener("pointerup", () => {
  if (held?.moved) { held.handle.keys.sort((/** @type {any} */ a, /** @type {any} */ b) => a.time - b.time); renew(); }
  held = null;
});
tracks.addEventListener("dblclick", (/** @type {any} */ e) => {
  const { handle, key } = e.target.dataset;
  if (handle === undefined || draft.handles[handle].keys.length < 2) return;
  draft.handles[handle].keys.splice(Number(key), 1);
  renew();
  emit("motion");
});
tracks.addEventListener("keydown", (/** @type {KeyboardEvent} */ e) => {
  const by = e.key === "ArrowLeft" ? -1 : e.key === "ArrowRight" ? 1 : 0;
  if (!by) return;
  e.preventDefault();
  e.stopPropagation();
  seek(player.time + (by * (e.shiftKey ? 10 : 1)) / draft.fps);
});

new ResizeObserver(build).observe(tracks);
on("motion mode state", build);
on("time", () => { if (!root.hidden) tick(); });
