"""Serving the page from a thread, to this machine only or with a token."""

import secrets
import socket
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from http.cookies import SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import END_S
from swath_sysid.page.layout import SCREEN_PERIOD, build
from swath_sysid.page.state import PageState

try:
    import fastapi
    import uvicorn
    from nicegui import app as pages
    from nicegui import ui
except ImportError:  # `check_installed` says what to install
    ui = None  # type: ignore[assignment]

COOKIE = 'swath_sysid_page'
LOCAL_NAMES = ('localhost', '127.0.0.1', '::1')
#: Messages kept for a browser that reconnects; the next update replaces them, so few are needed.
FEW_MESSAGES = 10

REFUSAL = b'Open the address that swath-sysid page printed, with its token.'


def check_installed() -> None:
    """Raise `InputError` where the web part is not installed."""
    if ui is None:
        raise InputError('the page needs nicegui: pip install swath_sysid[page]')


class Guard:
    """ASGI that admits requests with the token or, without one, those for this machine by its own name. Both reject
    pages of other origins that a browser may have open.
    """

    def __init__(self, application: Callable[..., Awaitable[None]], token: str) -> None:
        self._application = application
        self._token = token

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Handle one connection."""
        if scope['type'] not in ('http', 'websocket'):
            await self._application(scope, receive, send)
            return
        given = parse_qs(scope.get('query_string', b'').decode()).get('token', [''])[0]
        headers = {name.decode('latin-1').lower(): value.decode('latin-1') for name, value in scope['headers']}
        if not is_allowed(headers, self._token, given):
            await _refuse(scope, send)
            return

        async def with_cookie(message: dict[str, Any]) -> None:
            if message['type'] == 'http.response.start' and given:
                cookie = f'{COOKIE}={given}; HttpOnly; SameSite=Strict; Path=/'
                message['headers'] = [*message['headers'], (b'set-cookie', cookie.encode())]
            await send(message)

        await self._application(scope, receive, with_cookie)


def is_allowed(headers: dict[str, str], token: str, given: str = '') -> bool:
    """Whether a request with these headers (lower case) and this token in its address may see the page."""
    host, origin = headers.get('host', ''), headers.get('origin')
    if origin is not None and urlsplit(origin).netloc != host:
        return False
    if not token:
        return urlsplit(f'//{host}').hostname in LOCAL_NAMES
    cookie = SimpleCookie(headers.get('cookie', '')).get(COOKIE)
    shown = given, cookie.value if cookie else ''
    return any(secrets.compare_digest(each.encode(), token.encode()) for each in shown)


async def _refuse(scope: dict[str, Any], send: Any) -> None:
    if scope['type'] == 'websocket':
        await send({'type': 'websocket.close', 'code': 1008})
        return
    await send({'type': 'http.response.start', 'status': 403, 'headers': [(b'content-type', b'text/plain')]})
    await send({'type': 'http.response.body', 'body': REFUSAL})


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
    ui.run_with(
        application,
        root=lambda: build(state),
        title='swath_sysid',
        dark=None,
        language='en-US',
        message_history_length=FEW_MESSAGES,
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
        yield f'http://{shown}:{listener.getsockname()[1]}/' + (f'?token={token}' if token else '')
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
