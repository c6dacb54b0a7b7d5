"""Requests that must not be answered: without the token, from elsewhere, for other places."""

import pytest

from proxyimg_codec.limits import Limits
from proxyimg_codec.studio.guard import TOKEN_HEADER
from tests.studio.conftest import PORT, TOKEN

OWN = f"http://127.0.0.1:{PORT}"
COOKIE = f"pxi-studio-{PORT}"


def bare(studio, **headers):
    """A client without the token."""
    client = studio().client
    del client.headers[TOKEN_HEADER]
    client.headers.update(headers)
    return client


@pytest.mark.parametrize("place", ["/", "/api/state", "/page/index.html", "/api/events", "/x"])
def test_nothing_is_answered_without_the_token(studio, place):
    client = bare(studio)
    for headers in ({}, {TOKEN_HEADER: "guess"}, {"cookie": f"{COOKIE}=guess"}):
        answer = client.get(place, headers=headers)
        assert answer.status_code == 401
        assert answer.json()["error"]["kind"] == "token"
    assert client.get("/?token=guess").status_code == 401


def test_the_address_sets_a_cookie_and_hides_the_token(studio):
    client = bare(studio)
    answer = client.get(f"/?token={TOKEN}")
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"]
    assert {"HttpOnly", "SameSite=Strict"} <= set(cookie.split("; "))
    assert client.get("/api/state").status_code == 200
    assert client.get("/").status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": f"http://127.0.0.1:{PORT + 1}"},
        {"origin": f"https://127.0.0.1:{PORT}"},
        {"host": "evil.example"},
        {"host": f"evil.example:{PORT}"},
        {"host": f"127.0.0.1:{PORT + 1}"},
        {"host": ""},
    ],
)
def test_other_origins_and_hosts_are_refused_even_with_the_token(studio, headers):
    client = studio().client
    for method in ("GET", "POST"):
        answer = client.request(method, "/api/state", headers=headers)
        assert answer.status_code == 403
        assert answer.json()["error"]["kind"] == "origin"


def test_a_cookie_alone_changes_nothing_without_an_origin(studio):
    client = bare(studio, cookie=f"{COOKIE}={TOKEN}")
    assert client.post("/api/close", json={}).status_code == 403
    cross = {"origin": OWN, "sec-fetch-site": "cross-site"}
    assert client.post("/api/close", json={}, headers=cross).status_code == 403
    assert client.post("/api/close", json={}, headers={"origin": OWN}).status_code == 200
    assert client.get("/api/state", headers={"sec-fetch-site": "same-site"}).status_code == 403


def test_answers_say_what_a_page_may_do(studio):
    headers = studio().get("/api/state").headers
    assert "default-src 'self'" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["cross-origin-resource-policy"] == "same-origin"


@pytest.mark.parametrize(
    "place",
    [
        "/page/../routes.py",
        "/page/%2e%2e/routes.py",
        "/page/..%2f..%2fapi.py",
        "/page//etc/passwd",
        "/page/%2fetc%2fpasswd",
        "/page/",
        "/page/nothing.js",
        "/api/exports/..%2fsession.json",
        "/api/exports/session.json",
        "/api/exports/%2e%2e",
        "/etc/passwd",
        "/session.json",
    ],
)
def test_no_other_file_is_reachable(studio, place):
    made = studio()
    made.session.write()
    assert made.client.get(place).status_code == 404


@pytest.mark.parametrize(
    "edit",
    [
        {"op": "texture", "layer": "disc", "source": "/etc/passwd"},
        {"op": "texture", "layer": "disc", "source": "../session.json"},
        {"op": "texture", "layer": "disc", "source": "https://example.org/a.png"},
        {"op": "texture", "layer": "disc", "source": ["hat.png"]},
        {"op": "insert", "source": "secret.png"},
        {"op": "insert", "source": "disc"},
        {"op": "cut", "layer": "disc", "mask": "secret.png"},
        {"op": "outlines", "source": "secret.svg"},
        {"op": "generate", "layer": "disc", "prompt": "fur", "guide": "secret.png"},
        {"op": "move", "layer": "disc", "by": [1, 1], "source": "secret.png"},
    ],
)
def test_edits_reach_no_file_that_was_not_opened(studio, edit, small_pxi, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "secret.png").write_bytes(b"secret")
    made = studio()
    made.open(small_pxi)
    said = made.refused("usage", "POST", "/api/edit", json={"edits": [edit]})
    assert "no file that was added" in said or "is not known here" in said
    assert made.settled()["at"] == 0


def test_names_of_files_become_plain(studio, small_pxi):
    made = studio()
    names = ["../../evil.png", "/etc/evil.png", "..\\evil.png", "C:\\evil.png", "evil.png"]
    added = [
        made.post("/api/files", params={"name": n}, content=b"x", json=None)["name"]
        for n in names
    ]  # fmt: skip
    assert added == ["evil.png", "evil 2.png", "evil 3.png", "evil 4.png", "evil 5.png"]
    assert made.session.folder.names() == sorted(added)
    odd = made.post("/api/files", params={"name": "..."}, content=b"x", json=None)["name"]
    assert odd in made.session.folder.names()


def test_what_is_too_large_is_refused(studio, small_pxi):
    data = small_pxi.read_bytes()
    made = studio(Limits(file_bytes=len(data) - 1))
    said = made.refused("limit", "POST", "/api/open?name=a.pxi", content=data)
    assert "file_bytes" in said
    made.refused("limit", "POST", "/api/files?name=a.pxi", content=iter([data[:9], data[9:]]))
    made.refused("limit", "POST", "/api/edit", content=b" " * (1 << 22) + b"{}",
                 headers={"content-type": "application/json"})  # fmt: skip
    assert made.session.folder.names() == []
    few = studio(Limits(layers=2))
    few.refused("limit", "POST", "/api/open?name=a.pxi", content=data)
    assert few.settled()["stage"] == "empty"


def test_a_large_picture_is_neither_opened_nor_drawn(studio, small_pxi, tmp_path, photo):
    from proxyimg_codec.io import raster

    raster.write(tmp_path / "a.png", photo)
    made = studio(Limits(output_pixels=photo.shape[0] * photo.shape[1] - 1))
    data = (tmp_path / "a.png").read_bytes()
    made.refused("limit", "POST", "/api/open?name=a.png", content=data)
    made.open(small_pxi)
    made.refused("limit", "GET", "/api/render")
    made.get("/api/render?width=30")
    made.refused("limit", "GET", "/api/layers/0/texture")


@pytest.mark.parametrize(
    ("content", "kind", "said"),
    [
        (b"", "application/json", "not valid JSON"),
        (b"[]", "application/json", "must be a JSON object"),
        (b'{"edits": 3}', "application/json", "edits"),
        (b'{"edits": []}', "application/json", "edits"),
        (b'{"edits": [3]}', "application/json", "operation None"),
        (b'{"edits": [{"op": []}]}', "application/json", "is not known here"),
        (b"[" * 100_000, "application/json", "not valid JSON"),
        (b"\xff\xfe\x00", "application/json", "not valid JSON"),
        (b'{"edits": [{"op": "hide", "layer": "disc"}]}', "text/plain", "application/json"),
        (b'{"edits": [{"op": "hide", "layer": "disc"}], "version": "x"}', "application/json",
         "version"),
    ],
)  # fmt: skip
def test_malformed_requests_are_refused(studio, small_pxi, content, kind, said):
    made = studio()
    made.open(small_pxi)
    headers = {"content-type": kind}
    assert said in made.refused("usage", "POST", "/api/edit", content=content, headers=headers)


@pytest.mark.parametrize(
    "place",
    ["/api/render?w=-1", "/api/render?x=60&w=9", "/api/render?width=nan", "/api/render?width=x",
     "/api/render?layers=x", "/api/render?layers=99", "/api/render?format=gif", "/api/render?t=1",
     "/api/layers/0/texture?scale=1e9", "/api/layers/0/thumbnail.png?side=0"],
)  # fmt: skip
def test_requests_for_pictures_that_make_no_sense_are_refused(studio, small_pxi, place):
    made = studio()
    made.open(small_pxi)
    made.refused("usage", "GET", place)


def test_requests_before_anything_is_open_say_so(studio):
    made = studio()
    assert "open one" in made.refused("usage", "GET", "/api/render")
    made.refused("usage", "POST", "/api/edit", json={"edits": [{"op": "hide", "layer": 0}]})
    made.refused("usage", "POST", "/api/encode?wait", json={})
    made.refused("usage", "POST", "/api/save", json={})
    made.refused("missing", "GET", "/api/source.png")
    made.refused("usage", "POST", "/api/reload", json={})
    made.refused("missing", "POST", "/api/nothing", json={})
