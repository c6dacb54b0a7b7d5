/** Puts the page together: the bars, the keys, and the connection to the server. */
import * as actions from "./actions.js";
import { button, h, icon } from "./dom.js";
import * as motion from "./motion.js";
import * as exporting from "./panels/export.js";
import { code, steps } from "./panels/history.js";
import * as layers from "./panels/layers.js";
import { root as motionPanel } from "./panels/motion.js";
import { ACCEPT } from "./panels/opening.js";
import { encoding } from "./panels/pointing.js";
import { root as properties } from "./panels/properties.js";
import { root as timeline } from "./panels/timeline.js";
import { preview, ready } from "./scene.js";
import { listen } from "./server.js";
import * as stage from "./stage.js";
import { arrived, emit, on, select, store, targets, use } from "./store.js";
import "./tools/select.js";
import "./tools/pins.js";
import "./tools/points.js";
import "./tools/pointing.js";
import "./tools/cut.js";
import "./tools/motion.js";

const TOOLS = { pointing: ["point", "box", "scribble", "brush", "eraser", "split", "hand"], edit: ["select", "pins", "points", "cut", "hand"], motion: ["select", "keep", "handle", "hand"] };

/** Tools of what is being done. */
const offered = () => (store.state.stage === "pointing" ? TOOLS.pointing : store.state.stage === "editing" ? TOOLS[store.mode] : []);

// The bar above.
const title = h("span", { class: "title" }), dot = h("span", { class: "dot", title: "Not yet saved to the file. Nothing is lost: it is kept on this machine." });
const undo = button({ icon: "undo-2", label: "Undo", keys: "Ctrl+Z", onclick: actions.undo, id: "undo" });
const redo = button({ icon: "redo-2", label: "Redo", keys: "Ctrl+Shift+Z", onclick: actions.redo, id: "redo" });
const percent = button({ text: "100 %", class: "zoom", label: "Zoom: fit, or 100 %", onclick: () => (stage.view.fitting ? stage.zoomTo(1) : stage.fit()) });
const modes = h("div", { class: "segments modes", role: "group", "aria-label": "What to do" },
  button({ text: "Edit", id: "mode-edit", onclick: () => setMode("edit") }), button({ text: "Animate", id: "mode-motion", onclick: () => setMode("motion") }));
const save = button({ text: "Save", icon: "save", label: "Save", keys: "Ctrl+S", id: "save", onclick: actions.save });
const exportButton = button({ text: "Export", icon: "share", id: "export", onclick: () => exporting.toggle() });
exportButton.setAttribute("aria-expanded", "false");
const theme = button({ icon: "sun-moon", label: "Dark or light", id: "theme", onclick: () => paint(document.documentElement.dataset.theme === "light" ? "dark" : "light") });
const head = h("header", {},
  button({ icon: "folder-open", label: "Open a file", keys: "Ctrl+O", id: "open", onclick: () => actions.choose(ACCEPT, actions.open) }), h("div", { class: "file" }, title, dot), undo, redo,
  h("span", { class: "spring" }), modes, h("span", { class: "spring" }),
  h("div", { class: "zooming" }, button({ icon: "minus", label: "Smaller", keys: "-", onclick: () => stage.zoom(1 / 1.25) }), percent, button({ icon: "plus", label: "Larger", keys: "+", onclick: () => stage.zoom(1.25) })),
  theme, save, exportButton);

// The tools at the left.
const rail = h("nav", { class: "rail", role: "toolbar", "aria-label": "Tools", "aria-orientation": "vertical" });
function buildRail() {
  const held = rail.contains(document.activeElement);
  rail.replaceChildren(...offered().map((id) => {
    const tool = stage.tools[id];
    return button({ icon: tool.icon, label: tool.label, keys: tool.keys, pressed: store.tool === id, size: 18, id: `tool-${id}`, onclick: () => use(id) });
  }));
  if (held) rail.querySelector("[aria-pressed=true]")?.focus();
}

// The side.
const many = h("div", { class: "list-head" }, h("h2", {}, "Layers"), h("span", { class: "spring" }));
const acts = [
  button({ icon: "image-plus", label: "Add a picture as a layer", onclick: () => actions.choose("image/*,.pxi", actions.insert) }),
  button({ icon: "copy", label: "Duplicate", keys: "Ctrl+D", onclick: () => actions.duplicate(targets()) }),
  button({ icon: "group", label: "Group", keys: "Ctrl+G", onclick: group }),
  button({ icon: "trash-2", label: "Remove", keys: "Delete", id: "remove", onclick: () => actions.remove(targets()) }),
];
many.append(...acts);
const tabs = /** @type {[string, string, any][]} */ ([["properties", "Properties", h("div", {}, properties, motionPanel)], ["history", "History", steps], ["code", "Code", code]]);
const tabBar = h("div", { class: "tabs", role: "tablist" }, ...tabs.map(([id, text]) => h("button", {
  type: "button", role: "tab", id: `tab-${id}`, "aria-controls": `panel-${id}`, onclick: () => tab(id),
  onkeydown: (/** @type {KeyboardEvent} */ e) => {
    const by = e.key === "ArrowRight" ? 1 : e.key === "ArrowLeft" ? -1 : 0;
    if (!by) return;
    e.stopPropagation();
    const next = tabs[(tabs.findIndex(([t]) => t === id) + by + tabs.length) % tabs.length][0];
    tab(next);
    document.getElementById(`tab-${next}`)?.focus();
  },
}, text)));
const panels = h("div", { class: "panels" }, ...tabs.map(([id, , panel]) => h("div", { class: "panel", role: "tabpanel", id: `panel-${id}`, "aria-labelledby": `tab-${id}` }, panel)));
const side = h("aside", { "aria-label": "Layers and properties" }, many, layers.root, tabBar, panels, encoding);

/** @param {string} chosen */
function tab(chosen) {
  for (const [id] of tabs) {
    const one = /** @type {any} */ (document.getElementById(`tab-${id}`) ?? tabBar.children[tabs.findIndex(([t]) => t === id)]);
    one.setAttribute("aria-selected", String(id === chosen));
    one.tabIndex = id === chosen ? 0 : -1;
    panels.children[tabs.findIndex(([t]) => t === id)].hidden = id !== chosen;
  }
  panels.scrollTop = 0;
  if (chosen === "history") steps.querySelector(".now")?.scrollIntoView({ block: "nearest" });
}
tab("properties");

async function group() {
  const names = targets();
  if (names.length < 2) return actions.say("Choose two layers or more to group them: Shift-click them on the canvas or in the list.");
  const taken = new Set([...store.state.groups, ...store.state.layers].map((v) => v.name));
  let name = "group";
  for (let n = 2; taken.has(name); n++) name = `group ${n}`;
  const state = await actions.edit([{ op: "group", layers: names, name }]);
  if (state) { select([name]); layers.renaming(name); }
}

// Messages, in place. Errors of the package begin as parts of a line do.
const sentence = (/** @type {string} */ text) => text.replace(/^[a-z]+ /, (word) => word[0].toUpperCase() + word.slice(1));
const message = h("div", { class: "message float", hidden: true, "aria-live": "polite" });
let fade = 0;
on("message", (m) => {
  clearTimeout(fade);
  message.hidden = !m;
  if (!m) return;
  message.className = `message float ${m.kind ?? ""}`;
  message.setAttribute("role", m.kind === "error" ? "alert" : "status");
  message.replaceChildren(icon(m.kind === "error" ? "triangle-alert" : m.kind === "done" ? "check" : "info", 15), h("span", {}, m.kind === "error" ? sentence(m.text) : m.text),
    ...(m.actions ?? []).map((/** @type {[string, () => void]} */ [text, run]) => button({ text, onclick: run })),
    button({ icon: "x", label: "Close", size: 14, class: "quiet", onclick: () => actions.quiet() }));
  if (!m.actions) fade = window.setTimeout(actions.quiet, m.kind === "error" ? 12000 : 5000);
});

// What to do first, once.
const HINTS = {
  pointing: ["These things were found.", "Click one to choose it, click a thing that is missing to add it, double-click a name in the list to change it. Then press \u201cMake it editable\u201d."],
  editing: ["Now pull.", "Click a thing and drag it. With the pins of the tool bar it bends; Delete takes it away, and what lay behind it appears."],
};
const hint = h("div", { class: "hint float", hidden: true, role: "note" });
function hints() {
  const { stage: now } = store.state, key = `studio-hint-${now}`;
  const text = HINTS[/** @type {keyof typeof HINTS} */ (now)];
  hint.hidden = !text || localStorage.getItem(key) !== null;
  if (hint.hidden || hint.dataset.for === now) return;
  hint.dataset.for = now;
  hint.replaceChildren(h("b", {}, text[0]), h("p", {}, text[1]), button({ text: "Got it", id: "got-it", onclick: () => { localStorage.setItem(key, "1"); hint.hidden = true; } }));
}

// The line below.
const where = h("span", { class: "where" }), tip = h("span", { class: "tip" }), link = h("span", { class: "link", hidden: true, role: "alert" }, icon("triangle-alert", 13), "No connection: start pxi-studio again");
const foot = h("footer", {}, tip, h("span", { class: "spring" }), link, where);

stage.root.append(message, hint, exporting.root);
document.body.replaceChildren(head, h("main", {}, rail, h("div", { class: "middle" }, stage.root, timeline), side), foot);

function setMode(/** @type {"edit"|"motion"} */ mode) {
  if (mode === store.mode || store.state.stage !== "editing") return;
  store.mode = mode;
  use("select");
  actions.quiet();
  tab("properties");
  emit("mode");
}

/** @param {string} value */
function paint(value) {
  document.documentElement.dataset.theme = value;
  localStorage.setItem("studio-theme", value);
  stage.draw();
}
paint(localStorage.getItem("studio-theme") ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark"));

function bars() {
  const { state, tool } = store, editing = state.stage === "editing";
  document.body.dataset.stage = state.stage;
  document.body.dataset.mode = store.mode;
  title.textContent = state.stage === "empty" ? "Studio" : state.name ?? state.file;
  document.title = state.stage === "empty" ? "Studio" : `${state.name} \u2013 Studio`;
  dot.hidden = state.saved !== false || !editing;
  undo.disabled = editing ? state.at === 0 : state.stage === "empty";
  redo.disabled = editing ? state.at >= state.history.length : state.stage === "empty";
  save.disabled = exportButton.disabled = !editing;
  modes.hidden = !editing;
  for (const b of acts.slice(1)) b.disabled = !editing || !store.selected.size;
  acts.forEach((b) => { b.hidden = !editing; });
  modes.children[0].setAttribute("aria-pressed", String(store.mode === "edit"));
  modes.children[1].setAttribute("aria-pressed", String(store.mode === "motion"));
  properties.hidden = store.mode === "motion" && editing;
  tip.textContent = state.stage === "empty" ? "" : store.mode === "motion" && tool === "select" ? "Choose what is to move, or nothing for everything but the back; then a preset" : stage.tools[tool]?.hint ?? "";
  stage.root.style.cursor = stage.tools[tool]?.cursor ?? "default";
  hints();
}
on("state mode", () => { if (offered().length && !offered().includes(store.tool)) use(offered()[0]); buildRail(); bars(); });
on("selection", bars);
on("view", () => { percent.querySelector("span").textContent = `${Math.round(stage.view.scale * 100)}\u2009%`; });
on("pointer", (p) => { where.textContent = p && store.state.stage !== "empty" ? `${Math.floor(p.x)}, ${Math.floor(p.y)}` : store.state.size ? `${store.state.size[0]} \u00d7 ${store.state.size[1]}` : ""; });

let used = store.tool;
on("tool", () => {
  stage.tools[used]?.leave?.();
  used = store.tool;
  stage.tools[used]?.enter?.();
  buildRail();
  bars();
});

// Keys. The canvas shows that it has the focus only to those who walk with the keyboard.
addEventListener("keydown", (e) => { if (e.key === "Tab") document.body.classList.add("keys"); }, true);
addEventListener("pointerdown", () => document.body.classList.remove("keys"), true);
const typing = (/** @type {Event} */ e) => /** @type {Element} */ (e.target).matches?.("input:not([type=range]):not([type=checkbox]), select, textarea");
addEventListener("keydown", (e) => {
  if (typing(e)) return;
  const command = e.ctrlKey || e.metaKey, key = e.key.toLowerCase(), editing = store.state.stage === "editing";
  const commands = /** @type {Record<string, () => any>} */ ({
    z: () => (e.shiftKey ? actions.redo() : actions.undo()), y: actions.redo, s: () => editing && actions.save(), o: () => actions.choose(ACCEPT, actions.open),
    d: () => editing && store.selected.size && actions.duplicate(targets()), g: () => editing && group(), e: () => editing && exporting.toggle(),
    a: () => select((store.state.layers ?? []).filter((/** @type {any} */ l) => l.index || !store.state.opaque).map((/** @type {any} */ l) => l.name)),
  });
  if (command) {
    if (!commands[key]) return;
    e.preventDefault();
    return void commands[key]();
  }
  if (e.key === "Escape") {
    if (!exporting.root.hidden) return exporting.toggle(false);
    if (!stage.tools[store.tool]?.escape?.()) { if (store.tool !== offered()[0]) use(offered()[0]); else select([]); }
    return;
  }
  const inSide = side.contains(/** @type {Node} */ (e.target)) || timeline.contains(/** @type {Node} */ (e.target));
  if (!inSide && stage.tools[store.tool]?.key?.(e)) return e.preventDefault();
  const way = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
  if (way && stage.root.contains(/** @type {Node} */ (e.target))) { e.preventDefault(); return stage.pan(way[0] * (e.shiftKey ? 160 : 40), way[1] * (e.shiftKey ? 160 : 40)); }
  if (e.key === " " && !/** @type {Element} */ (e.target).closest("button, input, [role=option]")) {
    e.preventDefault();
    if (store.mode === "motion" && editing) { if (!e.repeat) motion.toggle(); } else stage.grab(true);
    return;
  }
  if ((e.key === "Delete" || e.key === "Backspace") && store.selected.size) {
    e.preventDefault();
    if (editing) actions.remove(targets());
    else for (const name of targets()) actions.regions("remove", { name });
    return;
  }
  if (e.key === "+" || e.key === "=") return stage.zoom(1.25);
  if (e.key === "-") return stage.zoom(1 / 1.25);
  if (e.key === "0") return stage.fit();
  if (e.key === "1") return stage.zoomTo(1);
  if (e.key === "F2" && store.selected.size === 1) return layers.renaming([...store.selected][0]);
  const tool = !e.altKey && offered().find((id) => stage.tools[id].keys.toLowerCase() === key);
  if (tool) use(tool);
});
addEventListener("keyup", (e) => { if (e.key === " ") stage.grab(false); });

listen({
  state: arrived,
  job: (job) => emit("job", job),
  "job-end": (job) => emit("job-end", job),
  warning: ({ message: text }) => actions.say(text),
  bye: ({ reason }) => actions.say(reason || "The studio has stopped; your work was saved.", { kind: "error" }),
}, (open) => { link.hidden = open; });
bars();
on("state", (old) => {
  if (store.state.recovered && old.version < 0) actions.say("This is what you had when the studio broke off. Nothing was lost.");
});

/** For measuring: see tests/studio. */
Object.assign(window, { studio: { times: stage.times, view: stage.view, store, player: motion.player, ready, preview: (/** @type {string} */ name) => preview.get(name) } });
