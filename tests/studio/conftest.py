"""A studio without a network: the application, and a client that has the token."""

import contextlib

import pytest

from proxyimg_codec.limits import Limits
from proxyimg_codec.studio.guard import TOKEN_HEADER, Guard

PORT, TOKEN = 8765, "a-token-of-tests"


class Studio:
    """A session, and requests to it that must succeed, or fail in a known way."""

    def __init__(self, session, client):
        self.session, self.client = session, client

    def get(self, place, **more):
        answer = self.client.get(place, **more)
        assert answer.status_code == 200, answer.text
        return answer

    def post(self, place, values=None, **more):
        answer = self.client.post(place, **({"json": values or {}} | more))
        assert answer.status_code == 200, answer.text
        return answer.json()

    def refused(self, kind, method, place, **more):
        """Message of a request that must be refused with an error of a kind."""
        answer = self.client.request(method, place, **more)
        error = answer.json()["error"]
        assert error["kind"] == kind, error
        assert answer.status_code >= 400
        return error["message"]

    def open(self, path):
        """Opens a file as if it were dropped, and waits for the layers of a raster."""
        self.post(f"/api/open?name={path.name}", content=path.read_bytes(), json=None)
        return self.settled()

    def settled(self):
        """The state when no work is going on."""
        while (state := self.get("/api/state").json())["busy"]:
            pass
        return state

    def edit(self, *edits):
        return self.post("/api/edit", {"edits": list(edits)})


@pytest.fixture
def studio(tmp_path, plain_maps):
    """Makes studios: studio(limits=...) -> `Studio`, which ends with the test."""
    from starlette.testclient import TestClient

    from proxyimg_codec.studio.autosave import Folder
    from proxyimg_codec.studio.server import composed
    from proxyimg_codec.studio.session import Session

    with contextlib.ExitStack() as stack:

        def make(limits=None, folder=None):
            folder = folder or Folder.new(tmp_path / "sessions")
            session = Session(folder, limits or Limits(), 1, None, PORT)
            client = TestClient(
                Guard(composed(session), TOKEN, PORT),
                base_url=f"http://127.0.0.1:{PORT}",
                headers={TOKEN_HEADER: TOKEN},
                raise_server_exceptions=False,
                follow_redirects=False,
            )
            return Studio(session, stack.enter_context(client))

        yield make
