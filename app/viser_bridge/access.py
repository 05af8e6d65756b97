"""Who may connect: pages that this server has served, and, where a token is set, only browsers that bring it.

viser 1.1.1 has neither an origin check nor authentication. Browsers send the `Origin` of the page that opens a
websocket, and a page may open one to any address, so without a check every web page could control the debugger.
"""

import http
import ipaddress
import re
import secrets
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from fairing.errors import InputError

LOOPBACK_NAMES = ("localhost", "127.0.0.1", "[::1]")
TOKEN = re.compile(r"[A-Za-z0-9_-]{8,}")
NO_TOKEN = "This page needs the address with the token that the command printed when it started.\n"
WRONG_ORIGIN = "Only pages of this server may connect to it.\n"
REPEATED_HEADER = "A header of this request is repeated that may be given once.\n"
WRONG_HOST = "This server does not go by that name.\n"
_SINGLE_HEADERS = ("Host", "Origin", "Authorization", "Upgrade", "Accept-Encoding")
"""Headers that are read here or by viser, each of which has one value."""


def is_loopback(host: str) -> bool:
    """Whether only programs on this machine can connect to a server that listens on `host`."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def token_for(host: str, token: str | None) -> str | None:
    """The given token, else a random one where other machines can connect, else None.

    Raises:
        InputError: the token is too short, or has characters that addresses and cookies would have to quote.
    """
    if token is not None and not TOKEN.fullmatch(token):
        raise InputError("token: use at least 8 letters, digits, hyphens or underscores")
    return token or (None if is_loopback(host) else secrets.token_urlsafe(24))


@dataclass(frozen=True)
class Access:
    """The checks of every request, of HTTP and of websockets alike.

    Attributes:
        host: the address that the server listens on.
        token: what every browser has to bring; None: all programs on this machine may connect.
    """

    host: str
    token: str | None

    def answer(self, request: Request, port: int) -> Response | None:
        """The response to a request that is not let in or not yet; None for one that viser may handle.

        A request with the right `?token=` is redirected to the page without it, with a cookie that carries it.

        Args:
            port: the port that this server listens on. Cookies are not bound to ports, so it is part of their name.
        """
        headers = request.headers
        if any(len(headers.get_all(header)) > 1 for header in _SINGLE_HEADERS):
            return _refused(REPEATED_HEADER)
        name = headers.get("Host", "")
        origin = headers.get("Origin")
        if origin is not None and origin not in (f"http://{name}", f"https://{name}"):
            return _refused(WRONG_ORIGIN)
        if self.token is None:
            return None if self._is_own_name(name) else _refused(WRONG_HOST)
        address = urlsplit(request.path)
        cookie = f"eigenfairing-{port}"
        if self._is_token(_cookie(headers, cookie)) or self._is_token(_bearer(headers)):
            return None
        if not self._is_token(parse_qs(address.query).get("token", [""])[0]):
            return _refused(NO_TOKEN)
        if headers.get("Upgrade", "").lower() == "websocket":
            return None
        kept = f"{cookie}={self.token}; HttpOnly; SameSite=Lax; Path=/"
        return _response(http.HTTPStatus.SEE_OTHER, "", {"Location": address.path or "/", "Set-Cookie": kept})

    def _is_own_name(self, name: str) -> bool:
        """Whether a browser that used this `Host` meant this machine: an attacker's name may resolve to it, too."""
        host = name.rpartition(":")[0] if name.rpartition(":")[2].isdigit() else name
        own = f"[{self.host}]" if ":" in self.host else self.host
        return host.lower() in (*LOOPBACK_NAMES, own.lower())

    def _is_token(self, found: str) -> bool:
        return self.token is not None and secrets.compare_digest(found.encode(), self.token.encode())


def _cookie(headers: Headers, name: str) -> str:
    for line in headers.get_all("Cookie"):
        try:
            morsel = SimpleCookie(line).get(name)
        except CookieError:
            continue
        if morsel is not None:
            return morsel.value
    return ""


def _bearer(headers: Headers) -> str:
    scheme, _, token = headers.get("Authorization", "").partition(" ")
    return token.strip() if scheme.lower() == "bearer" else ""


def _refused(reason: str) -> Response:
    return _response(http.HTTPStatus.FORBIDDEN, reason, {})


def _response(status: http.HTTPStatus, text: str, extra: dict[str, str]) -> Response:
    body = text.encode()
    common = {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body)), "Connection": "close"}
    return Response(status, status.phrase, Headers({**common, **extra}), body)
