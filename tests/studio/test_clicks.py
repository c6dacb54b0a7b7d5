"""All that people do with the studio, by mouse, fingers and keyboard in a real browser.

`test_a_newcomer_does_everything_once` is one way through all of it, by one who was told nothing.
"""

import io
import json

import numpy as np
import pytest
from PIL import Image

import proxyimg_codec as pxi
from proxyimg_codec.export import photoshop
from tests.support.studio import CHROMIUM, chromium, opened, served

pytest.importorskip("playwright.sync_api", reason="not installed: playwright")

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed"),
    pytest.mark.slow,
]

EXPORTED = """fetch("/api/export?wait", { method: "POST", body: '{"kind": "html"}',
  headers: { "Content-Type": "application/json" } }).then((answer) => answer.json())
  .then((made) => fetch(made.result.url)).then((answer) => answer.text())"""

BOX = "document.querySelector('.overlay polygon.box').getBoundingClientRect().toJSON()"

SIZE = (261, 174)
RED, BLUE, EMPTY = (185, 130), (68, 130), (20, 14)
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
def studio_at(tmp_path_factory):
    """One server and one browser for all tests: studio_at() -> page with nothing open."""
    with served(tmp_path_factory.mktemp("kept")) as address, chromium() as browser:
        yield lambda **more: opened(browser, address, **more)


def test_a_newcomer_does_everything_once(studio_at, photo, tmp_path, monkeypatch):
    with studio_at() as studio:
        open_and_point(studio, photo)
        correct_regions(studio)
        make_editable(studio)
        pull(studio)
        bend(studio)
        shape(studio)
        use_the_list(studio, photo)
        fill_what_was_removed(studio)
        animate(studio)
        go_back_and_forth(studio)
        export(studio)
        saved, edits = save(studio)
    image = pxi.from_bytes(saved)
    monkeypatch.chdir(photo.parent)  # edits name the picture that was added
    assert image.undone(len(edits)).edited(*edits).to_bytes() == saved


def open_and_point(studio, photo):
    page = studio.page
    studio.look("1-empty")
    studio.drop(photo)
    studio.until("studio.store.state.found")
    studio.shrink()
    studio.look("2-found")
    page.click("#got-it")

    # What was found gets a name in the list, or goes.
    studio.click(*RED)
    name = studio.ask("[...studio.store.selected][0]")
    studio.row(name).locator(".name").dblclick()
    studio.after(lambda: studio.type("red"))
    for region in studio.state["regions"]:
        if region["name"] not in ("back", "red"):
            studio.after(studio.row(region["name"]).get_by_label("Remove").click)
    # What was not found is pointed at, and named on the spot.
    page.keyboard.press("Escape")
    studio.after(lambda: studio.click(*BLUE))
    page.wait_for_selector(".christen input")
    studio.look("3-named")
    studio.after(lambda: studio.type("blue"))
    assert {r["name"] for r in studio.state["regions"]} == {"back", "red", "blue"}


def correct_regions(studio):
    """Box and scribble make regions, scissors split them; brush and eraser are exact."""

    def regions():
        return {r["name"]: r["area"] for r in studio.state["regions"] if not r["back"]}

    def made(action):
        before = set(regions())
        studio.after(action)
        studio.page.wait_for_selector(".christen input")
        studio.press("Escape")
        (name,) = set(regions()) - before
        return name

    studio.press("s")
    scribbled = made(lambda: studio.drag((20, 20), (60, 14)))
    studio.press("r")
    boxed = made(lambda: studio.drag((135, 35), (258, 170)))
    studio.look("4-pointing")
    for name in (scribbled, boxed):
        studio.after(lambda: studio.press("Control+z"))
        assert name in regions() or name == boxed
    studio.row("blue").click()
    before = regions()["blue"]
    studio.press("b")
    studio.after(lambda: studio.drag((20, 30), (40, 30)))
    assert regions()["blue"] > before
    studio.press("e")
    studio.after(lambda: studio.drag((20, 30), (40, 30)))
    assert regions()["blue"] == pytest.approx(before, abs=2)
    studio.press("x")
    part = made(lambda: studio.click(205, 55))
    assert part.startswith("red")
    studio.row("red").click()
    studio.row(part).click(modifiers=["Control"])
    studio.after(studio.page.get_by_role("button", name="Merge both").click)
    assert set(regions()) == {"red", "blue"}


def make_editable(studio):
    page = studio.page
    page.locator(".encoding input").nth(1).focus()
    studio.press("Home")  # the least effort
    page.click("#encode")
    page.wait_for_selector(".encoding progress")
    studio.until("studio.store.state.stage === 'editing'")
    studio.hears("pixels in")
    page.click("#got-it")
    studio.until("studio.ready()")
    page.locator(".stage").focus()
    studio.shrink()


def kept(studio, action):
    """Edits that an action makes."""
    count = studio.state["at"]
    studio.after(action)
    studio.page.wait_for_timeout(120)
    return [step["op"] for step in studio.state["history"][count:]]


def stroke(studio, x, y, dx, dy, *keys):
    """Drags from a place of the window, with keys held."""
    mouse, keyboard = studio.page.mouse, studio.page.keyboard
    for key in keys:
        keyboard.down(key)
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + dx, y + dy, steps=5)
    mouse.up()
    for key in keys:
        keyboard.up(key)


def pull(studio):
    """The box of a layer: moves, scales, turns, slants; by numbers and arrow keys, too."""
    page = studio.page
    page.mouse.move(*studio.at(*RED))
    studio.until("studio.store.hovered === 'red'")
    studio.click(*RED)
    assert studio.ask("[...studio.store.selected]") == ["red"]
    (moved,) = kept(studio, lambda: studio.drag(RED, (RED[0] - 30, RED[1] - 8)))
    assert (moved["op"], moved["by"]) == ("move", pytest.approx([-30, -8], abs=1))
    page.wait_for_selector(".exact:not([hidden])")
    studio.look("5-moved")

    def box():
        return studio.ask(BOX)

    def undo():
        studio.after(lambda: studio.press("Control+z"))
        page.wait_for_timeout(120)

    b = box()
    (scaled,) = kept(studio, lambda: stroke(studio, b["x"], b["y"], 30, 20))
    assert scaled["op"] == "scale"
    assert scaled["by"][0] == pytest.approx(scaled["by"][1])
    assert scaled["by"][0] < 1
    undo()
    (freely,) = kept(studio, lambda: stroke(studio, b["x"], b["y"], 30, 2, "Shift", "Alt"))
    assert freely["by"][0] < freely["by"][1]
    undo()
    slant = kept(studio, lambda: stroke(studio, b["x"] + b["width"] / 2, b["y"], 25, 0, "Control"))
    assert [edit["op"] for edit in slant] == ["shear"]
    undo()
    knob = (b["x"] + b["width"] / 2, b["y"] - 24)
    (turned,) = kept(studio, lambda: stroke(studio, *knob, 60, 10, "Shift"))
    assert turned["op"] == "rotate"
    assert turned["degrees"] > 0 == turned["degrees"] % 15
    (nudged,) = kept(studio, lambda: (studio.press("ArrowLeft"), studio.press("Shift+ArrowUp")))
    assert (nudged["op"], nudged["by"]) == ("move", [-1, -10])
    number = page.get_by_label("X", exact=True)
    number.fill(str(float(number.input_value()) + 7))
    (typed,) = kept(studio, lambda: number.press("Enter"))
    assert typed["by"] == pytest.approx([7, 0], abs=0.1)


def bend(studio):
    """Pins: three are set, one is dragged, weighed and turned."""
    page = studio.page
    page.click("#tool-pins")
    x0, y0, x1, y1 = next(v["bounds"] for v in studio.state["layers"] if v["name"] == "red")
    studio.until("document.querySelector('.overlay .mesh')")
    spots = [
        (x0 + u * (x1 - x0), y0 + v * (y1 - y0)) for u, v in ((0.33, 0.88), (0.8, 0.85), (0.5, 0.2))
    ]
    for spot in spots:
        studio.click(*spot)
    studio.until("document.querySelectorAll('.overlay .pin').length === 3")
    x, y = spots[2]
    (bent,) = kept(studio, lambda: studio.drag((x, y), (x - 20, y - 6)))
    assert bent["op"] == "drag"
    assert [h[2:] == [0, 0] for h in bent["handles"]] == [True, True, False]
    page.get_by_label("Weight").focus()
    for _ in range(8):
        studio.press("ArrowRight")
    studio.until("document.querySelectorAll('.overlay .reach').length === 1")
    page.get_by_label("Turn").focus()
    (turned,) = kept(studio, lambda: studio.press("PageUp"))
    assert len(turned["handles"]) > 3
    studio.look("6-bent")


def shape(studio):
    """Points of the outline: dragged, what is in it follows; corners become smooth."""
    page = studio.page
    studio.press("b")
    studio.until("document.querySelectorAll('.overlay .handle').length > 3")
    page.wait_for_timeout(300)

    x, y = studio.middle(".overlay circle.handle")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 14, y + 9, steps=4)
    assert studio.ask("studio.preview('red').clip !== undefined")
    studio.look("7-points")
    moved = kept(studio, page.mouse.up)
    assert {e["op"] for e in moved} == {"point"}
    assert len(moved) == 3
    page.get_by_label("The inside goes along").check()
    x, y = studio.middle(".overlay circle.handle")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 8, y + 3, steps=4)
    assert studio.ask("studio.preview('red').bent.length > 20")
    along = kept(studio, page.mouse.up)
    assert along
    assert all(edit["follow"] for edit in along)
    corner = page.get_by_role("button", name="Corner", exact=True)
    assert {e["op"] for e in kept(studio, corner.click)} == {"point"}
    studio.press("v")


def use_the_list(studio, photo):
    """Order, eye, lock, textures of others and of files, colours, names, groups, parents."""
    page = studio.page

    def layers():
        return [layer["name"] for layer in studio.state["layers"]]

    def carry(start, end):
        a, b = start.bounding_box(), end.bounding_box()
        page.mouse.move(a["x"] + a["width"] / 2, a["y"] + a["height"] / 2)
        page.mouse.down()
        page.mouse.move(b["x"] + b["width"] / 2, b["y"] + b["height"] - 3, steps=5)
        page.mouse.up()

    front, behind = layers()[:0:-1]
    studio.after(lambda: carry(studio.row(front).locator(".name"), studio.row(behind)))
    assert layers() == ["back", front, behind]
    for label, hidden in (("Hide", True), ("Show", False)):
        studio.after(studio.row("red").get_by_label(label).click)
        assert next(v for v in studio.state["layers"] if v["name"] == "red")["hidden"] is hidden
    studio.row("blue").get_by_label("Lock").click()
    studio.click(*BLUE)
    assert studio.ask("[...studio.store.selected]") != ["blue"]
    studio.row("blue").get_by_label("Unlock").click()

    def last():
        return studio.state["history"][-1]["op"]

    studio.after(lambda: carry(studio.row("blue").locator(".thumb"), studio.row("red")))
    assert (last()["op"], last()["source"]) == ("texture", "blue")
    studio.after(lambda: studio.press("Control+z"))
    thumb = studio.row("red").locator(".thumb").bounding_box()
    version = studio.state["version"]
    studio.drop(photo, (thumb["x"] + 9, thumb["y"] + 9))
    studio.until(f"studio.store.state.version > {version} && !studio.store.state.busy")
    studio.until("studio.store.state.history.at(-1).op.source === 'parrots.png'")
    studio.row("red").click()
    for label, key, op in (("Hue", "PageUp", "recolour"), ("Opacity", "PageDown", "opacity")):
        page.get_by_label(label, exact=True).focus()
        studio.after(lambda key=key: studio.press(key))
        assert last()["op"] == op
    studio.after(lambda: studio.press("Control+d"))
    assert "red copy" in layers()
    studio.row("red copy").locator(".name").dblclick()
    studio.after(lambda: studio.type("twin"))
    page.get_by_label("Follows").select_option("red")
    studio.until("studio.store.state.history.at(-1).op.op === 'parent'")
    studio.row("blue").click(modifiers=["Control"])
    studio.after(lambda: studio.press("Control+g"))
    studio.after(lambda: studio.type("birds"))
    assert [g["name"] for g in studio.state["groups"]] == ["birds"]
    studio.look("8-list")
    # What is wrong is said in place.
    studio.row("red").locator(".name").dblclick()
    studio.type("blue")
    studio.hears("blue")
    assert studio.page.locator(".message.error").is_visible()
    studio.look("9-error")


def fill_what_was_removed(studio):
    page = studio.page
    studio.row("blue").click()
    studio.after(lambda: studio.press("Delete"))
    studio.hears("blue removed")
    studio.look("10-removed")
    for label, edits in (("Smooth", ["complete"]), ("Surroundings", ["complete"])):
        at = studio.state["at"]
        page.locator(".message").get_by_role("button", name=label).click()
        studio.until("studio.store.state.history.at(-1).op.op === 'complete'")
        studio.until(f"'{label}' === 'Smooth' || !studio.store.state.history.at(-1).op.method")
        assert [s["op"]["op"] for s in studio.state["history"][at:]] in (edits, [])


def animate(studio):
    """A preset, pins, a handle with keys of place, size and angle, onion skin; it is kept."""
    page = studio.page
    page.click("#mode-motion")
    studio.press("Escape")
    studio.row("red").click()
    page.get_by_role("button", name="Sway").click()
    studio.until("studio.player.running && studio.player.time > 0.2")
    studio.look("11-motion")
    page.locator(".stage").focus()
    studio.press(" ")
    studio.until("!studio.player.running")
    page.get_by_role("button", name="Left", exact=True).click()
    page.click("#tool-keep")
    b = next(v["bounds"] for v in studio.state["layers"] if v["name"] == "red")
    middle = ((b[0] + b[2]) / 2, (b[1] + b[3]) / 2)
    studio.click(middle[0], middle[1] + 20)
    studio.until("studio.player.running && !studio.player.busy")
    page.click("#tool-handle")
    studio.click(middle[0], middle[1] - 30)
    ruler = page.locator(".tracks").bounding_box()
    page.mouse.click(ruler["x"] + ruler["width"] / 8, ruler["y"] + 12)
    studio.drag((middle[0], middle[1] - 30), (middle[0] - 10, middle[1] - 36))
    studio.until("document.querySelectorAll('.tracks .key').length === 2")
    for label, key in (("Size", "ArrowRight"), ("Turn", "PageUp")):
        page.get_by_label(label, exact=True).focus()
        studio.press(key)
    studio.until("studio.player.running && !studio.player.busy")
    page.locator(".stage").focus()
    studio.press(" ")
    page.get_by_label("Onion skin").click()
    studio.look("12-keys")
    studio.after(page.locator("#keep-motion").click)
    made = studio.state["history"][-1]["op"]
    assert made["op"] == "animate"
    moving = made["motion"]["layers"].values()
    (handle,) = [handle for layer in moving for handle in layer.get("handles", ())]
    first, second = handle["keys"]
    assert (first["scale"], first["turn"], first["offset"]) == (1, 0, [0, 0])
    assert second["scale"] > 1
    assert second["turn"] > 0 > second["offset"][0]
    assert sum(isinstance(pin, dict) for layer in moving for pin in layer["pins"]) == 1
    assert studio.state["timeline"]["loop"]
    page.click("#mode-edit")


def go_back_and_forth(studio):
    page = studio.page
    page.click("#tab-history")
    steps = page.locator(".step")
    end = studio.state["at"]
    assert steps.count() == end + 1
    studio.after(steps.nth(2).click)
    assert studio.state["at"] == 2
    studio.look("13-history")
    studio.after(page.locator("#redo").click)
    studio.after(page.locator("#undo").click)
    studio.after(steps.nth(end).click)
    page.click("#tab-code")
    assert "--rotate red" in page.locator("pre").first.inner_text()
    assert '.layers["red"].rotated(' in page.locator("pre").nth(1).inner_text()
    studio.look("14-code")


def export(studio):
    page = studio.page
    page.click("#export")
    found = {}
    for kind in ("PNG", "PSD", "SVG", "HTML", "GIF"):
        page.locator(".kind", has_text=kind).first.click()
        if kind == "PNG":
            page.locator(".export").get_by_label("W", exact=True).fill("100")
            page.keyboard.press("Enter")
            studio.look("15-export")
        with page.expect_download() as download:
            page.click("#do-export")
        found[kind] = download.value.path().read_bytes()
    assert Image.open(io.BytesIO(found["PNG"])).width == 100
    assert found["PSD"].startswith(b"8BPS")
    assert b"<svg" in found["SVG"]
    assert b"<pxi-image" in found["HTML"]
    with Image.open(io.BytesIO(found["GIF"])) as clip:
        assert (clip.width, clip.n_frames > 20) == (100, True)
    page.keyboard.press("Escape")


def save(studio):
    """Bytes of the file that is saved, and the edits that made it."""
    with studio.page.expect_download() as download:
        studio.press("Control+s")
    state = json.loads(studio.ask("fetch('/api/state').then((answer) => answer.text())"))
    edits = [step["op"] for step in state["history"]]
    return download.value.path().read_bytes(), edits


def test_views_and_fingers_on_a_page_drawn_by_webgl(studio_at, small_pxi):
    with studio_at(query="?draw=gl") as studio:
        page = studio.page
        studio.choose(small_pxi, lambda: page.click("#open-first"))
        studio.until("studio.store.state.stage === 'editing' && studio.ready()")
        page.click("#got-it")

        def view():
            return studio.ask("[studio.view.scale, studio.view.x, studio.view.y]")

        scale, place = view()[0], studio.at(20, 10)
        page.mouse.move(*place)
        page.mouse.wheel(0, -240)
        studio.until(f"studio.view.scale > {1.2 * scale}")
        assert studio.at(20, 10) == pytest.approx(place, abs=0.01)
        for key, wanted in (("+", 1.25), ("-", 1.0)):
            before = view()[0]
            studio.press(key)
            assert view()[0] == pytest.approx(before * (1.25 if wanted > 1 else 0.8))
        studio.press("1")
        assert view()[0] == 1
        studio.press("0")
        assert view()[0] == scale
        # The space bar pans, whatever the tool.
        _, x, y = view()
        page.keyboard.down(" ")
        stroke(studio, *place, 30, 20)
        page.keyboard.up(" ")
        assert view()[1:] == pytest.approx([x + 30, y + 20])
        # So do arrow keys where nothing is chosen that they could nudge.
        studio.press("Shift+ArrowLeft")
        assert view()[1] == pytest.approx(x + 30 + 160)
        studio.press("0")
        # Two fingers: the point between them stays there, and what the first one began is dropped.
        place = studio.at(32, 24)
        studio.pinch(32, 24, 40, 120)
        assert view()[0] == pytest.approx(3 * scale, rel=0.01)
        assert studio.at(32, 24) == pytest.approx(place, abs=1)
        assert studio.state["at"] == 0
        # One finger drags.
        studio.press("0")
        studio.after(lambda: studio.slide((32, 24), (42, 20)))
        moved = studio.state["history"][-1]["op"]
        assert (moved["layer"], moved["by"]) == ("disc", pytest.approx([10, -4], abs=0.5))
        # One draw call a layer, one more pixel of the pointer costs nothing else.
        assert studio.ask("studio.times.calls") == 3
        # The outline clips what WebGL draws, too.
        studio.press("b")
        studio.until("document.querySelectorAll('.overlay circle.handle').length > 0")
        page.wait_for_timeout(200)
        corner = studio.middle(".overlay circle.handle")
        (edit, *_) = kept(studio, lambda: stroke(studio, *corner, 40, 5))
        assert edit["op"] == "point"
        studio.look("16-webgl")


def test_what_is_dropped_and_pasted(studio_at, small_pxi, tmp_path):
    pytest.importorskip("psd_tools")
    image = pxi.open(small_pxi)
    (tmp_path / "a.psd").write_bytes(photoshop.build(image))
    Image.fromarray(image.render(layers=["disc"])).save(tmp_path / "sun.png")
    with studio_at() as studio:
        studio.drop(tmp_path / "a.psd")
        studio.until("studio.store.state.stage === 'editing' && studio.ready()")
        assert [v["name"] for v in studio.state["layers"]] == ["back", "bar", "disc"]
        studio.page.click("#got-it")
        studio.after(lambda: studio.paste(tmp_path / "sun.png"))
        assert studio.state["history"][-1]["op"]["op"] == "insert"
        # A page that is exported shows the picture by itself.
        (tmp_path / "a.html").write_text(studio.ask(EXPORTED))
        page = studio.page.context.new_page()
        asked = []
        page.on("request", lambda request: asked.append(request.url.partition(":")[0]))
        page.goto(f"file://{tmp_path / 'a.html'}")
        page.wait_for_selector("pxi-image canvas")
        shown = page.evaluate(
            "[...document.querySelector('canvas').getContext('2d').getImageData(0, 0, 64, 48).data]"
        )
        page.close()
        data = studio.ask(
            "fetch('/api/render?format=raw').then((a) => a.arrayBuffer())"
            ".then((b) => [...new Uint8Array(b)])"
        )
    np.testing.assert_allclose(shown, data, atol=2)
    assert set(asked) <= {"file", "data"}
