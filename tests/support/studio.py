"""A studio with its server and a browser, worked by mouse, fingers and keyboard as people do.

With the variable PXI_SCREENSHOTS, the name of a folder, pictures are taken of what a test does.
"""

import base64
import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.support.paths import ROOT

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)

SMALL, LARGE = (900, 600), (1280, 800)
"""Windows: the smallest that the studio works in, and one of a desktop."""

CLOSE = """fetch("/api/close", { method: "POST", body: "{}",
  headers: { "Content-Type": "application/json" } }).then((answer) => answer.status)"""

PATIENCE = 120.0
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
  const text = (e) => e.tagName === "BUTTON" && e.innerText.trim();
  const said = (e) => e.ariaLabel || e.labels?.length || text(e);
  for (const e of boxes)
    if (e.matches("button, input, select") && !said(e)) found.push(`${name(e)} has no label`);
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
"""Finds controls and texts that overlap, are cut off by the window, or have no label."""


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
    """

    def __init__(self, page: Any) -> None:
        self.page = page
        self.problems: list[str] = []
        page.on("request", self._asked)
        page.on("pageerror", lambda error: self.problems.append(str(error)))
        page.on("console", self._heard)

    def _heard(self, message: Any) -> None:
        if message.type == "error" and "422" not in message.text:  # what was refused is said
            self.problems.append(message.text)

    def _asked(self, request: Any) -> None:
        if not re.match(r"http://127\.0\.0\.1:|blob:|data:", request.url):
            self.problems.append(f"a request that leaves the machine: {request.url}")

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
            self.page.wait_for_timeout(60)

    @property
    def said(self) -> str:
        """Message that the page shows, or nothing."""
        found: str = self.ask("document.querySelector('.message:not([hidden])')?.innerText ?? ''")
        return found

    def hears(self, text: str) -> None:
        """Waits for a message that has a text."""
        self.until(f"(document.querySelector('.message:not([hidden])')?.innerText ?? '')"
                   f".includes({json.dumps(text)})")  # fmt: skip

    def after(self, action: Callable[[], Any]) -> dict[str, Any]:
        """State after an action that changes it."""
        version = self.state["version"]
        action()
        self.until(f"studio.store.state.version > {version}")
        return self.state

    def drop(self, path: Path, where: tuple[float, float] | None = None) -> None:
        """Drops a file onto a place of the window, by default its middle, as another program."""
        size = self.page.viewport_size
        x, y = where or (size["width"] / 2, size["height"] / 2)
        data = {"items": [], "files": [str(path)], "dragOperationsMask": 1}
        with self._devtools() as send:
            for kind in ("dragEnter", "dragOver", "dragOver", "dragOver", "drop"):
                send("Input.dispatchDragEvent", {"type": kind, "x": x, "y": y, "data": data})
                self.page.wait_for_timeout(60)

    def choose(self, path: Path, action: Callable[[], Any]) -> None:
        """Does what asks for a file, and chooses one."""
        with self.page.expect_file_chooser() as asked:
            action()
        asked.value.set_files(path)

    def paste(self, path: Path) -> None:
        """Pastes a PNG file that another program has copied."""
        self.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        coded = base64.b64encode(path.read_bytes()).decode()
        self.page.evaluate(
            "(coded) => { const bytes = Uint8Array.from(atob(coded), (c) => c.charCodeAt(0));"
            "return navigator.clipboard.write([new ClipboardItem({"
            "'image/png': new Blob([bytes], { type: 'image/png' })})]); }",
            coded,
        )
        self.press("Control+v")

    def pinch(self, x: float, y: float, start: float, end: float) -> None:
        """Puts two fingers beside a point of the canvas, `start` pixels apart, and spreads them."""
        cx, cy = self.at(x, y)
        with self._devtools() as send:
            send("Emulation.setTouchEmulationEnabled", {"enabled": True, "maxTouchPoints": 2})
            for k in range(6):
                half = (start + (end - start) * max(k - 1, 0) / 4) / 2
                both = [{"x": cx + way * half, "y": cy, "id": way + 1} for way in (-1, 1)]
                kind = "touchMove" if k > 1 else "touchStart"
                send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": both[: k + 1]})
            send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    def slide(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drags with one finger from a point of the canvas to another one."""
        (x0, y0), (x1, y1) = self.at(*start), self.at(*end)
        with self._devtools() as send:
            send("Emulation.setTouchEmulationEnabled", {"enabled": True, "maxTouchPoints": 2})
            for k in range(6):
                t = k / 5
                finger = {"x": x0 + t * (x1 - x0), "y": y0 + t * (y1 - y0), "id": 0}
                kind = "touchMove" if k else "touchStart"
                send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [finger]})
            send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    @contextlib.contextmanager
    def _devtools(self) -> Iterator[Callable[[str, dict[str, Any]], Any]]:
        session = self.page.context.new_cdp_session(self.page)
        try:
            yield session.send
        finally:
            session.detach()

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Place in the window of a point of the canvas."""
        left, top = self.ask(
            f"(([x, y], r) => [x + r.left, y + r.top])(studio.view.toScreen({x}, {y}),"
            " document.querySelector('.stage').getBoundingClientRect())"
        )
        return left, top

    def middle(self, selector: str) -> tuple[float, float]:
        """Place in the window of the first element of a selector, which may be drawn anew."""
        x, y = self.ask(
            f"((r) => [r.x + r.width / 2, r.y + r.height / 2])(document.querySelector('{selector}')"
            ".getBoundingClientRect())"
        )
        return x, y

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

    def shrink(self) -> None:
        """Shows the picture at 100 %, where drawing it costs less, unless somebody will look."""
        if not os.environ.get("PXI_SCREENSHOTS"):
            self.press("1")

    def look(self, name: str) -> None:
        """Checks what `OVERLAPS` finds; takes pictures in both themes if they are asked for."""
        assert self.page.evaluate(OVERLAPS) == [], name
        if not os.environ.get("PXI_SCREENSHOTS"):
            return
        size, theme = self.page.viewport_size, self.ask("document.documentElement.dataset.theme")
        for width, height in (LARGE, (size["width"], size["height"])):
            self.page.set_viewport_size({"width": width, "height": height})
            self.page.wait_for_timeout(400)
            for shown in ("light", "dark"):
                self.ask(f"document.documentElement.dataset.theme = '{shown}'")
                file = Path(os.environ["PXI_SCREENSHOTS"]) / f"{name}-{width}-{shown}.png"
                self.page.screenshot(path=file)
        self.ask(f"document.documentElement.dataset.theme = '{theme}'")


@contextlib.contextmanager
def chromium() -> Iterator[Any]:
    """Headless Chromium, as an object of playwright."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@contextlib.contextmanager
def opened(
    browser: Any, address: str, size: tuple[int, int] = SMALL, query: str = ""
) -> Iterator[Studio]:
    """Page of a studio, of which nothing is open; it must have had no problem in the end."""
    context = browser.new_context(viewport={"width": size[0], "height": size[1]})
    page = context.new_page()
    page.set_default_timeout(1000 * PATIENCE)
    studio = Studio(page)
    page.goto(address)
    if query:
        page.goto(page.url + query)
    studio.until("window.studio?.store.state.version >= 0")
    try:
        yield studio
        assert studio.problems == []
    finally:
        studio.ask(CLOSE)
        context.close()
