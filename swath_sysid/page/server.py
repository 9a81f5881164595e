"""Serving the page from a thread, to this machine only or with a token."""

import secrets
import socket
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, quote, urlsplit

from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import END_S
from swath_sysid.page.layout import SCREEN_PERIOD, build
from swath_sysid.page.state import PageState

try:
    import fastapi
    import uvicorn
    from nicegui import Client, ui
    from nicegui import app as pages
except ImportError:  # `check_installed` says what to install
    ui = None  # type: ignore[assignment]

COOKIE = 'swath_sysid_page'
LOCAL_NAMES = ('localhost', '127.0.0.1', '::1')
#: Messages kept for a browser that reconnects, which the next update replaces, and pages that may wait for their
#: connection at a time: the library keeps each of them for a minute.
FEW = 10

PAGE_PATH = '/page'  #: Of the page itself; ``/`` only leads a browser there.
#: Of the library's websocket; each request without one would keep a session for a minute.
SOCKET_PATH = '/_nicegui_ws/'
#: On every answer: no site can show it in a frame.
UNFRAMED = ((b'content-security-policy', b"frame-ancestors 'none'"), (b'x-frame-options', b'DENY'))
ENTRANCE = """<!DOCTYPE html>
<html lang="en"><meta charset="utf-8"><title>swath_sysid</title><link rel="icon" href="data:,">
<meta http-equiv="refresh" content="0; url={address}"><a href="{address}">Open the page</a></html>
"""
REFUSAL = 'Open the address that swath-sysid page printed, with its token.'
UNREADABLE = 'Host, Origin or Cookie of this request cannot be read: open the printed address in a private window.'
CROWDED = 'Too many pages were opened that never connected: wait a minute, then open the page again.'
UNKNOWN = 'There is nothing at this address: open the one that swath-sysid page printed.'


def check_installed() -> None:
    """Raise `InputError` where the web part is not installed."""
    if ui is None:
        raise InputError('the page needs nicegui, fastapi and uvicorn: pip install "swath_sysid[page]"')


class Guard:
    """ASGI that admits requests with the token or, without one, those for this machine by its own name. Both reject
    pages of other origins that a browser may have open. A page that is built costs memory and processor time, so it
    needs a key, which is the token or, without one, known only to who can read the answer to ``/``: neither an image on
    another site nor a script there can.
    """

    def __init__(self, application: Callable[..., Awaitable[None]], token: str) -> None:
        self._application = application
        self._token = token
        self._key = token or secrets.token_urlsafe()

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Handle one connection."""
        if scope['type'] not in ('http', 'websocket'):
            await self._application(scope, receive, send)
            return
        headers = {name.decode('latin-1').lower(): value.decode('latin-1') for name, value in scope['headers']}
        added = [*UNFRAMED]

        async def answer(message: dict[str, Any]) -> None:
            if message['type'] == 'http.response.start':
                message['headers'] = [*message['headers'], *added]
            await send(message)

        try:
            given = parse_qs(scope.get('query_string', b'').decode()).get('token', [''])[0]
            allowed = is_allowed(headers, self._token, given)
        except (ValueError, CookieError):
            await _say(scope, answer, 400, UNREADABLE)
            return
        if not allowed:
            await _say(scope, answer, 403, REFUSAL)
            return
        if self._token and given:
            added.append((b'set-cookie', f'{COOKIE}={self._token}; HttpOnly; SameSite=Strict; Path=/'.encode()))
        # whoever is allowed by a token has the key
        has_key = bool(self._token) or _is_same(given, self._key)
        path = scope['path']
        if path == '/' or (path == PAGE_PATH and not has_key):
            entrance = ENTRANCE.format(address=f'{PAGE_PATH}?token={quote(self._key)}')
            await _say(scope, answer, 200, entrance, 'text/html')
        elif path == PAGE_PATH and _is_crowded():
            await _say(scope, answer, 503, CROWDED)
        elif path.startswith(SOCKET_PATH) and scope['type'] == 'http':
            await _say(scope, answer, 404, UNKNOWN)
        else:
            await self._application(scope, receive, answer)


def is_allowed(headers: dict[str, str], token: str, given: str = '') -> bool:
    """Whether a request with these headers (lower case) and this token in its address may see the page. Raises
    `ValueError` or `CookieError` where one of them cannot be parsed.
    """
    host, origin = headers.get('host', ''), headers.get('origin')
    name = urlsplit(f'//{host}').hostname
    if origin is not None and urlsplit(origin).netloc != host:
        return False
    if not token:
        return name in LOCAL_NAMES
    cookie = SimpleCookie(headers.get('cookie', '')).get(COOKIE)
    return _is_same(given, token) or (cookie is not None and _is_same(cookie.value, token))


def _is_same(shown: str, secret: str) -> bool:
    return secrets.compare_digest(shown.encode(), secret.encode())


async def _say(scope: dict[str, Any], send: Any, status: int, text: str, kind: str = 'text/plain') -> None:
    """Answer a request with a text, or refuse a websocket."""
    if scope['type'] == 'websocket':
        await send({'type': 'websocket.close', 'code': 1008})
        return
    headers = [(b'content-type', f'{kind}; charset=utf-8'.encode()), (b'cache-control', b'no-store')]
    await send({'type': 'http.response.start', 'status': status, 'headers': headers})
    await send({'type': 'http.response.body', 'body': text.encode()})


def _is_crowded() -> bool:
    return sum(not client.has_socket_connection for client in Client.instances.values()) >= FEW


@contextmanager
def served(state: PageState, host: str, port: int, token: str) -> Iterator[str]:
    """Serve the page while the block runs, on a free port for 0; yields its address."""
    check_installed()
    try:
        listener = socket.create_server((host, port), family=socket.AF_INET6 if ':' in host else socket.AF_INET)
    except OSError as error:
        # the library adds the address, which is said already
        reason = str(error.strerror).partition(' (')[0]
        raise InputError(
            f'the page cannot listen on {host}:{port} ({reason}): choose another port with --port'
        ) from error
    application = fastapi.FastAPI()
    ui.page(PAGE_PATH)(lambda: build(state))
    # the library would build a page to say so
    pages.add_exception_handler(404, lambda *_: fastapi.Response(UNKNOWN, 404, media_type='text/plain'))
    ui.run_with(
        application,
        title='swath_sysid',
        dark=None,
        language='en-US',
        message_history_length=FEW,
        show_welcome_message=False,
    )
    pages.timer(SCREEN_PERIOD, state.refresh)
    server = uvicorn.Server(
        uvicorn.Config(Guard(application, token), log_level='error', lifespan='on', timeout_graceful_shutdown=1)
    )
    thread = threading.Thread(target=lambda: server.run(sockets=[listener]), daemon=True)
    thread.start()
    shown = 'localhost' if host in LOCAL_NAMES else _address() if host in ('0.0.0.0', '::') else host
    try:
        yield f'http://{shown}:{listener.getsockname()[1]}/' + (f'?token={quote(token)}' if token else '')
    finally:
        server.should_exit = True
        thread.join(END_S)
        state.close()


def _address() -> str:
    """The address of this machine in its network: a phone cannot resolve a host name."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unsent:
        try:
            # nothing is sent; the system only chooses the interface (RFC 5737 gives this address for examples)
            unsent.connect(('192.0.2.1', 9))
        except OSError:
            return socket.gethostname()
        return unsent.getsockname()[0]
