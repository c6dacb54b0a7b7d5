"""Guard of the server: only the page that has the token is let in, and only from this machine.

A page of another origin can send requests to the loopback, and a name of its own can point there
(DNS rebinding): therefore `Host` and `Origin` are checked, beside the token.
"""

from __future__ import annotations

import hmac
import json
from collections.abc import Awaitable, Callable, Iterable, Mapping, MutableMapping
from typing import Any
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

POLICY = (
    "default-src 'self'; img-src 'self' blob: data:; worker-src 'self' blob:; "
    "style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)

HEADERS = (
    (b"content-security-policy", POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
)

TOKEN_HEADER = "x-studio-token"


class Guard:
    """ASGI application that lets only some requests through to another one.

    Args:
        app: The application behind it.
        token: The secret of the address.
        port: Port of the server.
    """

    def __init__(self, app: App, token: str, port: int) -> None:
        self._app, self._token, self._cookie = app, token, f"pxi-studio-{port}"
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answers a request, or hands it on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return  # without an answer the server refuses it
        headers = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [])
        if scope["path"] == "/" and given and self._is_ours(headers):
            if self._matches(given[0]):
                await self._let_in(send)
                return
            await _refuse(send, 401, "token", "the address is that of an earlier session; "
                          "pxi-studio prints the present one")  # fmt: skip
            return
        problem = self._problem(scope["method"], headers)
        if problem is not None:
            await _refuse(send, *problem)
            return

        async def guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *HEADERS]
            await send(message)

        await self._app(scope, receive, guarded)

    def _matches(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self._token.encode())

    def _is_ours(self, headers: Mapping[str, str]) -> bool:
        """Whether a request is to this server, and not from another page."""
        origin = headers.get("origin")
        return headers.get("host") in self._hosts and (
            origin is None or origin in [f"http://{host}" for host in self._hosts]
        )

    def _problem(
        self, method: str, headers: Mapping[str, str]
    ) -> tuple[int, str, str] | None:  # fmt: skip
        """Status, kind and message of why a request is refused; None if it is not."""
        if not self._is_ours(headers):
            return 403, "origin", "this server answers its own page only, at 127.0.0.1"
        if self._matches(headers.get(TOKEN_HEADER, "")):
            return None
        if not self._matches(_cookies(headers.get("cookie", "")).get(self._cookie, "")):
            return 401, "token", "the token is missing or wrong; open the address that pxi-studio "\
                "prints"  # fmt: skip
        site = headers.get("sec-fetch-site", "same-origin")
        changing = method not in ("GET", "HEAD")
        if site not in ("same-origin", "none") or (changing and "origin" not in headers):
            return 403, "origin", "the request does not come from the page of this server"
        return None

    async def _let_in(self, send: Send) -> None:
        """Sets the cookie, and takes the token out of the address."""
        cookie = f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"
        await _answer(send, 303, b"", [(b"location", b"/"), (b"set-cookie", cookie.encode())])


def _cookies(text: str) -> dict[str, str]:
    pairs = (part.strip().partition("=") for part in text.split(";"))
    return {name: value for name, _, value in pairs}


async def _refuse(send: Send, status: int, kind: str, message: str) -> None:
    body = json.dumps({"error": {"kind": kind, "message": message}}).encode()
    await _answer(send, status, body, [(b"content-type", b"application/json")])


async def _answer(
    send: Send, status: int, body: bytes, headers: Iterable[tuple[bytes, bytes]]
) -> None:
    length = (b"content-length", str(len(body)).encode())
    every = [*headers, length, (b"cache-control", b"no-store"), *HEADERS]
    await send({"type": "http.response.start", "status": status, "headers": every})
    await send({"type": "http.response.body", "body": body})
