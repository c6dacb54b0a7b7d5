/** The panel of a raster whose layers are being pointed at, and its encoding. */
import { act, cancel, regions, say } from "../actions.js";
import { button, h, size, slider } from "../dom.js";
import { post } from "../server.js";
import { on, store } from "../store.js";
import { brush } from "../tools/pointing.js";

const settings = { quality: 60, effort: 2, layers: 4 };

const names = () => [...store.selected].filter((n) => !store.state.regions.find((/** @type {any} */ r) => r.name === n)?.back);

/** @returns {any[]} */
export function pointing() {
  const chosen = names(), brushes = ["scribble", "brush", "eraser"].includes(store.tool);
  return [
    h("section", {}, h("h3", {}, "Layers"),
      h("p", { class: "note" }, store.state.regions.length > 1 ? "These were found. Click a thing that is missing, or take away what is too much." : "Looking for layers. You can point at things at once."),
      brushes && slider({ label: "Brush", min: 2, max: 80, unit: " px", value: brush.radius, oninput: (v) => { brush.radius = v; } }),
      slider({ label: "At most", min: 1, max: 12, value: settings.layers, oninput: (v) => { settings.layers = v; } }),
      h("div", { class: "bar" },
        button({ text: "Find again", icon: "refresh-cw", onclick: () => regions("find", { max_layers: settings.layers }) }),
        chosen.length === 2 ? button({ text: "Merge both", icon: "merge", onclick: () => regions("merge", { name: chosen[0], other: chosen[1] }) }) : null)),
  ];
}

/** The foot of the side bar: quality, effort, and the button that makes the picture editable. */
export const encoding = h("div", { class: "encoding" });

/** The job that encodes, while it runs. @type {{stage: string, done: number, total: number}|null} */
let running = null;
const stage = h("span", { class: "stage-name" }), share = h("span", { class: "share" });
const progress = h("progress", { max: 1, "aria-label": "Encoding" });
const working = [h("div", { class: "line", role: "status" }, stage, share), progress, button({ text: "Cancel", icon: "x", class: "wide", id: "cancel-encode", onclick: cancel })];
const asking = [
  slider({ label: "Quality", min: 0, max: 100, value: settings.quality, oninput: (v) => { settings.quality = v; } }),
  slider({ label: "Effort", min: 1, max: 9, value: settings.effort, oninput: (v) => { settings.effort = v; } }),
  button({ text: "Make it editable", icon: "sparkles", class: "primary wide", id: "encode", onclick: start }),
];

async function start() {
  running = { stage: "encoding", done: 0, total: 0 };
  build();
  if (!(await act(() => post("/api/encode", { quality: settings.quality, effort: settings.effort })))) running = null;
  build();
}

function build() {
  encoding.hidden = store.state.stage !== "pointing";
  const parts = running ? working : asking;
  if (encoding.firstChild !== parts[0]) encoding.replaceChildren(...parts);
  if (!running) return;
  stage.textContent = running.stage[0].toUpperCase() + running.stage.slice(1);
  share.textContent = running.total ? `${Math.round((100 * running.done) / running.total)}\u2009%` : "";
  if (running.total) progress.value = running.done / running.total;
  else progress.removeAttribute("value");
}

on("state", (before) => {
  if (before.stage !== store.state.stage) running = null;
  build();
});
on("job", (job) => { if (job.kind === "encode") { running = job; build(); } });
on("job-end", (job) => {
  if (job.kind !== "encode") return;
  running = null;
  build();
  if (job.ok && job.result?.bytes) say(`${store.state.size[0]} \u00d7 ${store.state.size[1]} pixels in ${size(job.result.bytes)}.`, { kind: "done" });
});
