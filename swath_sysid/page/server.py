"""Serving the page from a thread, to this machine only or with a token."""

import asyncio
import secrets
import socket
import struct
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from functools import partial
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
    from uvicorn.protocols.http.h11_impl import H11Protocol
except ImportError:  # `check_installed` says what to install
    ui = None  # type: ignore[assignment]
    H11Protocol = object  # type: ignore[assignment, misc]

COOKIE = 'swath_sysid_page_'  #: And the port: one host may serve several pages.
LOCAL_NAMES = ('localhost', '127.0.0.1', '::1')
#: Messages kept for a browser that reconnects, which the next update replaces, and pages that may wait for their
#: connection at a time: the library keeps each of them for a minute.
FEW = 10
#: Connections that send a request, and browsers, at a time; s within which a request, or who connects for no page that
#: is open, has to come to its end; and bytes of a browser's message.
MOST_CONNECTIONS, MOST_SOCKETS, REQUEST_S, LARGEST_MESSAGE = 100, 100, 8.0, 1_000_000

PAGE_PATH = '/page'  #: Of the page itself; ``/`` only leads a browser there.
#: Of the library's websocket; each request without one would keep a session for a minute.
SOCKET_PATH = '/_nicegui_ws/'
#: On every answer: nothing is loaded from elsewhere, no site can show it in a frame or read its address. The library
#: compiles templates in the browser.
PROTECTION = (
    (
        b'content-security-policy',
        b"default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        b"img-src 'self' data:; font-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'; "
        b"frame-ancestors 'none'",
    ),
    (b'x-frame-options', b'DENY'),
    (b'x-content-type-options', b'nosniff'),
    (b'referrer-policy', b'no-referrer'),
)
PREFIX = b'x-forwarded-prefix'  #: By which the library is told the path that a proxy adds.
FORWARDED = ('forwarded', 'x-forwarded-for', 'x-forwarded-host', 'x-forwarded-prefix')
ENTRANCE = """<!DOCTYPE html>
<html lang="en"><meta charset="utf-8"><title>swath_sysid</title><link rel="icon" href="data:,">
<meta http-equiv="refresh" content="0; url={address}"><a href="{address}">Open the page</a></html>
"""
REFUSAL = (
    'Open the address that swath-sysid page printed, with its token; behind a reverse proxy, start the page with '
    '--origin and the address that browsers open.'
)
UNREADABLE = 'Host, Origin or Cookie of this request cannot be read: open the printed address in a private window.'
READ_ONLY = 'The page only answers GET: open its address in a browser.'
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

    def __init__(
        self, application: Callable[..., Awaitable[None]], token: str, port: int = 0, origin: str = ''
    ) -> None:
        self._application = application
        self._token = token
        self._key = token or secrets.token_urlsafe()
        self._cookie = f'{COOKIE}{port}'
        parts = urlsplit(origin)
        self._prefix = parts.path.rstrip('/')
        self._origin = f'{parts.scheme}://{parts.netloc}' if origin else ''
        self._sockets = {True: 0, False: 0}  # of browsers, by whether their page is known

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Handle one connection."""
        if scope['type'] not in ('http', 'websocket'):
            await self._application(scope, receive, send)
            return
        headers = {name.decode('latin-1').lower(): value.decode('latin-1') for name, value in scope['headers']}
        added = [*PROTECTION]

        async def answer(message: dict[str, Any]) -> None:
            if message['type'] == 'http.response.start':
                message['headers'] = [*message['headers'], *added]
            await send(message)

        try:
            given = parse_qs(scope.get('query_string', b'').decode()).get('token', [''])[0]
            allowed = is_allowed(headers, self._token, given, self._cookie, self._origin)
        except (ValueError, CookieError):
            await _say(scope, answer, 400, UNREADABLE)
            return
        if not allowed:
            await _say(scope, answer, 403, REFUSAL)
            return
        if self._token and given:
            secure = '; Secure' if self._origin.startswith('https:') else ''
            cookie = f'{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path={self._prefix}/{secure}'
            added.append((b'set-cookie', cookie.encode()))
        # whoever is allowed by a token has the key
        has_key = bool(self._token) or _is_same(given, self._key)
        path = scope['path'].removeprefix(f'{self._prefix}/' if self._prefix else '')
        path = path if path.startswith('/') else f'/{path}'
        if scope.get('method', 'GET') not in ('GET', 'HEAD'):
            await _say(scope, answer, 405, READ_ONLY)
        elif path == '/' or (path == PAGE_PATH and not has_key):
            entrance = ENTRANCE.format(address=f'{PAGE_PATH[1:]}?token={quote(self._key)}')
            await _say(scope, answer, 200, entrance, 'text/html')
        elif path == PAGE_PATH and _is_crowded():
            await _say(scope, answer, 503, CROWDED)
        elif path.startswith(SOCKET_PATH) and scope['type'] == 'http':
            await _say(scope, answer, 404, UNKNOWN)
        else:
            # what a browser says of its prefix is not believed
            kept = [(name, value) for name, value in scope['headers'] if name.lower() != PREFIX]
            inner = {**scope, 'path': path, 'headers': [*kept, (PREFIX, self._prefix.encode())]}
            if scope['type'] == 'websocket':
                await self._connect(inner, receive, answer)
            else:
                await self._application(inner, receive, answer)

    async def _connect(self, scope: dict[str, Any], receive: Any, answer: Any) -> None:
        """Let a browser connect for its page; for a page that is not open only to be told to load it again."""
        client = parse_qs(scope['query_string'].decode()).get('client_id', [''])[0]
        is_known = client in Client.instances
        if self._sockets[is_known] >= (MOST_SOCKETS if is_known else FEW):
            await _say(scope, answer, 503, CROWDED)
            return
        self._sockets[is_known] += 1
        try:
            async with asyncio.timeout(None if is_known else REQUEST_S):
                await self._application(scope, receive, answer)
        except TimeoutError:
            await answer({'type': 'websocket.close', 'code': 1008})
        finally:
            self._sockets[is_known] -= 1


class BoundedConnection(H11Protocol):
    """A connection that must send its request in time; of too many the oldest that sends none makes room."""

    def __init__(self, *args: Any, waiting: dict['BoundedConnection', None], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._waiting = waiting

    def connection_made(self, transport: Any) -> None:
        """Make room, and limit its time."""
        super().connection_made(transport)
        self._waiting[self] = None
        self.loop.call_later(REQUEST_S, self._end_in_time)
        if len(self._waiting) > MOST_CONNECTIONS:
            next((each for each in self._waiting if not each.is_answering), self)._abort()

    @property
    def is_answering(self) -> bool:
        """Whether a whole request has come and its answer is under way."""
        return self.cycle is not None and not self.cycle.response_complete

    def connection_lost(self, exc: Exception | None) -> None:
        """Count it no more."""
        self._waiting.pop(self, None)
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Any) -> None:
        """From here on a browser is counted, by `Guard`."""
        self._waiting.pop(self, None)
        super().handle_websocket_upgrade(event)

    def _end_in_time(self) -> None:
        if self.is_answering:
            self.cycle.keep_alive = False
        elif self in self._waiting:
            self.transport.close() if self.cycle else self._abort()

    def _abort(self) -> None:
        # with a reset: the system keeps nothing of it either
        self.transport.get_extra_info('socket').setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack('ii', 1, 0))
        self.transport.abort()


def is_allowed(headers: dict[str, str], token: str, given: str = '', cookie_name: str = '', origin: str = '') -> bool:
    """Whether a request with these headers (lower case) and this token in its address may see the page, which browsers
    may also open at another ``origin``. Raises `ValueError` or `CookieError` where a header cannot be parsed.
    """
    host, sender = headers.get('host', ''), headers.get('origin')
    name = urlsplit(f'//{host}').hostname
    if sender is not None and urlsplit(sender).netloc != host and (not origin or sender != origin):
        return False
    if not origin and any(header in headers for header in FORWARDED):
        return False
    if not token:
        return name in LOCAL_NAMES
    cookie = SimpleCookie(headers.get('cookie', '')).get(cookie_name)
    return _is_same(given, token) or (cookie is not None and _is_same(cookie.value, token))


def _is_same(shown: str, secret: str) -> bool:
    return secrets.compare_digest(shown.encode(), secret.encode())


async def _say(scope: dict[str, Any], send: Any, status: int, text: str, kind: str = 'text/plain') -> None:
    """Answer a request with a text, or refuse a websocket."""
    if scope['type'] == 'websocket':
        # before it is accepted, this answers 403
        await send({'type': 'websocket.close', 'code': 1008})
        return
    headers = [(b'content-type', f'{kind}; charset=utf-8'.encode()), (b'cache-control', b'no-store')]
    await send({'type': 'http.response.start', 'status': status, 'headers': headers})
    await send({'type': 'http.response.body', 'body': text.encode()})


def _is_crowded() -> bool:
    return sum(not client.has_socket_connection for client in Client.instances.values()) >= FEW


@contextmanager
def served(state: PageState, host: str, port: int, token: str, origin: str = '') -> Iterator[str]:
    """Serve the page while the block runs, on a free port for 0; yields its address, which a proxy's ``origin`` is."""
    check_installed()
    try:
        listener = socket.create_server((host, port), family=socket.AF_INET6 if ':' in host else socket.AF_INET)
    except OSError as error:
        # the library adds the address, which is said already
        reason = str(error.strerror).partition(' (')[0]
        raise InputError(
            f'the page cannot listen on {host}:{port} ({reason}): choose another port with --port'
        ) from error
    application = fastapi.FastAPI(openapi_url=None)
    bound = listener.getsockname()[1]
    pages.router.redirect_slashes = False
    # Quasar's bar over the page has no name that a screen reader could say
    pages.config.quasar_config['loadingBar']['skipHijack'] = True
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
        uvicorn.Config(
            Guard(application, token, bound, origin),
            http=partial(BoundedConnection, waiting={}),  # type: ignore[arg-type]
            ws_max_size=LARGEST_MESSAGE,
            log_level='error',
            lifespan='on',
            timeout_graceful_shutdown=1,
        )
    )
    thread = threading.Thread(target=lambda: server.run(sockets=[listener]), daemon=True)
    thread.start()
    shown = 'localhost' if host in LOCAL_NAMES else _address() if host in ('0.0.0.0', '::') else host
    try:
        address = f'{origin.rstrip("/")}/' if origin else f'http://{shown}:{bound}/'
        yield address + (f'?token={quote(token)}' if token else '')
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
