"""Who may ask: the token, same-origin for whatever changes something; headers that every answer carries."""

import hashlib
import hmac
import logging
import traceback
from secrets import compare_digest

from fastapi import Request
from fastapi.responses import RedirectResponse, Response
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.http.errors import problem

MOST_BYTES = 256_000
"""Of a request's body."""
COOKIE = "droptower"
OPEN = ("/login", "/static/")
# plotly and swagger-ui set style attributes on what they draw; no other part of a page may hold style or script
POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; object-src 'none'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Token:
    """The token of a service that others than this computer reach; only its hash is kept."""

    def __init__(self, token: str) -> None:
        self._hash = hashlib.sha256(token.encode()).digest()
        self.session = hmac.new(self._hash, b"droptower session", "sha256").hexdigest()

    def is_it(self, given: str) -> bool:
        """Whether it is the token."""
        return compare_digest(hashlib.sha256(given.encode()).digest(), self._hash)

    def admits(self, request: Request) -> bool:
        """Whether a request bears the token, or the cookie that the login form gave for it."""
        kind, _, given = request.headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and self.is_it(given.strip()):
            return True
        return compare_digest(request.cookies.get(COOKIE, "").encode(), self.session.encode())


class Guard:
    """Lets a request through or answers it; nothing that fails behind it shows more than a line of words."""

    def __init__(self, app: ASGIApp, token: Token | None) -> None:
        self._app, self._token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        if (answer := self._refusal(request)) is not None:
            await answer(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    def _refusal(self, request: Request) -> Response | None:
        length = request.headers.get("content-length", "0")
        if not length.isdecimal() or len(length) > 9 or int(length) > MOST_BYTES:
            words = f"a request may bring {MOST_BYTES} bytes; a test file has some hundred"
            return problem(request, 413, "too-large", words)
        if request.method not in ("GET", "HEAD", "OPTIONS") and not _same_origin(request):
            return problem(
                request,
                403,
                "cross-site",
                "requests that change something are taken from this service's own pages only",
            )
        path = request.url.path
        if self._token is None or path.startswith(OPEN) or self._token.admits(request):
            return None
        if path.startswith("/api/"):
            words = "this service needs its token: send the header `Authorization: Bearer TOKEN`"
            return problem(request, 401, "no-token", words, {"WWW-Authenticate": "Bearer"})
        return RedirectResponse("/login", 303)


class Outermost:
    """Puts the headers on every answer, and makes a plain answer of an error nobody foresaw."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        started = False

        async def send_with_headers(message: Message) -> None:
            nonlocal started
            if message["type"] == "http.response.start":
                started = True
                headers = MutableHeaders(scope=message)
                headers.update(HEADERS)
                headers.setdefault("Cache-Control", "no-cache")
            await send(message)

        try:
            await self._app(scope, receive, send_with_headers)
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            logging.getLogger("droptower.http").error(
                "%s %s: %r in %s:%s", scope["method"], scope["path"], error, place.filename, place.lineno
            )
            if started:
                return
            words = f"an error in the service itself ({type(error).__name__}); its log names the place"
            await problem(Request(scope), 500, "internal", words)(scope, receive, send_with_headers)


def _same_origin(request: Request) -> bool:
    if (site := request.headers.get("sec-fetch-site")) is not None:
        return site in ("same-origin", "none")
    if (origin := request.headers.get("origin")) is not None:
        return origin == f"{request.url.scheme}://{request.headers.get('host', '')}"
    return True  # no browser: it always sends one of them
