"""The page in headless Chromium: every step of the bring-up, faults with their cures, the buttons, narrow and wide."""

import asyncio
import gzip
import re
import shutil
import socket
import sys
import threading
import urllib.error
import urllib.request
from contextlib import suppress
from dataclasses import replace
from html import escape
from pathlib import Path
from unittest.mock import patch
from urllib.parse import urlsplit

import numpy as np
import pytest

nicegui = pytest.importorskip('nicegui', reason='the page needs nicegui: pip install swath_sysid[page]')
webdriver = pytest.importorskip('selenium.webdriver', reason='driving a browser needs selenium: pip install selenium')
keys = pytest.importorskip('selenium.webdriver.common.keys')

from package_process import wait_for  # noqa: E402
from tank_side import TankSide  # noqa: E402
from test_page_bring_up import REST_S  # noqa: E402

from swath_sysid.common.errors import InputError  # noqa: E402
from swath_sysid.formats.model_file import model_from_yaml, model_to_yaml  # noqa: E402
from swath_sysid.formats.reading import read_trial  # noqa: E402
from swath_sysid.page.bring_up import STEPS, Guidance  # noqa: E402
from swath_sysid.page.cli.page import origin_of, token_for  # noqa: E402
from swath_sysid.page.live_record import horizon_of  # noqa: E402
from swath_sysid.page.server import FEW, MOST_CONNECTIONS, Guard, is_allowed, served  # noqa: E402
from swath_sysid.page.state import PageState  # noqa: E402

CHROMIUM, DRIVER = shutil.which('chromium'), shutil.which('chromedriver')
needs_chromium = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason='no chromium with its driver: apt install chromium chromium-driver'
)
TOKEN = 'a-token-of-the-test'
#: In place of the recorder: writes its own command, and ends with a sentence when it is interrupted.
RECORDER = """
import pathlib, signal, sys
signal.signal(signal.SIGINT, lambda *_: (print('recorded'), sys.exit()))
pathlib.Path(sys.argv[3]).write_text(' '.join(sys.argv[1:]))
signal.pause()
"""


class SteppedState(PageState):
    def refresh(self):
        """The view is made when the test says so."""


class Tank(TankSide):
    """A source of the page: makes the view as the diagnostics come, and remembers what is pressed."""

    def __init__(self, folder):
        self.start_again()
        self.folder, self.lock, self.description, self.pressed = folder, threading.Lock(), '', []
        self.sensor, self.namespace = '/sensors/imu', 'boat1'
        self.state = SteppedState(self, folder, 'pitch')

    def press(self, button):
        self.pressed.append(button)
        with self.lock:
            if button in ('accept', 'refine'):
                self.record.is_kept = button == 'accept'
        self.look()

    def look(self):
        leads = range(0, 5_000_000_000, 100_000_000)
        names, values = ['roll', 'roll_std', 'pitch', 'pitch_std'], [0.0, 0.01, 0.01, 0.02] * len(leads)
        self.record.add_horizon(horizon_of(self.stamp_ns, list(leads), names, values))
        self.description = model_to_yaml(self.record.models) if self.record.models else ''
        PageState.refresh(self.state)
        return self.state.view.guidance

    def start_again(self):
        TankSide.__init__(self, rate=50.0)


class Screen:
    def __init__(self, driver, tank):
        self.driver, self.tank = driver, tank

    def text(self, name):
        return self.driver.execute_script(f"return document.querySelector('[data-name={name}]')?.innerText ?? ''")

    def wait_for(self, words, name='sentence'):
        wait_for(lambda: words in self.text(name), f'{words!r} in {name}')

    def loud(self):
        script = """return [...document.querySelectorAll('main .q-btn.bg-primary')]
            .filter(b => b.offsetParent !== null).map(b => b.dataset.action)"""
        return self.driver.execute_script(script)

    def wait_for_reason(self, name, words):
        """Wait until the tooltip of a button that cannot be pressed says why; that of another may still fade."""
        button = self.driver.find_element('css selector', f'[data-name={name}]')
        assert not button.is_enabled()
        webdriver.ActionChains(self.driver).move_to_element(button.find_element('xpath', '..')).perform()
        script = "return [...document.querySelectorAll('.q-tooltip')].map(each => each.innerText).join()"
        wait_for(lambda: words in self.driver.execute_script(script), f'tooltip with {words!r}')

    def press(self, name):
        """By keyboard alone: Tab to the button, which shows that it has the focus, and Enter."""
        view, of = self.tank.state.view, 'const each = document.activeElement, {name, action} = each?.dataset ?? {}'
        large = [view.guidance.action] if view.guidance.action not in ('', *view.refusals) else []
        # what is still to change would take the focus
        wait_for(lambda: self.loud() == large, f'{large} as the next step')

        def reached():
            self.keys(keys.Keys.TAB)
            return self.driver.execute_script(f"{of}; return each?.matches(':focus-visible') ? name || action : ''")

        wait_for(lambda: reached() == name, f'button {name} that can be pressed')
        self.keys(keys.Keys.ENTER)

    def keys(self, *keys):
        webdriver.ActionChains(self.driver).send_keys(*keys).perform()

    def shown_as(self, width, scheme):
        self.resize(width)
        features = [{'name': 'prefers-color-scheme', 'value': scheme}]
        self.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': features})
        wait_for(lambda: self.driver.execute_script(f"return !!document.querySelector('.body--{scheme}')"), scheme)

    def resize(self, width):
        metrics = {'width': width, 'height': 1400, 'deviceScaleFactor': 1, 'mobile': width < 600}
        self.driver.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', metrics)


def test_a_port_in_use_is_reported_with_the_flag_for_another():
    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        with (
            pytest.raises(InputError, match=r'Address already in use\): choose another port with --port$'),
            served(None, '127.0.0.1', port, TOKEN),
        ):
            pass


@pytest.fixture(scope='module')
def address(tmp_path_factory):
    tank = Tank(tmp_path_factory.mktemp('page'))
    # the clock of the page is that of the tank
    clock = patch('swath_sysid.page.state.monotonic', lambda: tank.clock)
    with clock, served(tank.state, '127.0.0.1', 0, TOKEN) as url:
        yield url, tank


@pytest.fixture(scope='module')
def screen(address):
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in ('--headless=new', '--no-sandbox', '--disable-dev-shm-usage', '--disable-gpu'):
        options.add_argument(argument)
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    try:
        url, tank = address
        driver.get(url)
        yield Screen(driver, tank)
    finally:
        driver.quit()


@needs_chromium
def test_the_guide_leads_from_the_first_sample_to_a_kept_model(screen):
    tank = screen.tank
    tank.look()
    screen.wait_for('nodes-missing: start the nodes', 'cure')
    tank.send(3.0)
    screen.wait_for('Keep')
    tank.send(REST_S)
    screen.wait_for('Now push the hull down at the bow by 5 degrees and let go.')
    tank.release(5.0, duration=3.0)
    screen.wait_for('of 5 degrees: let go.')
    tank.start_again()
    tank.send(REST_S)
    tank.release(5.0)
    screen.wait_for('2.6')
    screen.wait_for('1 release: 2.6', 'model')
    screen.wait_for('model off by 0.0', 'release')
    screen.wait_for('deg: next decay forecast to within', 'releases')
    level = tank.record.models['pitch'].metrics['verdict']
    assert screen.loud() == ['accept' if level == 'adequate' else 'restart']
    screen.press('accept')
    tank.send(7.0)
    screen.wait_for('Kept: 2.6')
    assert screen.loud() == ['save'] and tank.pressed == ['accept']


@needs_chromium
def test_every_button_does_by_keyboard_alone_what_it_says(screen, monkeypatch):
    tank, downloads = screen.tank, screen.tank.folder / 'downloads'
    screen.driver.execute_cdp_cmd('Page.setDownloadBehavior', {'behavior': 'allow', 'downloadPath': str(downloads)})
    monkeypatch.setattr('swath_sysid.page.state.verb_command', lambda *words: [sys.executable, '-c', RECORDER, *words])

    def files(folder, pattern):
        wait_for(lambda: [*folder.glob(pattern)], pattern)
        return [*folder.glob(pattern)]

    def pressed(name):
        tank.pressed.clear()
        screen.press(name)
        wait_for(lambda: tank.pressed == [name], name)
        tank.send(1.0)

    screen.press('restart')
    tank.start_again()
    tank.send(REST_S)
    screen.wait_for('Now push')
    screen.wait_for_reason('save', 'no model yet')
    assert screen.loud() == []
    tank.record.can_push = True
    tank.send(1.0)
    screen.wait_for('press Push and release')
    pressed('push')
    tank.release(5.0)
    screen.wait_for('2.6')
    screen.wait_for_reason('undo_rollback', 'nothing was rolled back')
    tank.steps_back = tank.steps_forward = 1
    tank.send(1.0)
    for name in ('accept', 'refine', 'identify', 'rollback', 'undo_rollback'):
        pressed(name)
    (saved,) = files(tank.folder, 'model_*.yaml')
    assert model_from_yaml(saved.read_text()).keys() == {'pitch'}
    screen.wait_for('saved', 'answers')
    saved.unlink()
    screen.press('save')
    files(tank.folder, 'model_*.yaml')
    screen.press('model.yaml')
    assert model_from_yaml(files(downloads, 'model.yaml')[0].read_text()).keys() == {'pitch'}
    screen.press('motion.csv')
    assert np.ptp(read_trial(files(downloads, 'motion.csv')[0]).time) > REST_S
    screen.press('record')
    (bag,) = files(tank.folder, '*.mcap')
    wait_for(lambda: bag.read_text() == f'record --output {bag} --topic /sensors/imu --namespace boat1', 'its command')
    tank.look()
    wait_for(lambda: 'Stop' in screen.driver.find_element('css selector', '[data-name=record]').text, 'another name')
    screen.press('record')
    wait_for(lambda: tank.look() and not tank.state.view.is_recording, 'the end of the recording')
    screen.wait_for('recorded', 'answers')
    axis = "return document.querySelector('[data-name=axis] [aria-pressed=true]').innerText.toLowerCase()"
    for chosen in ('roll', 'pitch'):
        # as by another browser
        tank.state.choose(chosen)
        wait_for(lambda chosen=chosen: screen.driver.execute_script(axis) == chosen, f'{chosen} at the top')
    screen.driver.execute_script("document.querySelector('[data-name=axis] button').focus()")
    screen.keys(keys.Keys.ENTER)
    wait_for(lambda: tank.state.axes[0] == 'roll', 'the axis that was chosen')
    tank.state.choose('pitch')


@needs_chromium
@pytest.mark.parametrize('scheme', ['light', 'dark'])
@pytest.mark.parametrize('width', [400, 1280])
def test_axe_has_no_finding(screen, width, scheme):
    axe = pytest.importorskip(
        'axe_selenium_python', reason='checks of access need axe: pip install axe-selenium-python'
    )
    script = Path(axe.__file__).parent / 'node_modules' / 'axe-core' / 'axe.min.js'
    screen.shown_as(width, scheme)
    screen.driver.execute_script(script.read_text(encoding='utf-8'))
    # once colours have changed to those of the scheme
    found = screen.driver.execute_async_script("""
        const told = arguments[arguments.length - 1]
        const ending = document.getAnimations().filter(each => each.effect.getTiming().iterations < Infinity)
        Promise.allSettled(ending.map(each => each.finished)).then(() => axe.run()).then(told)
        """)
    assert [(each['id'], each['nodes'][0]['html']) for each in found['violations']] == [] and len(found['passes']) > 25


def test_the_next_step_is_seen_before_the_libraries_have_come(address, monkeypatch):
    words, (url, tank) = 'Wait & see <b>', address
    tank.look()
    monkeypatch.setattr(tank.state, 'view', replace(tank.state.view, guidance=Guidance(STEPS[0], words)))
    root, _, token = url.partition('?')

    def got(path):
        with urllib.request.urlopen(f'{root}{path}?{token}', timeout=60.0) as answer:
            return answer.read()

    text = got('page').decode()
    needed = [got(path) for path in re.findall(r'@import url\("/(.+?)"\)', text)]
    assert f'<div id="first">{escape(words)} ' in text.partition('<div id="app"')[0]
    # as it is sent: under pytest alone the library compresses nothing
    assert len(needed) >= 3 and sum(len(gzip.compress(each)) for each in (text.encode(), *needed)) < 200_000


@needs_chromium
@pytest.mark.parametrize('width', [400, 1600])
def test_it_fits_phone_and_desk_with_charts_and_without_the_internet(screen, width):
    screen.resize(width)
    screen.driver.refresh()
    screen.wait_for('receiving', 'health')
    drawn, across, language, elsewhere = screen.driver.execute_script("""
        return [document.querySelectorAll('canvas').length, document.documentElement.scrollWidth,
                document.documentElement.lang,
                performance.getEntriesByType('resource').map(r => r.name).filter(n => !n.startsWith(location.origin))]
        """)
    if width == 400:
        # on a phone the forecast and the next step are seen at once
        bottom = "return document.querySelector('canvas').getBoundingClientRect().bottom + scrollY"
        assert screen.driver.execute_script(bottom) < 800
    assert drawn >= 5 and across <= width and language.startswith('en') and elsewhere == []
    assert [line['message'] for line in screen.driver.get_log('browser') if line['level'] == 'SEVERE'] == []


def test_without_the_token_nothing_is_shown(address):
    url, _ = address
    for wrong in (url.partition('?')[0], url.replace(TOKEN, 'another')):
        with pytest.raises(urllib.error.HTTPError, match='403'):
            urllib.request.urlopen(wrong, timeout=60.0)
    with urllib.request.urlopen(url, timeout=60.0) as answer:
        assert answer.status == 200 and TOKEN in answer.headers['set-cookie']


def status_and_headers(address):
    try:
        with urllib.request.urlopen(address, timeout=60.0) as answer:
            return answer.status, answer.headers
    except urllib.error.HTTPError as refused:
        return refused.code, refused.headers


def test_no_answer_can_be_framed_and_only_pages_on_their_way_to_a_browser_are_kept(address):
    url, _ = address
    root, _, token = url.partition('?')
    paths = ('', 'page', 'docs', 'redoc', 'openapi.json', 'page/', '_nicegui_ws/socket.io/', 'favicon.ico')
    # once with the token, once without
    answers = [status_and_headers(f'{root}{path}?{query}') for query in (token, '') for path in paths]
    assert [status for status, _ in answers] == [200, 200, *[404] * 5, 200, *[403] * 8]
    for _, headers in answers:
        (policy,) = headers.get_all('content-security-policy')
        assert policy.startswith("default-src 'self'; ") and policy.endswith("; frame-ancestors 'none'")
        expected = {'x-frame-options': 'DENY', 'x-content-type-options': 'nosniff', 'referrer-policy': 'no-referrer'}
        assert {name: headers.get_all(name) for name in expected} == {name: [text] for name, text in expected.items()}
    before = set(nicegui.Client.instances)
    for _ in range(2 * FEW):
        status_and_headers(url)
    assert set(nicegui.Client.instances) <= before
    waiting = [status_and_headers(f'{root}page?{token}')[0] for _ in range(2 * FEW)]
    assert sorted(set(waiting)) == [200, 503] and waiting.count(200) <= FEW


def answer_of(guard, *headers, path='/', query='', kind='http'):
    """Status and text of what ASGI answers, None for what it passes on."""
    sent, scope = [], {'type': kind, 'path': path, 'query_string': query.encode(), 'headers': [*headers]}

    async def send(message):
        sent.append(message)

    asyncio.run(guard(scope, None, send))
    start, body = sent if len(sent) == 2 else (*sent, {'body': b''}) if sent else ({}, {'body': b''})
    return start.get('status', start.get('code')), body['body'].decode()


def guard_of(token, passed):
    async def application(scope, receive, send):
        passed.append(scope['path'])

    return Guard(application, token)


def test_without_a_token_only_who_reads_the_entrance_reaches_the_page(monkeypatch):
    monkeypatch.setattr(nicegui.Client, 'instances', {})
    passed = []
    guard, local = guard_of('', passed), (b'host', b'localhost:8484')
    status, entrance = answer_of(guard, local)
    assert status == 200 and answer_of(guard, local, path='/page', query='token=stale') == (200, entrance)
    # an image on another site
    assert answer_of(guard, local, (b'sec-fetch-site', b'cross-site'), path='/page') == (200, entrance)
    assert answer_of(guard, local, (b'origin', b'http://elsewhere.example'))[0] == 403
    assert passed == []
    path, _, query = re.search(r'url=([^"]+)', entrance).group(1).partition('?')
    answer_of(guard, local, path=path, query=query)
    assert passed == ['/page']
    # the key is no token: it opens nothing under another name
    assert answer_of(guard, (b'host', b'elsewhere.example'), path=path, query=query)[0] == 403
    assert guard_of('', [])._key != guard._key


@pytest.mark.parametrize('token', ['', 't'])
@pytest.mark.parametrize(
    'headers',
    [
        [(b'host', b'[::1')],
        [(b'host', b'localhost'), (b'origin', b'http://[::1')],
        [(b'host', b'localhost'), (b'cookie', b'a/b=c')],
    ],
)
def test_headers_that_cannot_be_parsed_are_refused_in_one_sentence(headers, token):
    passed = []
    guard = guard_of(token, passed)
    if headers[-1][0] == b'cookie' and not token:
        # it is not needed there, and other servers on this machine may have set it
        assert answer_of(guard, *headers)[0] == 200
        return
    status, text = answer_of(guard, *headers, query='token=t')
    assert status == 400 and text.count('.') == 1 and 'open the printed address' in text
    assert answer_of(guard, *headers, query='token=t', kind='websocket') == (1008, '') and passed == []


@pytest.mark.parametrize(
    ('headers', 'token', 'given', 'allowed'),
    [
        ({'host': 'localhost:8484'}, '', '', True),
        ({'host': '127.0.0.1:8484', 'origin': 'http://127.0.0.1:8484'}, '', '', True),
        ({'host': '[::1]:8484'}, '', '', True),
        # another name for this machine, or a page of another origin in the same browser
        ({'host': 'elsewhere.example:8484'}, '', '', False),
        ({'host': 'localhost:8484', 'origin': 'http://elsewhere.example'}, '', '', False),
        ({'host': 'craft:8484'}, 't', 't', True),
        ({'host': 'craft:8484', 'cookie': 'of_8484=t'}, 't', '', True),
        ({'host': 'craft:8484', 'cookie': 'of_8484=u'}, 't', '', False),
        # of another page on this host
        ({'host': 'craft:8484', 'cookie': 'of_8485=t'}, 't', '', False),
        # through a proxy that nobody has named
        ({'host': 'localhost:8484', 'x-forwarded-for': '10.0.0.7'}, '', '', False),
        ({'host': 'craft:8484', 'origin': 'http://elsewhere.example'}, 't', 't', False),
        ({'host': 'localhost:8484'}, 't', '', False),
    ],
)
def test_who_may_see_the_page(headers, token, given, allowed):
    assert is_allowed(headers, token, given, 'of_8484') is allowed


@pytest.mark.parametrize('host', ['boat.example', '127.0.0.1:8484'])
@pytest.mark.parametrize('path', ['/craft1/page', '/page'])
def test_behind_a_proxy_only_the_named_origin_opens_the_page_whatever_it_does_to_host_and_path(monkeypatch, host, path):
    monkeypatch.setattr(nicegui.Client, 'instances', {})
    passed, added = [], []

    async def application(scope, receive, send):
        passed.append(scope['path'])
        added.extend(value for name, value in scope['headers'] if name == b'x-forwarded-prefix')

    guard = Guard(application, 't', 8484, 'https://boat.example/craft1/')
    shared = (b'host', host.encode()), (b'x-forwarded-for', b'10.0.0.7'), (b'x-forwarded-prefix', b'/evil')
    own, evil = (b'origin', b'https://boat.example'), (b'origin', b'https://elsewhere.example')
    assert answer_of(guard, *shared, own, path=path)[0] == 403
    assert answer_of(guard, *shared, evil, path=path, query='token=t')[0] == 403 and passed == []
    answer_of(guard, *shared, own, path=path, query='token=t')
    assert passed == ['/page'] and added == [b'/craft1']
    status, entrance = answer_of(guard, *shared, path='/craft1/', query='token=t')
    assert status == 200 and 'url=page?token=t"' in entrance


def test_the_cookie_names_the_port_and_goes_to_the_path_of_the_proxy_alone():
    sent = []

    async def send(message):
        sent.append(message)

    guard = Guard(None, 't', 8484, 'https://boat.example/craft1/')
    scope = {'type': 'http', 'path': '/craft1/', 'query_string': b'token=t', 'headers': [(b'host', b'boat.example')]}
    asyncio.run(guard(scope, None, send))
    assert dict(sent[0]['headers'])[b'set-cookie'] == (
        b'swath_sysid_page_8484=t; HttpOnly; SameSite=Strict; Path=/craft1/; Secure'
    )


@pytest.mark.parametrize('given', ['boat.example', 'ftp://boat.example', 'https://', 'https://boat.example/?a=b'])
def test_an_origin_that_is_no_address_is_refused(given):
    with pytest.raises(InputError, match='is no address: give what browsers open'):
        origin_of(given)


def test_a_proxy_requires_a_token():
    assert token_for('localhost', '') == '' and token_for('https://localhost/craft1', '') and token_for('', 't') == 't'


def is_closed(connection):
    try:
        return connection.recv(1) == b''
    except (ConnectionError, TimeoutError) as error:
        return isinstance(error, ConnectionError)


def test_half_requests_and_sockets_of_no_page_are_bounded_in_number_and_time(address, monkeypatch):
    monkeypatch.setattr('swath_sysid.page.server.REQUEST_S', 1.0)
    url, _ = address
    parts = urlsplit(url)
    head = f'GET {{}} HTTP/1.1\r\nHost: {parts.netloc}\r\n'
    wanted = head.format(f'/_nicegui_ws/socket.io/?EIO=4&transport=websocket&{parts.query}').encode()
    wanted += b'Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n'
    wanted += b'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n'

    def opened(text, count):
        connections = [socket.create_connection((parts.hostname, parts.port), 60.0) for _ in range(count)]
        for connection in connections:
            with suppress(ConnectionError):
                connection.sendall(text)
        return connections

    halves = opened(head.format('/').encode() + b'X: ', 2 * MOST_CONNECTIONS)
    assert status_and_headers(url)[0] == 200
    assert all(map(is_closed, halves))
    idle = opened(wanted, 2 * FEW)
    codes = [connection.recv(12)[-3:] for connection in idle]
    assert codes.count(b'101') <= FEW and set(codes) <= {b'101', b'403'}
    # the end of each is in what follows its answer
    for connection in idle:
        while not is_closed(connection):
            pass
    assert status_and_headers(url)[0] == 200
