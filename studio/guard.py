"""Who may open the page: this machine, or whoever has the token; and no other web site in their name."""

import contextlib
import hmac
import io
import ipaddress
import secrets
import socket
from collections.abc import Iterator
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from unittest.mock import patch
from urllib.parse import parse_qs, urlsplit

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from gesture_bot.base.errors import GestureBotError, InvalidValueError

LOCAL_NAMES = ("127.0.0.1", "localhost", "::1")

COOKIE = "studio_token"


class Guard:
    """Answers each HTTP request, the websocket's first one too, that must not get through.

    A browser lets any web site open a websocket to this machine, so the page's own origin is asked for; and a
    site may let its name point to this machine, so the name is asked for.

    Args:
        host: Address that the page is bound to.

    Attributes:
        token: What a browser must know; empty where the page is bound to this machine.
    """

    def __init__(self, host: str):
        self.token = "" if is_local(host) else secrets.token_urlsafe(24)

    def answer(self, request: Request) -> Response | None:
        """What a request is answered with; None where it may go on."""
        host = request.headers.get("Host", "")
        origin = request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != host:
            return _response(HTTPStatus.FORBIDDEN, "This comes from another web site.")
        if not self.token:
            if urlsplit(f"//{host}").hostname not in LOCAL_NAMES:
                return _response(HTTPStatus.FORBIDDEN, f"Use {LOCAL_NAMES[0]} as the name.")
            return None
        if self._matches(_cookie(request)):
            return None
        if self._matches(parse_qs(urlsplit(request.path).query).get("token", [""])[0]):
            cookie = f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
            return _response(HTTPStatus.SEE_OTHER, "", Location="/", **{"Set-Cookie": cookie})
        return _response(HTTPStatus.UNAUTHORIZED, "The address needs the token that the log tells.")

    def _matches(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self.token.encode())


class _Server(viser.ViserServer):
    def request_share_url(self, verbose: bool = True) -> None:
        """Do nothing: any page could ask for a tunnel that lets everybody in."""


def open_server(address: str) -> tuple[viser.ViserServer, str]:
    """A server that only lets in whom the guard does, and where its page is, with the token if there is one.

    Args:
        address: HOST:PORT; the next free port is taken where that is in use.

    Raises:
        InvalidValueError: It is no address of this machine.
        GestureBotError: The guard does not fit this version of viser.
    """
    host, port = _parsed(address)
    guard = Guard(host)
    with _guarding(guard) as guarded, contextlib.redirect_stdout(io.StringIO()):
        server = _Server(host=host, port=port, label="gesture_bot", verbose=False)
    if not guarded:
        server.stop()
        raise GestureBotError(
            "the studio cannot check who opens it with this version of viser", viser.__version__
        )
    name = socket.gethostname() if ipaddress.ip_address(host).is_unspecified else host
    name = f"[{name}]" if ":" in name else name
    query = f"?token={guard.token}" if guard.token else ""
    return server, f"http://{name}:{server.get_port()}/{query}"


def is_local(host: str) -> bool:
    """Whether an address is reached from this machine only."""
    return ipaddress.ip_address(host).is_loopback


def _parsed(address: str) -> tuple[str, int]:
    try:
        parts = urlsplit(f"//{address}")
        host, port = socket.gethostbyname(parts.hostname or ""), parts.port
        with socket.socket() as tried:
            tried.bind((host, 0))
    except (OSError, ValueError) as error:
        raise InvalidValueError(
            f"studio_address must be HOST:PORT of this machine ({error})", address
        ) from error
    if port is None:
        raise InvalidValueError("studio_address must be HOST:PORT", address)
    return host, port


@contextlib.contextmanager
def _guarding(guard: Guard) -> Iterator[list[bool]]:
    """While it lasts, websockets' servers ask the guard first; viser itself has no place for it.

    Yields:
        A list that is empty until a server has been guarded.
    """
    serve, guarded = websockets.asyncio.server.serve, []

    def guarded_serve(*args, process_request, **options):  # type: ignore[no-untyped-def]
        def process(connection: ServerConnection, request: Request) -> Response | None:
            return guard.answer(request) or process_request(connection, request)

        guarded.append(True)
        return serve(*args, process_request=process, **options)

    with patch("websockets.asyncio.server.serve", guarded_serve):
        yield guarded


def _cookie(request: Request) -> str:
    try:
        morsel = SimpleCookie(request.headers.get("Cookie", "")).get(COOKIE)
    except CookieError:
        return ""
    return morsel.value if morsel else ""


def _response(status: HTTPStatus, text: str, **headers: str) -> Response:
    body = f"{text}\n".encode()
    common = {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))}
    return Response(status, status.phrase, Headers({**common, **headers}), body)
