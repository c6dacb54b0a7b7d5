/** The history, to jump in; and the same as a command line and in Python. */
import { jump } from "../actions.js";
import { button, copy, h, icon } from "../dom.js";
import { on, store } from "../store.js";

export const steps = h("div", { class: "history", role: "listbox", "aria-label": "History, oldest first", tabIndex: 0 });
export const code = h("div", { class: "code" });

function build() {
  const { state } = store;
  const rows = [{ label: `Opened ${state.file ?? ""}`, flags: "" }, ...(state.history ?? [])];
  steps.replaceChildren(...(state.stage === "editing" ? rows.map((step, i) => h("button", {
    type: "button", class: `step${i === state.at ? " now" : i > state.at ? " undone" : ""}`, role: "option", "aria-selected": i === state.at, title: step.flags || step.label,
    onclick: () => { if (i !== state.at) jump(i); },
  }, icon(i === state.at ? "chevron-right" : i ? "check" : "image", 13), h("span", {}, step.label))) : [h("p", { class: "note" }, "Edits will be listed here, each to go back to.")]));
  steps.querySelector(".now")?.scrollIntoView({ block: "nearest" });
  const blocks = [["Command line", state.command], ["Python", state.python]].filter(([, text]) => text);
  code.replaceChildren(...blocks.map(([title, text]) => {
    const done = button({ icon: "clipboard", label: `Copy ${title}`, class: "quiet copy", size: 14, onclick: () => copy(done, text) });
    return h("section", {}, h("h3", {}, title, done), h("pre", { tabIndex: 0, "aria-label": title }, text));
  }), ...(blocks.length ? [] : [h("p", { class: "note" }, "What you do is shown here as a command line and as Python.")]));
}

on("state", build);
steps.addEventListener("keydown", (/** @type {KeyboardEvent} */ e) => {
  const by = e.key === "ArrowDown" ? 1 : e.key === "ArrowUp" ? -1 : 0, to = store.state.at + by;
  if (by && to >= 0 && to <= store.state.history.length) { e.preventDefault(); e.stopPropagation(); jump(to); }
});
