/** The list of layers, front first; while a raster is pointed at, that of its regions. */
import { edit, regions, textureFrom } from "../actions.js";
import { button, h, icon, rename } from "../dom.js";
import { colourOf } from "../tools/pointing.js";
import { ancestors, emit, hover, on, select, store } from "../store.js";

export const root = h("div", { class: "layers", role: "listbox", "aria-label": "Layers, front first", "aria-multiselectable": "true", tabIndex: 0 });

/** @param {any} layer */
const thumbnailKey = (layer) => `${layer.texture}|${layer.mesh}|${layer.matrix}|${layer.colour}|${layer.opacity}`;

/** Takes the pointer over for dragging something of the list. @param {PointerEvent} e @param {{moved: (row: any, upper: boolean, target: any) => void, dropped: () => void, ghost: () => any}} how */
function dragging(e, how) {
  const from = [e.clientX, e.clientY];
  /** @type {any} */
  let ghost = null;
  const move = (/** @type {PointerEvent} */ m) => {
    if (!ghost) {
      if (Math.hypot(m.clientX - from[0], m.clientY - from[1]) < 5) return;
      ghost = h("div", { class: "ghost" }, how.ghost());
      document.body.append(ghost);
      document.body.classList.add("dragging");
    }
    ghost.style.transform = `translate(${m.clientX + 10}px, ${m.clientY + 6}px)`;
    const target = /** @type {any} */ (document.elementFromPoint(m.clientX, m.clientY));
    const row = target?.closest(".layer"), box = row?.getBoundingClientRect();
    how.moved(row, Boolean(box && m.clientY < box.top + box.height / 2), target);
  };
  const up = (/** @type {Event} */ u) => {
    removeEventListener("pointermove", move);
    removeEventListener("pointerup", up);
    removeEventListener("pointercancel", up);
    document.body.classList.remove("dragging");
    if (ghost) {
      ghost.remove();
      if (u.type === "pointerup") how.dropped();
      for (const row of root.querySelectorAll(".layer")) row.classList.remove("above", "below", "onto");
      addEventListener("click", (c) => { c.stopPropagation(); c.preventDefault(); }, { capture: true, once: true });
      setTimeout(() => emit("list"), 0);
    }
  };
  addEventListener("pointermove", move);
  addEventListener("pointerup", up);
  addEventListener("pointercancel", up);
}

function clear() { for (const row of root.querySelectorAll(".layer")) row.classList.remove("above", "below", "onto"); }

/** Lets a row be dragged to another place. @param {any} item layer or region @param {number} count */
function reordering(item, count) {
  return (/** @type {PointerEvent} */ e) => {
    if (e.button || /** @type {Element} */ (e.target).closest("button, input, .thumb")) return;
    let to = -1;
    dragging(e, {
      ghost: () => item.name,
      moved(row, upper) {
        clear();
        to = -1;
        const index = Number(row?.dataset.index ?? NaN);
        if (Number.isNaN(index) || index === item.index) return;
        row.classList.add(upper ? "above" : "below");
        to = upper ? index + 1 : index;
        if (to > item.index) to--;
      },
      dropped() { if (to >= 0 && to < count && to !== item.index) reorder(item, to); },
    });
  };
}

/** @param {any} item @param {number} to */
function reorder(item, to) {
  if (store.state.stage === "pointing") regions("order", { name: item.name, to });
  else edit([{ op: "order", layer: item.name, to }]);
}

/** Chooses a row. @param {string} name @param {any} e */
function choose(name, e) {
  const names = rows();
  if (e.shiftKey && store.selected.size) {
    const last = names.findIndex((n) => store.selected.has(n)), now = names.indexOf(name);
    select(names.slice(Math.min(last, now), Math.max(last, now) + 1));
  } else if (e.ctrlKey || e.metaKey) {
    const next = new Set(store.selected);
    if (!next.delete(name)) next.add(name);
    select(next);
  } else select([name]);
}

const rows = () => /** @type {string[]} */ ([...root.querySelectorAll(".layer")].map((r) => /** @type {any} */ (r).dataset.name));

/** @param {any} item @param {any[]} children @param {string} classes @param {any} [more] */
function row(item, children, classes, more = {}) {
  const on = store.selected.has(item.name);
  return h("div", {
    class: `layer ${classes}${on ? " on" : ""}`, role: "option", "aria-selected": on, "data-name": item.name, "data-index": item.index ?? "", "aria-label": item.name,
    onclick: (/** @type {MouseEvent} */ e) => { if (!/** @type {Element} */ (e.target).closest("button, input")) choose(item.name, e); },
    onpointerenter: () => hover(item.name), onpointerleave: () => hover(null), ...more,
  }, ...children);
}

/** @param {any} item */
function nameOf(item) {
  const text = h("span", { class: "name", title: item.name, ondblclick: () => renaming(item.name, text) }, item.name);
  return text;
}

/** Asks for another name. @param {string} name @param {any} [at] */
export function renaming(name, at = [...root.querySelectorAll(".layer")].find((r) => /** @type {any} */ (r).dataset.name === name)?.querySelector(".name")) {
  if (!at) return;
  rename(at, name, (to) => {
    const done = store.state.stage === "pointing" ? regions("rename", { name, to }) : edit([{ op: "rename", layer: name, name: to }]);
    done.then((state) => { if (state) select([to]); });
  });
}

/** Pictures of layers: the old one shows until the new one has come. @type {Map<string, any>} */
const images = new Map();

/** @param {any} layer */
function thumbnail(layer) {
  const src = `/api/layers/${layer.index}/thumbnail.png?side=64&key=${encodeURIComponent(thumbnailKey(layer))}`;
  const image = images.get(layer.name) ?? h("img", { alt: "", draggable: false });
  images.set(layer.name, image);
  if (image.getAttribute("src") !== src) image.src = src;
  return h("span", {
    class: "thumb", title: "Drag onto another layer's picture to give it this texture",
    onpointerdown: (/** @type {PointerEvent} */ e) => {
      if (e.button) return;
      e.stopPropagation();
      /** @type {string|null} */
      let onto = null;
      dragging(e, {
        ghost: () => image.cloneNode(),
        moved(target) {
          clear();
          onto = target?.dataset.index !== "" && target?.dataset.name !== layer.name ? target?.dataset.name ?? null : null;
          if (onto) target.classList.add("onto");
        },
        dropped() { if (onto) edit([{ op: "texture", layer: onto, source: layer.name }]); },
      });
    },
    ondragover: (/** @type {DragEvent} */ e) => { e.preventDefault(); e.stopPropagation(); },
    ondrop: (/** @type {DragEvent} */ e) => { const file = e.dataTransfer?.files[0]; if (file) { e.preventDefault(); e.stopPropagation(); emit("dropping", false); textureFrom(layer.name, file); } },
  }, image);
}

/** @param {any} layer @param {number} depth */
function layerRow(layer, depth) {
  const locked = store.locked.has(layer.name), back = layer.index === 0 && store.state.opaque;
  const tags = [layer.moves && icon("wind", 13), layer.parent && !store.state.groups.some((/** @type {any} */ g) => g.name === layer.parent) && h("span", { class: "tag", title: `Follows ${layer.parent}` }, icon("corner-left-up", 12))];
  return row(layer, [
    h("span", { class: "indent", style: `width:${depth * 14}px` }),
    thumbnail(layer), nameOf(layer), ...tags.filter(Boolean),
    button({ icon: locked ? "lock" : "lock-open", label: locked ? `Unlock ${layer.name}` : `Lock ${layer.name}`, class: `quiet${locked ? " held" : ""}`, pressed: locked, size: 14, onclick: () => { locked ? store.locked.delete(layer.name) : store.locked.add(layer.name); emit("list"); } }),
    button({ icon: layer.hidden ? "eye-off" : "eye", label: layer.hidden ? `Show ${layer.name}` : `Hide ${layer.name}`, class: `quiet${layer.hidden ? " held" : ""}`, pressed: layer.hidden, size: 14, onclick: () => edit([{ op: layer.hidden ? "show" : "hide", layer: layer.name }]) }),
  ], `${layer.hidden ? "hidden " : ""}${back ? "back" : ""}`, { onpointerdown: reordering(layer, store.state.layers.length) });
}

/** @param {any} group @param {number} depth */
function groupRow(group, depth) {
  return row(group, [h("span", { class: "indent", style: `width:${depth * 14}px` }), h("span", { class: "folder" }, icon("group", 15)), nameOf(group),
    button({ icon: "ungroup", label: `Ungroup ${group.name}`, class: "quiet", size: 14, onclick: () => edit([{ op: "ungroup", name: group.name }]) })], "group");
}

/** @param {any} region @param {number} total */
function regionRow(region, total) {
  return row(region, [
    h("span", { class: "swatch", style: `--c:${colourOf(region)}` }), nameOf(region),
    h("span", { class: "share" }, `${((100 * region.area) / total).toFixed(region.area / total < 0.1 ? 1 : 0)}\u2009%`),
    region.back ? h("span", { class: "gap" }) : button({ icon: "trash-2", label: `Remove ${region.name}`, class: "quiet", size: 14, onclick: () => regions("remove", { name: region.name }) }),
  ], region.back ? "back region-row" : "region-row", region.back ? {} : { onpointerdown: reordering(region, store.state.regions.length) });
}

function build() {
  const { state } = store;
  if (root.querySelector(".rename") || document.body.classList.contains("dragging")) return;
  const focused = root.contains(document.activeElement);
  const list = [];
  if (state.stage === "pointing") {
    const total = state.size[0] * state.size[1];
    for (const region of [...state.regions].reverse()) list.push(regionRow(region, total));
  } else {
    const groups = new Map((state.groups ?? []).map((/** @type {any} */ g) => [g.name, g])), shown = new Set();
    for (const layer of [...(state.layers ?? [])].reverse()) {
      const above = ancestors(layer.name).filter((n) => groups.has(n)).reverse();
      above.forEach((name, depth) => { if (!shown.has(name)) { shown.add(name); list.push(groupRow(groups.get(name), depth)); } });
      list.push(layerRow(layer, above.length));
    }
  }
  root.replaceChildren(...list);
  if (focused) root.focus({ preventScroll: true });
}

root.addEventListener("keydown", (/** @type {KeyboardEvent} */ e) => {
  const names = rows(), at = names.findIndex((n) => store.selected.has(n));
  if (e.key === "ArrowDown" || e.key === "ArrowUp") {
    e.preventDefault();
    e.stopPropagation();
    const by = e.key === "ArrowDown" ? 1 : -1;
    if (e.altKey) {
      const items = store.state.stage === "pointing" ? store.state.regions : store.state.layers;
      const item = items.find((/** @type {any} */ l) => l.name === names[at]);
      const to = item && item.index - by;
      if (item && to >= 0 && to < items.length) reorder(item, to);
    } else if (names.length) select([names[Math.min(names.length - 1, Math.max(0, at + by))]]);
  }
  if (e.key === "Enter" || e.key === "F2") { e.preventDefault(); e.stopPropagation(); if (at >= 0) renaming(names[at]); }
});

on("state list", build);
on("state", (before) => { if (before.file !== store.state.file) images.clear(); });
on("selection hover", () => {
  for (const r of /** @type {any} */ (root.querySelectorAll(".layer"))) {
    r.classList.toggle("on", store.selected.has(r.dataset.name));
    r.setAttribute("aria-selected", store.selected.has(r.dataset.name));
    r.classList.toggle("over", store.hovered === r.dataset.name);
  }
  root.querySelector(".layer.on")?.scrollIntoView({ block: "nearest" });
});
