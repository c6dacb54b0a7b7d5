/** The empty state, dropping, pasting, and what is said while a file is opened. */
import { choose, insert, open } from "../actions.js";
import { button, h, icon } from "../dom.js";
import { root as stage, view } from "../stage.js";
import { emit, on, store } from "../store.js";

export const ACCEPT = ".pxi,.png,.jpg,.jpeg,.webp,.ora,.psd,image/png,image/jpeg,image/webp";

const step = (/** @type {string} */ name, /** @type {string} */ title, /** @type {string} */ text) => h("li", {}, icon(name, 20), h("b", {}, title), h("span", {}, text));

const empty = h("div", { class: "empty" },
  h("div", { class: "welcome" },
    h("div", { class: "well" }, icon("image-plus", 34)),
    h("h1", {}, "Drop a picture here"),
    h("p", {}, "or paste it, or ", button({ text: "Open a file\u2026", class: "primary", id: "open-first", onclick: () => choose(ACCEPT, open) })),
    h("ol", { class: "steps" },
      step("crosshair", "Point", "Things in it are found. Click what is missing."),
      step("mouse-pointer-2", "Pull", "Move, bend, recolour, remove."),
      step("wind", "Animate", "Wind, jelly, breath: one click.")),
    h("p", { class: "fine" }, "PNG, JPEG, WebP, PXI, OpenRaster, Photoshop. Nothing leaves this machine.")));

const waiting = h("div", { class: "opening", hidden: true, role: "status" }, h("span", { class: "spinner" }), h("span", {}));

const target = (/** @type {string} */ title, /** @type {string} */ name, /** @type {(file: File, e: DragEvent) => void} */ done) => h("div", {
  class: "target", ondragover: (/** @type {DragEvent} */ e) => { e.preventDefault(); /** @type {any} */ (e.currentTarget).classList.add("over"); },
  ondragleave: (/** @type {any} */ e) => e.currentTarget.classList.remove("over"),
  ondrop: (/** @type {DragEvent} */ e) => {
    e.preventDefault();
    e.stopPropagation();
    /** @type {any} */ (e.currentTarget).classList.remove("over");
    emit("dropping", false);
    const file = e.dataTransfer?.files[0];
    if (file) done(file, e);
  },
}, icon(name, 24), h("span", {}, title));

const dropping = h("div", { class: "dropping", hidden: true });

function show(/** @type {boolean} */ on) {
  if (on === !dropping.hidden) return;
  dropping.hidden = !on;
  if (!on) return;
  const editing = store.state.stage === "editing";
  dropping.replaceChildren(
    ...(editing ? [target("Add as a layer", "layers-2", (file, e) => {
      const box = stage.getBoundingClientRect();
      insert(file, file.name.endsWith(".pxi") ? undefined : view.toCanvas(e.clientX - box.left, e.clientY - box.top));
    })] : []),
    target(editing ? "Open instead" : "Open", "folder-open", (file) => open(file)));
}

stage.append(empty, waiting, dropping);
on("dropping", show);
on("state", () => { empty.hidden = store.state.stage !== "empty" || !waiting.hidden; });
on("opening", (name) => {
  if (name) waiting.classList.remove("corner");
  waiting.hidden = !name && !waiting.classList.contains("corner");
  if (name) waiting.lastChild.textContent = `Opening ${name}`;
  empty.hidden = store.state.stage !== "empty" || Boolean(name);
});
const corner = (/** @type {string} */ text) => {
  waiting.hidden = false;
  waiting.classList.add("corner");
  waiting.lastChild.textContent = text;
};
const done = () => { waiting.hidden = true; waiting.classList.remove("corner"); };
on("state", (before) => { if (store.state.stage === "pointing" && before.stage !== "pointing" && store.state.regions.length < 2) corner("Looking for layers"); });
on("job", (job) => {
  if (job.kind === "encode" && store.state.stage !== "pointing") corner(`${job.stage || "Encoding"}${job.total ? ` ${Math.round((100 * job.done) / job.total)}\u2009%` : ""}`);
});
on("job-end", (job) => { if (job.kind === "find" || job.kind === "encode") done(); });

let leave = 0;
addEventListener("dragover", (e) => {
  if (!e.dataTransfer?.types.includes("Files")) return;
  e.preventDefault();
  clearTimeout(leave);
  leave = window.setTimeout(() => show(false), 1000);
  show(true);
});
addEventListener("drop", (e) => {
  e.preventDefault();
  show(false);
  const file = e.dataTransfer?.files[0];
  if (file && store.state.stage !== "editing") open(file);
});
addEventListener("paste", (e) => {
  const file = [...(e.clipboardData?.files ?? [])][0];
  if (!file) return;
  e.preventDefault();
  if (store.state.stage === "editing" && !file.name.endsWith(".pxi")) insert(file);
  else open(file);
});
