"""What a session keeps, tells and cancels; exports; and the server as a process."""

import asyncio
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import urllib.request
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import proxyimg_codec as pxi
from proxyimg_codec.errors import InputError
from proxyimg_codec.io import raster
from proxyimg_codec.limits import Limits
from proxyimg_codec.studio import autosave, jobs
from proxyimg_codec.studio.autosave import Folder
from proxyimg_codec.studio.content import Content
from proxyimg_codec.studio.document import Document
from proxyimg_codec.studio.guard import TOKEN_HEADER
from proxyimg_codec.studio.routes import _Routes
from proxyimg_codec.studio.session import Session
from tests.support.paths import ROOT
from tests.support.pictures import smooth

MOVE = {"op": "move", "layer": "disc", "by": [3.0, -2.0]}
HIDE = {"op": "hide", "layer": "bar"}


def until(found):
    """Waits until something is true, at most some seconds."""
    end = time.monotonic() + 60
    while not found():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_what_is_done_is_kept_and_found_again(studio, small_pxi):
    made = studio()
    made.open(small_pxi)
    made.post("/api/files?name=hat.png", content=b"hat", json=None)
    made.edit(MOVE, HIDE)
    made.post("/api/undo")
    folder = made.session.folder
    until(lambda: (folder.state() or {}).get("at") == 1)
    again = studio(folder=Folder(folder.path))
    assert again.session.recover()
    state = again.get("/api/state").json()
    assert (state["at"], len(state["history"]), state["recovered"]) == (1, 2, True)
    assert (state["files"], state["saved"], state["file"]) == (["hat.png"], False, "small.pxi")
    assert state["command"].endswith("--move disc 3,-2")
    document = made.session.content.document
    assert again.session.content.document.to_bytes() == document.to_bytes()
    again.post("/api/redo")
    made.post("/api/redo")
    document = made.session.content.document
    assert again.session.content.document.to_bytes() == document.to_bytes()


def test_regions_are_kept_with_their_hints(studio, tmp_path):
    raster.write(tmp_path / "photo.png", smooth(67, 45))
    made = studio()
    made.open(tmp_path / "photo.png")
    hint = {"name": "a", "inside": [[33, 22]], "strokes": [[[30, 22], [36, 22]]], "radius": 2}
    state = made.post("/api/regions/point", hint)
    folder = made.session.folder
    until(lambda: "a" in (folder.state() or {}).get("regions", ()))
    again = studio(folder=Folder(folder.path))
    assert again.session.recover()
    assert again.get("/api/state").json()["regions"] == state["regions"]
    more = {"name": "a", "outside": [[2, 2]]}
    one, two = (s.post("/api/regions/point", more) for s in (made, again))
    assert one["regions"] == two["regions"]


@pytest.mark.parametrize("text", ["", "{", "[]", '{"version": 1}', '{"version": 2}',
    '{"version": 1, "file": "a", "origin": null, "base": 0, "kept": 0, "settings": null, "at": 0}',
    '{"version": 1, "file": "a", "origin": null, "base": 0, "kept": 0, "settings": null, '
    '"source": true}'])  # fmt: skip
def test_a_folder_that_is_damaged_is_not_taken(tmp_path, text):
    folder = Folder.new(tmp_path)
    (folder.path / autosave.STATE).write_text(text)
    assert not Session(folder, Limits(), 1).recover()


def test_only_sessions_of_the_file_that_nobody_has_open_are_found(tmp_path):
    import socket

    with socket.create_server(("127.0.0.1", 0)) as alive:
        for name, path, port in (("a", "/x/a.pxi", 1), ("b", None, 1), ("c", "/x/c.pxi", None),
                                 ("d", "/x/d.pxi", alive.getsockname()[1])):  # fmt: skip
            Folder(tmp_path / name).write({"path": path, "port": port}, {})
        names = {p: autosave.broken_off(tmp_path, p) for p in
                 ("/x/a.pxi", None, "/x/c.pxi", "/x/d.pxi", "/x/e.pxi")}  # fmt: skip
    found = {p: None if v is None else v.path.name for p, v in names.items()}
    assert found == {
        "/x/a.pxi": "a", None: "b", "/x/c.pxi": "c", "/x/d.pxi": None, "/x/e.pxi": None
    }  # fmt: skip
    assert autosave.broken_off(tmp_path / "nothing", None) is None
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError):
        Folder.new(tmp_path / "file")


def test_sessions_nobody_went_on_with_are_given_up_in_time(tmp_path):
    for name in ("old", "new"):
        Folder(tmp_path / name).write({"path": None, "port": 1}, {})
    (tmp_path / "other").mkdir()
    then = time.time() - 31 * 86400
    os.utime(tmp_path / "old" / autosave.STATE, (then, then))
    autosave.sweep(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["new", "other"]
    autosave.sweep(tmp_path / "nothing")


def test_saving_writes_the_target_and_replaces_nothing_by_accident(tmp_path, small_pxi):
    async def main():
        session = Session(Folder.new(tmp_path / "s"), Limits(), 1, tmp_path / "photo.png")
        session.start()
        image = pxi.open(small_pxi)
        document = Document.of(image.picture)
        session.begin_with(Content("photo.png", document=document), str(tmp_path / "photo.png"))
        assert not session.saved
        target = tmp_path / "photo.pxi"
        target.write_bytes(b"other")
        with pytest.raises(Exception, match="exists already"):
            await session.save(False)
        await session.save(True)
        assert target.read_bytes() == image.to_bytes()
        assert session.saved
        await session.change("edit", lambda c, job: c.with_edits([MOVE], tmp_path, ()))
        assert not session.saved
        await session.save(False)  # it is our own by now
        assert pxi.open(target) == image.edited(MOVE)
        await session.stop()
        assert not session.folder.path.exists()

    asyncio.run(main())


def test_work_is_cancelled_and_changes_nothing(tmp_path):
    async def main():
        session = Session(Folder.new(tmp_path), Limits(), 1)
        session.start()
        queue = session.listen()
        begun = threading.Event()

        def forever(content, job):
            while True:
                begun.set()
                job.report("round", 0, 1)

        session.begin_change("encode", forever)
        await asyncio.to_thread(begun.wait)
        assert session.state()["busy"]["kind"] == "encode"
        session.cancel()
        while True:
            name, data = await asyncio.wait_for(queue.get(), 60)
            if name == "job-end":
                break
        assert data["error"]["kind"] == "cancelled"
        assert (session.state()["busy"], session.version) == (None, 0)
        await session.change("close", lambda content, job: Content("b"))
        assert session.state()["file"] == "b"
        await session.stop()

    asyncio.run(main())


def test_a_failure_nobody_expected_is_told_without_its_details(tmp_path, caplog):
    async def main():
        session = Session(Folder.new(tmp_path), Limits(), 1)
        session.start()
        queue = session.listen()

        def broken(content, job):
            raise RuntimeError("the secret of the house")

        session.begin_change("encode", broken)
        while True:
            name, data = await asyncio.wait_for(queue.get(), 60)
            if name == "job-end":
                break
        assert data["error"]["kind"] == "error"
        assert "secret" not in json.dumps(data)
        await session.stop()

    asyncio.run(main())
    assert "the secret of the house" in caplog.text


def test_progress_is_told_at_times():
    told = []
    job = jobs.Job("encode", lambda job: told.append((job.stage, job.done)))
    for done in range(1000):
        job.report("texture", done, 1000)
    job.report("texture", 1000, 1000)
    assert told[0] == ("texture", 0)
    assert told[-1] == ("texture", 1000)
    assert len(told) < 100


def test_events_begin_with_the_state_and_their_end_is_noticed(tmp_path):
    async def main():
        session = Session(Folder.new(tmp_path), Limits(), 1)
        session.start()
        gone = []
        answer = await _Routes(session, lambda: gone.append(True)).events(None)
        stream = answer.body_iterator
        first = (await anext(stream)).decode()
        name, data = first.strip().split("\n")
        assert name == "event: state"
        assert json.loads(data.removeprefix("data: "))["stage"] == "empty"
        assert session.watched
        session.publish("warning", {"message": "a"})
        assert (await anext(stream)).startswith(b"event: warning")
        await stream.aclose()
        assert gone == [True]
        assert not session.watched
        slow = session.listen()
        for k in range(1000):
            session.publish("job", k)
        assert [slow.get_nowait()[1] for _ in range(slow.qsize())][-1] == 999
        await session.stop()

    asyncio.run(main())


@pytest.fixture
def moving(studio, moving_pxi):
    made = studio()
    made.open(moving_pxi)
    return made


def exported(made, **asked):
    found = made.post("/api/export?wait", asked)["result"]
    data = made.get(found["url"])
    assert len(data.content) == found["bytes"]
    assert "attachment" in data.headers["content-disposition"]
    return found["name"], data.content


def test_pictures_are_exported(moving, moving_pxi):
    image = pxi.open(moving_pxi)
    name, data = exported(moving, kind="png", width=32)
    assert name == f"{moving_pxi.stem}.png"
    np.testing.assert_array_equal(raster.parse(data, name).pixels, image.render(width=32))
    name, data = exported(moving, kind="png", time=0.4)
    np.testing.assert_array_equal(raster.parse(data, name).pixels, image.at(0.4).render())
    assert exported(moving, kind="svg")[1].startswith(b"<?xml")
    layers = zipfile.ZipFile(io.BytesIO(exported(moving, kind="ora")[1]))
    assert layers.namelist()[0] == "mimetype"
    moving.edit(MOVE)
    assert pxi.from_bytes(exported(moving, kind="pxi")[1]) == image.edited(MOVE)
    assert exported(moving, kind="pxi", baked=True)[1] == image.edited(MOVE).baked().to_bytes()


@pytest.mark.parametrize(
    ("kind", "start"),
    [("gif", b"GIF8"), ("webp-clip", b"RIFF"), ("apng", b"\x89PNG"), ("mp4", b"ftyp"),
     ("webm", b"\x1aE\xdf\xa3")],
)  # fmt: skip
def test_clips_are_exported(moving, kind, start):
    pytest.importorskip("av")
    data = exported(moving, kind=kind, width=32, fps=5, duration=0.4)[1]
    assert start in data[:8]


def test_a_page_is_exported_that_needs_nothing_else(moving):
    page = exported(moving, kind="html")[1].decode()
    assert "<pxi-image" in page
    assert "import.meta.url" not in page
    assert 'src="http' not in page
    assert page.count("data:text/javascript;base64,") > 10


@pytest.mark.parametrize(
    "asked",
    [{}, {"kind": "exe"}, {"kind": 3}, {"kind": "png", "width": 0}, {"kind": "png", "width": 1e9},
     {"kind": "png", "width": "9"}, {"kind": "gif", "fps": "x"}, {"kind": "gif", "fps": -1},
     {"kind": "gif", "background": "red"}, {"kind": "mp4", "quality": 200}, {"kind": "masks"},
     {"kind": "png", "time": "x"}, {"kind": "../a"}],
)  # fmt: skip
def test_exports_that_make_no_sense_are_refused(moving, asked):
    moving.refused("usage", "POST", "/api/export?wait", json=asked)
    assert not list(moving.session.folder.exports.glob(".*"))


def test_layered_files_are_opened_with_their_layers(studio, small_pxi, tmp_path):
    from proxyimg_codec.export import openraster

    (tmp_path / "a.ora").write_bytes(openraster.build(pxi.open(small_pxi)))
    made = studio()
    data = (tmp_path / "a.ora").read_bytes()
    state = made.post("/api/open?wait&name=a.ora", content=data, json=None)
    assert [v["name"] for v in state["layers"]] == ["back", "bar", "disc"]
    assert not state["saved"]
    assert state["command"] == "pxi-encode a.ora a.pxi --effort 2"


def test_photoshop_files_are_opened_with_their_layers(studio, tmp_path):
    psd_tools = pytest.importorskip("psd_tools")
    layered = psd_tools.PSDImage.new("RGB", (40, 30))
    layered.create_pixel_layer_from_array(smooth(40, 30), name="sky")
    layered.create_pixel_layer_from_array(smooth(20, 10), name="tree")
    layered.save(tmp_path / "a.psd")
    made = studio()
    data = (tmp_path / "a.psd").read_bytes()
    state = made.post("/api/open?wait&name=a.psd", content=data, json=None)
    assert [v["name"] for v in state["layers"]] == ["sky", "tree"]


def test_a_photoshop_file_without_layers_is_a_raster(studio, tmp_path):
    psd_tools = pytest.importorskip("psd_tools")
    psd_tools.PSDImage.frompil(Image.fromarray(smooth(40, 30))).save(tmp_path / "a.psd")
    made = studio()
    data = (tmp_path / "a.psd").read_bytes()
    made.post("/api/open?wait&name=a.psd", content=data, json=None)
    state = made.settled()
    assert (state["stage"], state["found"]) == ("pointing", True)


def test_the_folder_is_found_from_other_places(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = Folder.new(Path("sessions"))
    monkeypatch.chdir("/")
    assert folder.add("a.png", b"a") == "a.png"
    assert list(tmp_path.glob("sessions/*/files/a.png"))


# The server as a process

START = "from proxyimg_codec.studio import server; server.LINGER = 0.3; " \
        "from proxyimg_codec.cli.studio import main; raise SystemExit(main())"  # fmt: skip


class Server:
    """A running pxi-studio, and requests to it."""

    def __init__(self, *args, browser=None):
        command = [sys.executable, "-c", START, *map(str, args), "-j", "1"]
        command += [] if browser else ["--no-browser"]
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": path, "BROWSER": str(browser)},
        )  # fmt: skip
        address = self.process.stdout.readline().strip()
        assert address, self.process.stderr.read()
        self.address, _, self.token = address.partition("/?token=")

    def request(self, place, values=None):
        data = None if values is None else json.dumps(values).encode()
        headers = {TOKEN_HEADER: self.token, "content-type": "application/json"}
        return urllib.request.urlopen(
            urllib.request.Request(self.address + place, data, headers), timeout=60
        )

    def json(self, place, values=None):
        with self.request(place, values) as answer:
            return json.load(answer)

    def ended(self):
        return self.process.wait(60), self.process.stderr.read()


@pytest.fixture
def server(tmp_path):
    running = []

    def start(*args, **more):
        running.append(Server(*args, "--autosave", tmp_path / "sessions", **more))
        return running[-1]

    yield start
    for each in running:
        each.process.kill()
        each.process.communicate()


def test_a_server_that_is_killed_loses_nothing(server, small_pxi, tmp_path):
    file = Path(shutil.copy(small_pxi, tmp_path / "own.pxi"))
    first = server(file)
    assert first.json("/api/edit", {"edits": [MOVE]})["at"] == 1
    sessions = tmp_path / "sessions"
    until(lambda: list(sessions.glob("*/picture.pxi")))
    until(lambda: any(Folder(p).state() for p in sessions.iterdir()))
    first.process.kill()
    first.ended()
    second = server(file)
    state = second.json("/api/state")
    assert (state["recovered"], state["at"], state["target"]) == (True, 1, "own.pxi")
    assert second.json("/api/save", {})["saved"]
    assert len(pxi.open(file).history) == 1
    second.process.send_signal(signal.SIGTERM)
    code, said = second.ended()
    assert (code, "terminated" in said) == (143, True)
    assert not list(sessions.iterdir())


def test_the_server_ends_with_the_page_and_keeps_what_is_not_saved(server, small_pxi, tmp_path):
    running = server(small_pxi)
    page = running.request("/api/events")
    assert page.readline() == b"event: state\n"
    running.json("/api/edit", {"edits": [HIDE]})
    page.close()
    code, said = running.ended()
    assert (code, "error" in said.lower()) == (0, False)
    assert server(small_pxi).json("/api/state")["recovered"]
    assert pxi.open(small_pxi).history == ()


def test_a_page_that_is_open_hears_that_the_server_is_stopped(server, tmp_path):
    browser = tmp_path / "browser"
    browser.write_text(
        f'#!/bin/sh\necho "$1" > {tmp_path}/told; mv {tmp_path}/told {tmp_path}/to\n'
    )
    browser.chmod(0o755)
    running = server(browser=browser)
    until((tmp_path / "to").exists)
    assert (tmp_path / "to").read_text() == f"{running.address}/?token={running.token}\n"
    page = running.request("/api/events")
    running.process.send_signal(signal.SIGINT)
    assert b"event: bye" in page.read()
    assert running.ended()[0] == 130


def test_what_cannot_be_opened_is_said_at_once(tool, tmp_path):
    (tmp_path / "a.pxi").write_bytes(b"nothing")
    folder = ["--no-browser", "--autosave", tmp_path / "s"]
    tool("studio", tmp_path / "a.pxi", *folder, code=4)
    tool("studio", tmp_path / "none.pxi", *folder, code=3)
    assert "--port" in tool("studio", "--port", "70000", *folder, code=2).err
    assert "--jobs" in tool("studio", "-j", "0", *folder, code=2).err
    assert not list(Path(tmp_path / "s").glob("*"))
