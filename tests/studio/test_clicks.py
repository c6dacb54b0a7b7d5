"""All that a newcomer does with the studio, by mouse and keyboard in a real browser."""

import json

import numpy as np
import pytest
from PIL import Image

import proxyimg_codec as pxi
from tests.support.studio import CHROMIUM, opened, served

pytest.importorskip("playwright.sync_api", reason="not installed: playwright")

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed"),
    pytest.mark.slow,
]

SIZE = (381, 254)
RED, BLUE, EMPTY = (270, 190), (100, 190), (30, 20)
"""Points of the canvas: in the red parrot, in the other one, and in what lies behind."""


@pytest.fixture(scope="module")
def photo(tmp_path_factory):
    """Two parrots, small."""
    from tests.support.paths import DATA

    if not DATA.is_dir():
        pytest.skip("the shared pictures are not here")
    path = tmp_path_factory.mktemp("photo") / "parrots.png"
    Image.open(DATA / "kodak" / "kodim23.png").resize(SIZE, Image.Resampling.LANCZOS).save(path)
    return path


@pytest.fixture(scope="module")
def layered(photo):
    """The same with three layers, encoded."""
    pixels = np.asarray(Image.open(photo))
    regions = pxi.find_layers(pixels, points={"red": [RED], "blue": [BLUE, (75, 95)]})
    path = photo.with_suffix(".pxi")
    pxi.encode(pixels, masks=regions, effort=1).save(path)
    return path


def test_from_a_dropped_photograph_to_a_saved_file(photo, tmp_path):
    with served(tmp_path / "kept") as address, opened(address, tmp_path) as studio:
        page = studio.page
        studio.shoot("1-empty")
        studio.drop(photo)
        studio.until("studio.store.state.regions?.length > 1")
        page.wait_for_timeout(300)
        studio.shoot("2-found")
        page.click("#got-it")

        # A thing that was found gets a name in the list.
        studio.click(*RED)
        name = studio.ask("[...studio.store.selected][0]")
        studio.row(name).locator(".name").dblclick()
        studio.after(lambda: studio.type("red parrot"))
        # One that was not is pointed at, and named on the spot.
        for region in studio.state["regions"]:
            if region["name"] not in ("back", "red parrot"):
                studio.after(studio.row(region["name"]).get_by_label("Remove").click)
        page.keyboard.press("Escape")
        studio.after(lambda: studio.click(*BLUE))
        page.wait_for_selector(".christen input")
        studio.shoot("3-named")
        studio.after(lambda: studio.type("blue parrot"))
        assert {r["name"] for r in studio.state["regions"]} == {"back", "red parrot", "blue parrot"}

        page.click("#encode")
        page.wait_for_selector(".encoding progress")
        studio.shoot("4-encoding")
        studio.until("studio.store.state.stage === 'editing'")
        page.click("#got-it")
        studio.until("studio.ready()")

        # Pulled, bent, undone, redone.
        studio.click(*RED)
        studio.after(lambda: studio.drag(RED, (RED[0] - 40, RED[1] - 10)))
        page.wait_for_selector(".exact:not([hidden])")
        studio.shoot("5-moved")
        first = studio.state["history"][0]["op"]
        assert (first["op"], first["by"]) == ("move", pytest.approx([-40, -10], abs=1))
        studio.after(page.locator("#undo").click)
        studio.after(page.locator("#redo").click)

        # What another one hid appears when that is removed.
        studio.click(*BLUE)
        studio.after(lambda: studio.press("Delete"))
        assert "blue parrot removed" in studio.said
        studio.shoot("6-removed")
        with page.expect_download() as download:
            page.click("#save")
        saved = download.value.path().read_bytes()
        state = json.loads(studio.ask("fetch('/api/state').then((answer) => answer.text())"))

    image = pxi.from_bytes(saved)
    assert [layer.name for layer in image.layers] == ["back", "red parrot"]
    edits = [step["op"] for step in state["history"]]
    assert [e["op"] for e in edits] == ["move", "remove"]
    assert image.undone(2).edited(*edits).to_bytes() == saved


def test_pointing_tools(photo, tmp_path):
    with served(tmp_path / "kept", str(photo)) as address, opened(address, tmp_path) as studio:
        page = studio.page

        def regions():
            return {r["name"]: r for r in studio.state["regions"] if not r["back"]}

        def made(action):
            before = set(regions())
            studio.after(action)
            page.wait_for_selector(".christen input")
            page.keyboard.press("Escape")
            (name,) = set(regions()) - before
            return name

        studio.until("studio.store.state.regions?.length > 1")
        page.click("#got-it")
        for name in regions():
            studio.after(studio.row(name).get_by_label("Remove").click)
        studio.press("r")
        boxed = made(lambda: studio.drag((195, 50), (378, 250)))
        studio.press("s")
        scribbled = made(lambda: studio.drag((90, 170), (110, 230)))
        studio.shoot("20-pointing")

        # Brush and eraser are exact: they change the chosen one, where they go.
        def area(name):
            return regions()[name]["area"]

        before = area(scribbled)
        studio.press("b")
        studio.after(lambda: studio.drag((20, 200), (50, 200)))
        grown = area(scribbled)
        assert grown > before
        studio.press("e")
        studio.after(lambda: studio.drag((20, 200), (50, 200)))
        assert area(scribbled) == pytest.approx(before, abs=2)
        studio.after(lambda: studio.press("Control+z"))
        assert area(scribbled) == grown
        studio.row(boxed).click()
        studio.row(scribbled).click(modifiers=["Control"])
        studio.after(page.get_by_role("button", name="Merge both").click)
        assert len(regions()) == 1


def test_tools_of_the_canvas(layered, tmp_path):
    with served(tmp_path / "kept", str(layered)) as address, opened(address, tmp_path) as studio:
        page = studio.page
        page.click("#got-it")
        studio.until("studio.ready()")
        studio.click(*RED)
        assert studio.ask("[...studio.store.selected]") == ["red"]
        assert "red" in page.locator(".layer.on").inner_text()
        page.wait_for_selector(".overlay .handle")

        # Corner, side with Ctrl, knob: scale, shear, rotate.
        def box():
            return page.locator(".overlay polygon.box").bounding_box()

        def pull(x, y, dx, dy, *keys):
            for key in keys:
                page.keyboard.down(key)
            page.mouse.move(x, y)
            page.mouse.down()
            page.mouse.move(x + dx, y + dy, steps=6)
            page.mouse.up()
            for key in keys:
                page.keyboard.up(key)

        def kept(action):
            count = studio.state["at"]
            studio.after(action)
            page.wait_for_timeout(150)
            return [step["op"] for step in studio.state["history"][count:]]

        b = box()
        (scaled,) = kept(lambda: pull(b["x"], b["y"], 30, 20))
        assert scaled["op"] == "scale"
        assert scaled["by"][0] == pytest.approx(scaled["by"][1])
        assert scaled["by"][0] < 1
        studio.after(lambda: studio.press("Control+z"))
        page.wait_for_timeout(150)
        b = box()
        (slanted,) = kept(lambda: pull(b["x"] + b["width"] / 2, b["y"], 25, 0, "Control"))
        assert slanted["op"] == "shear"
        assert slanted["by"][0] != 0
        studio.after(lambda: studio.press("Control+z"))
        page.wait_for_timeout(150)
        b = box()
        (turned,) = kept(lambda: pull(b["x"] + b["width"] / 2, b["y"] - 24, 60, 10, "Shift"))
        assert turned["op"] == "rotate"
        assert turned["degrees"] % 15 == 0
        assert turned["degrees"] > 0
        (nudged,) = kept(lambda: (studio.press("ArrowLeft"), studio.press("Shift+ArrowUp")))
        assert (nudged["op"], nudged["by"]) == ("move", [-1, -10])
        studio.shoot("7-turned")

        # Pins: three are set, one of them is dragged; the outline follows.
        page.click("#tool-pins")
        x0, y0, x1, y1 = next(v["bounds"] for v in studio.state["layers"] if v["name"] == "red")
        x, y, width, height = x0, y0, x1 - x0, y1 - y0
        studio.until("document.querySelector('.overlay .mesh')")
        for u, v in ((0.35, 0.9), (0.6, 0.85), (0.5, 0.2)):
            studio.click(x + u * width, y + v * height)
        studio.until("document.querySelectorAll('.overlay .pin').length === 3")
        start = (x + 0.5 * width, y + 0.2 * height)
        (bent,) = kept(lambda: studio.drag(start, (start[0] - 30, start[1] - 10)))
        assert bent["op"] == "drag"
        assert len(bent["handles"]) == 3
        assert [h[2:] == [0, 0] for h in bent["handles"]] == [True, True, False]
        studio.shoot("8-bent")

        # Points of the outline.
        studio.press("b")
        studio.until("document.querySelectorAll('.overlay .handle').length > 3")
        handle = page.locator(".overlay .handle").first.bounding_box()
        middle = (handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2)
        moved = kept(lambda: pull(*middle, 12, 9))
        assert {e["op"] for e in moved} == {"point"}
        assert len(moved) == 3
        studio.shoot("9-points")
        studio.press("v")

        # A part is cut out; a name is typed; the code and the history show it all.
        page.click("#tab-history")
        steps = page.locator(".step")
        assert steps.count() == studio.state["at"] + 1
        studio.shoot("10-history")
        studio.after(steps.nth(1).click)
        assert studio.state["at"] == 1
        page.click("#tab-code")
        assert "--rotate" in page.locator("pre").first.inner_text()
        studio.shoot("11-code")


def test_layers_in_the_list(layered, tmp_path):
    with served(tmp_path / "kept", str(layered)) as address, opened(address, tmp_path) as studio:
        page = studio.page
        page.click("#got-it")
        studio.until("studio.ready()")

        def layers():
            return [layer["name"] for layer in studio.state["layers"]]

        def pull(start, end):
            a, b = start.bounding_box(), end.bounding_box()
            page.mouse.move(a["x"] + a["width"] / 2, a["y"] + a["height"] / 2)
            page.mouse.down()
            page.mouse.move(b["x"] + b["width"] / 2, b["y"] + b["height"] - 3, steps=6)
            page.mouse.up()

        front, behind = layers()[:0:-1]
        studio.after(lambda: pull(studio.row(front).locator(".name"), studio.row(behind)))
        assert layers() == ["back", front, behind]
        studio.after(studio.row("red").get_by_label("Hide").click)
        assert next(v for v in studio.state["layers"] if v["name"] == "red")["hidden"]
        studio.after(studio.row("red").get_by_label("Show").click)
        studio.row("red").get_by_label("Lock").click()
        studio.click(*RED)
        assert studio.ask("[...studio.store.selected]") == ["back"]
        studio.row("red").get_by_label("Unlock").click()

        # The texture of one on the other, and another colour.
        studio.after(lambda: pull(studio.row("blue").locator(".thumb"), studio.row("red")))
        assert studio.state["history"][-1]["op"]["op"] == "texture"
        studio.click(*RED)
        studio.ask("document.activeElement.blur()")
        page.get_by_label("Hue").focus()
        studio.after(lambda: studio.press("PageUp"))
        assert studio.state["history"][-1]["op"]["op"] == "recolour"
        page.get_by_label("Opacity", exact=True).focus()
        studio.after(lambda: studio.press("PageDown"))
        assert studio.state["history"][-1]["op"]["op"] == "opacity"

        # Two become a group, and are named.
        studio.press("Escape")
        page.locator(".stage").focus()
        studio.press("Control+a")
        studio.after(lambda: studio.press("Control+g"))
        studio.after(lambda: studio.type("birds"))
        assert [g["name"] for g in studio.state["groups"]] == ["birds"]
        studio.after(lambda: studio.press("Control+z"))
        studio.shoot("12-list")

        # What is wrong is said in place.
        studio.row("red").locator(".name").dblclick()
        studio.type("blue")
        studio.until("document.querySelector('.message.error:not([hidden])')")
        assert "blue" in studio.said
        studio.shoot("13-error")


def test_motion(layered, tmp_path):
    with served(tmp_path / "kept", str(layered)) as address, opened(address, tmp_path) as studio:
        page = studio.page
        page.click("#got-it")
        studio.until("studio.ready()")
        page.click("#mode-motion")
        page.get_by_role("button", name="Sway").click()
        studio.until("studio.player.running && studio.player.time > 0.2")
        studio.press(" ")
        studio.until("!studio.player.running")
        studio.shoot("14-motion")
        page.get_by_role("button", name="Left", exact=True).click()
        page.click("#tool-keep")
        studio.click(*RED)
        studio.until("!studio.player.busy")
        studio.press("v")

        # A handle with a key: at half a second it is dragged.
        page.click("#tool-handle")
        studio.click(RED[0], RED[1] - 60)
        ruler = page.locator(".tracks").bounding_box()
        page.mouse.click(ruler["x"] + ruler["width"] / 8, ruler["y"] + 12)
        studio.drag((RED[0], RED[1] - 60), (RED[0] - 15, RED[1] - 70))
        studio.until("document.querySelectorAll('.tracks .key').length === 2")
        studio.until("studio.player.running && !studio.player.busy")
        studio.press(" ")
        page.get_by_label("Onion skin").click()
        page.wait_for_timeout(100)
        studio.shoot("15-keys")
        studio.after(page.locator("#keep-motion").click)
        kept = studio.state["history"][-1]["op"]
        assert kept["op"] == "animate"
        assert len(kept["motion"]["layers"]["red"]["handles"][0]["keys"]) == 2
        assert studio.state["timeline"]["seconds"] == 4

        # A clip of it.
        page.click("#mode-edit")
        page.click("#export")
        page.locator(".kind", has_text="GIF").click()
        studio.shoot("16-export")
        with page.expect_download() as download:
            page.click("#do-export")
        with Image.open(download.value.path()) as clip:
            assert clip.n_frames > 20


def test_small_window_drawn_by_webgl(layered, tmp_path):
    with (
        served(tmp_path / "kept", str(layered)) as address,
        opened(address, tmp_path, size=(900, 600), query="?draw=gl") as studio,
    ):
        studio.shoot("17-small")
        studio.page.click("#got-it")
        studio.until("studio.ready()")
        studio.click(*RED)
        studio.page.wait_for_selector(".overlay .handle")
        studio.shoot("18-small-chosen")
        studio.after(lambda: studio.drag(RED, (RED[0] - 20, RED[1])))
        studio.page.click("#mode-motion")
        studio.shoot("19-small-motion")
