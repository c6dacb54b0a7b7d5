/** The panel of a raster whose layers are being pointed at, and its encoding. */
import { act, regions } from "../actions.js";
import { button, h, slider } from "../dom.js";
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

/** @type {any} */
let progress = null;

function build() {
  const { state } = store;
  encoding.hidden = state.stage !== "pointing";
  if (encoding.hidden || encoding.contains(document.activeElement) && !state.busy && !progress) return;
  const running = state.busy?.kind === "encode";
  if (running) {
    if (progress) return;
    progress = h("progress", { max: 1, "aria-label": "Encoding" });
    encoding.replaceChildren(h("div", { class: "line" }, h("span", { class: "stage-name" }, "Encoding"), h("span", { class: "share" })), progress,
      button({ text: "Cancel", class: "wide", onclick: () => post("/api/cancel").catch(() => {}) }));
    return;
  }
  progress = null;
  encoding.replaceChildren(
    slider({ label: "Quality", min: 0, max: 100, value: settings.quality, oninput: (v) => { settings.quality = v; } }),
    slider({ label: "Effort", min: 1, max: 9, value: settings.effort, oninput: (v) => { settings.effort = v; } }),
    button({ text: "Make it editable", icon: "sparkles", class: "primary wide", id: "encode", onclick: () => act(() => post("/api/encode", { quality: settings.quality, effort: settings.effort })) }));
}

on("state", build);
on("job", (job) => {
  if (job.kind !== "encode" || !progress) return;
  if (job.total) progress.value = job.done / job.total;
  const [name, share] = encoding.querySelectorAll(".line span");
  name.textContent = job.stage ? job.stage[0].toUpperCase() + job.stage.slice(1) : "Encoding";
  share.textContent = job.total ? `${Math.round((100 * job.done) / job.total)}\u2009%` : "";
});
