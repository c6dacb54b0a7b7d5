"""A studio with its server and a browser, worked by mouse and keyboard as people do."""

import contextlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.support.paths import ROOT

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)

PATIENCE = 180.0
"""Seconds to wait for anything; only broken tests wait that long."""

OVERLAPS = """() => {
  const seen = (e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: false });
  const boxes = [...document.querySelectorAll("button, input, select, h1, h2, h3, .note, .name")]
    .filter((e) => seen(e) && !e.closest(".away") && !e.closest("[hidden]"));
  const rect = (e) => e.getBoundingClientRect();
  const clip = (e) => {
    let { left, top, right, bottom } = rect(e);
    for (let p = e.parentElement; p; p = p.parentElement) {
      if (getComputedStyle(p).overflow === "visible") continue;
      const r = rect(p);
      [left, top, right, bottom] = [Math.max(left, r.left), Math.max(top, r.top),
        Math.min(right, r.right), Math.min(bottom, r.bottom)];
    }
    return { left, top, right, bottom };
  };
  const found = [], name = (e) => e.id || e.ariaLabel || e.textContent.slice(0, 30) || e.tagName;
  boxes.forEach((a, i) => {
    const r = clip(a);
    if (r.right - r.left < 1 || r.bottom - r.top < 1) return;
    if (r.right > innerWidth + 0.5 || r.bottom > innerHeight + 0.5) found.push(`${name(a)} is cut`);
    for (const b of boxes.slice(i + 1)) {
      const q = clip(b), over = (e) => e.closest(".float")?.className;
      if (a.contains(b) || b.contains(a) || over(a) !== over(b)) continue;
      const w = Math.min(r.right, q.right) - Math.max(r.left, q.left);
      const h = Math.min(r.bottom, q.bottom) - Math.max(r.top, q.top);
      if (w > 1 && h > 1) found.push(`${name(a)} over ${name(b)}`);
    }
  });
  return found;
}"""
"""Finds controls and texts of the page that overlap, or are cut off by the window."""


@contextlib.contextmanager
def served(folder: Path, *arguments: str) -> Iterator[str]:
    """Address of a server that keeps its sessions in `folder`; it is ended afterwards."""
    code = "import sys; from proxyimg_codec.cli.studio import main; sys.exit(main())"
    command = [sys.executable, "-c", code, *arguments]
    command += ["--no-browser", "--stay", "--quiet", "--autosave", str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    assert process.stdout is not None
    try:
        yield process.stdout.readline().strip()
    finally:
        process.terminate()
        process.wait(PATIENCE)
        process.stdout.close()


class Studio:
    """The page of a studio.

    Args:
        page: Page of playwright.
        pictures: Folder of screenshots; that of the variable PXI_SCREENSHOTS, if it is set.
    """

    def __init__(self, page: Any, pictures: Path) -> None:
        self.page = page
        self.pictures = Path(os.environ.get("PXI_SCREENSHOTS", pictures))
        self.problems: list[str] = []
        page.on("pageerror", lambda error: self.problems.append(str(error)))
        page.on("console", self._heard)

    def _heard(self, message: Any) -> None:
        if message.type == "error" and "422" not in message.text:  # what was refused is said
            self.problems.append(message.text)

    def ask(self, expression: str) -> Any:
        """Value of a JavaScript expression."""
        return self.page.evaluate(expression)

    @property
    def state(self) -> dict[str, Any]:
        """State of the server, as the page knows it."""
        found: dict[str, Any] = self.ask("studio.store.state")
        return found

    def until(self, expression: str, seconds: float = PATIENCE) -> None:
        """Waits until an expression is true."""
        end = time.monotonic() + seconds
        while not self.ask(expression):
            assert time.monotonic() < end, f"{expression} is false for {seconds} s: {self.said}"
            self.page.wait_for_timeout(20)

    @property
    def said(self) -> str:
        """Message that the page shows, or nothing."""
        found: str = self.ask("document.querySelector('.message:not([hidden])')?.innerText ?? ''")
        return found

    def after(self, action: Callable[[], Any]) -> dict[str, Any]:
        """State after an action that changes it."""
        version = self.state["version"]
        action()
        self.until(f"studio.store.state.version > {version}")
        return self.state

    def drop(self, path: Path) -> None:
        """Drops a file onto the middle of the window, as from another program."""
        session = self.page.context.new_cdp_session(self.page)
        size = self.page.viewport_size
        data = {"items": [], "files": [str(path)], "dragOperationsMask": 1}
        for kind in ("dragEnter", "dragOver", "dragOver", "dragOver", "drop"):
            place = {"x": size["width"] / 2, "y": size["height"] / 2}
            session.send("Input.dispatchDragEvent", {"type": kind, **place, "data": data})
            self.page.wait_for_timeout(60)
        session.detach()

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Place in the window of a point of the canvas."""
        left, top = self.ask(
            f"(([x, y], r) => [x + r.left, y + r.top])(studio.view.toScreen({x}, {y}),"
            " document.querySelector('.stage').getBoundingClientRect())"
        )
        return left, top

    def click(self, x: float, y: float) -> None:
        """Clicks a point of the canvas."""
        self.page.mouse.click(*self.at(x, y))

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> None:
        """Drags from a point of the canvas to another one."""
        self.page.mouse.move(*self.at(*start))
        self.page.mouse.down()
        self.page.mouse.move(*self.at(*end), steps=steps)
        self.page.mouse.up()

    def press(self, keys: str) -> None:
        """Presses keys."""
        self.page.keyboard.press(keys)

    def type(self, text: str) -> None:
        """Types a text and Enter."""
        self.page.keyboard.type(text)
        self.page.keyboard.press("Enter")

    def row(self, name: str) -> Any:
        """Row of a layer in the list."""
        return self.page.locator(f'.layers .layer[data-name="{name}"]')

    def shoot(self, name: str) -> None:
        """Takes a screenshot in both themes, and checks that nothing overlaps."""
        for theme in ("light", "dark"):
            self.ask(f"document.documentElement.dataset.theme = '{theme}'")
            self.pictures.mkdir(parents=True, exist_ok=True)
            self.page.screenshot(path=self.pictures / f"{name}-{theme}.png")
        assert self.page.evaluate(OVERLAPS) == [], name


@contextlib.contextmanager
def opened(
    address: str, pictures: Path, size: tuple[int, int] = (1280, 800), query: str = ""
) -> Iterator[Studio]:
    """A studio in headless Chromium; it must have had no problem in the end."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        page.set_default_timeout(1000 * PATIENCE)
        studio = Studio(page, pictures)
        page.goto(address)
        if query:
            page.goto(page.url + query)
        studio.until("window.studio?.store.state.version >= 0")
        yield studio
        assert studio.problems == []
        browser.close()
