"""Who may talk to the server: browsers of this machine that were given its address.

The address that the terminal prints has a token; the first visit exchanges it for a cookie that
scripts cannot read and that other sites cannot send. `Host` is checked against names that other
machines use for themselves (DNS rebinding), `Origin` and `Sec-Fetch-Site` against other sites.
"""

from __future__ import annotations

import hmac
import secrets
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_READING = ("GET", "HEAD")


class Gate:
    """Middleware in front of everything, sockets included.

    Attributes:
        token: what the printed address ends with.
    """

    def __init__(self, app: ASGIApp, port: int, token: str | None = None):
        """`port`: that browsers use; `token`: None draws one."""
        self.token = token or secrets.token_urlsafe(32)
        self._app = app
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._session = secrets.token_urlsafe(32)
        # Cookies know no ports: two takes that are open at once need two names.
        self._cookie = f"vermilion_sketch_{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, refuse, or pass on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        refused = self._refused(scope, headers)
        if scope["type"] == "websocket":
            # The page uses none.
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": "no socket here"})
            return
        if refused is not None:
            await refused(scope, receive, _with_headers(send))
            return
        await self._app(scope, receive, _with_headers(send))

    def _refused(self, scope: Scope, headers: Headers) -> Response | None:
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0].lower() not in self._hosts:
            return _sentence(403, "This server answers to 127.0.0.1 alone.")
        own = f"http://{hosts[0].lower()}"
        origins = [origin.lower() for origin in headers.getlist("origin")]
        reading = scope.get("method", "GET") in _READING
        if any(origin != own for origin in origins) or not (origins or reading):
            return _sentence(403, "This request comes from another page.")
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            # A link on another page may not open this one with the cookie, either.
            return _sentence(403, "This request comes from another site.")
        if scope["type"] == "websocket":
            return None
        token = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        if scope["path"] == "/" and _same(token, self.token):
            return self._exchange()
        if not _same(_cookies(headers).get(self._cookie, ""), self._session):
            return _sentence(
                401, "Open the address that the terminal printed, with its token, in this browser."
            )
        return None

    def _exchange(self) -> Response:
        """The cookie for the token, and the address without it."""
        answer = RedirectResponse("/", status_code=303)
        answer.set_cookie(self._cookie, self._session, httponly=True, samesite="strict", path="/")
        return answer


def _cookies(headers: Headers) -> dict[str, str]:
    parts = [part.partition("=") for line in headers.getlist("cookie") for part in line.split(";")]
    return {name.strip(): value.strip() for name, _, value in parts}


def _same(found: str, expected: str) -> bool:
    return hmac.compare_digest(found.encode("utf-8", "replace"), expected.encode())


def _sentence(status: int, sentence: str) -> Response:
    if status == 401:
        return PlainTextResponse(sentence, status)
    return JSONResponse({"error": sentence}, status)


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            kept = [pair for pair in message.get("headers", []) if pair[0] != b"server"]
            added = [(k.lower().encode(), v.encode()) for k, v in _HEADERS.items()]
            message = {**message, "headers": [*kept, *added]}
        await send(message)

    return sending
