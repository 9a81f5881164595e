"""The page: cards that fit a phone and a wide screen."""

from collections.abc import Callable
from functools import partial
from html import escape
from typing import Any

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.page.bring_up import STEPS
from swath_sysid.page.charts import curve_options, curve_series, motion_options, release_options
from swath_sysid.page.state import BUTTONS, GROUPS, PageState, View
from swath_sysid.pipeline.health import OK, STALE, WARN

try:
    from nicegui import ui
except ImportError:  # `server` says what to install
    ui = None  # type: ignore[assignment]

SCREEN_PERIOD = 0.4  #: s between pictures.

COLOURS = {STALE: 'grey', OK: 'positive', WARN: 'warning'}
CURVES = {'period': 'natural period [s]', 'damping': 'equivalent damping ratio [-]'}
CARD = 'w-full min-w-0'
#: Texts have a least height, so that what is below them seldom jumps.
STYLE = """
html { scrollbar-gutter: stable }
.lines { min-height: calc(var(--lines) * 1lh); overflow-wrap: anywhere }
h1 { font-size: 1.125rem; line-height: 1.75rem; margin: 0; letter-spacing: 0 }
.fault { color: #c62828 } .body--dark .fault { color: #ff8a80 }
.body--dark .q-btn--flat { --q-primary: #90caf9 }
#first { position: fixed; inset: 0; padding: 1rem; color-scheme: light dark; background: canvas; color: canvastext }
body:has(#app > *) #first { display: none }
"""
TRIAL_COLUMNS = [
    {'name': name, 'label': name, 'field': name, 'align': 'left'} for name in ('file', 'axis', 'loading', 'angle')
]

Update = Callable[[View], None]  #: Updates one card.


def build(state: PageState) -> None:
    """Lay out the page for one browser and keep it up to date."""
    guidance = state.view.guidance
    ui.add_head_html(f'<style>{STYLE}</style>')
    # seen at once, while the browser loads what draws the page
    ui.add_body_html(f'<div id="first">{escape(guidance.sentence)} {escape(guidance.cure)}</div>')
    ui.colors(primary='#1976d2', secondary='#00695c')
    with ui.header().classes('items-center py-2'):
        with ui.element('h1'):
            ui.label('swath_sysid')
        ui.space()
        chosen = ui.toggle(list(AXES), value=state.axes[0], on_change=lambda event: state.choose(event.value))
        chosen.props('dense color=primary toggle-color=secondary text-color=white data-name=axis')
    with ui.element('div').classes('w-full grid items-start gap-3 grid-cols-1 lg:grid-cols-2 xl:grid-cols-3'):
        above = _guide(state), *map(_motion, state.axes), _actions(state)
        updates = [*above, _release(), _model(), _calm(), _health(), _heave()]
        if state.manifest:
            updates.append(_trials())

    def refresh() -> None:
        # another browser may have chosen
        chosen.value = state.axes[0]
        for update in updates:
            update(state.view)

    refresh()
    ui.timer(SCREEN_PERIOD, refresh)


def _card(title: str) -> Any:
    card = ui.card().classes(CARD).props('flat bordered')
    with card:
        ui.label(title).classes('text-subtitle1 opacity-70')
    return card


def _guide(state: PageState) -> Update:
    with _card('Bring-up'):
        progress = ui.linear_progress(0.0, show_value=False).props('rounded aria-label="progress of the bring-up"')
        sentence = _text('text-subtitle1 text-weight-medium', 'sentence', 2)
        cure = _text('text-body1', 'cure', 2)
        primary = ui.button().props('no-caps unelevated').style('min-height: 2.75rem').classes('w-full')
        answers = _text('text-caption opacity-70 whitespace-pre-line', 'answers', 1)
    primary.on_click(lambda: _press(state, primary.props['data-action']))

    def update(view: View) -> None:
        guidance = view.guidance
        action = '' if guidance.action in view.refusals else guidance.action
        progress.value = (STEPS.index(guidance.step) + 1) / len(STEPS)
        sentence.text = guidance.sentence
        cure.text = f'{guidance.fault}: {guidance.cure}' if guidance.fault else guidance.cure
        cure.classes(add='fault') if guidance.fault else cure.classes(remove='fault')
        if action != primary.props.get('data-action'):
            primary.props(f'data-action="{action}"')
            primary.text = BUTTONS[action][0] if action else ''
            primary.visible = bool(action)
        answers.text = '\n'.join(reversed(view.answers))

    return update


def _actions(state: PageState) -> Update:
    """What else can be done, below the next step and the forecast."""
    buttons: dict[str, _Button] = {}
    with _card('Other actions'):
        for group in GROUPS:
            with ui.row().classes('gap-x-1 gap-y-0'):
                buttons |= {name: _Button(name, *texts, partial(_press, state, name)) for name, texts in group.items()}

    def update(view: View) -> None:
        action = '' if view.guidance.action in view.refusals else view.guidance.action
        for name, button in buttons.items():
            button.show(view.refusals.get(name, ''), name == action)
        buttons['push'].button.visible = view.can_push
        buttons['record'].button.text = 'Stop recording' if view.is_recording else BUTTONS['record'][0]

    return update


def _press(state: PageState, name: str) -> None:
    if '.' in name:
        ui.download.content(state.download(name), name)
    else:
        state.press(name)


class _Button:
    """A quiet button, or a disabled one with the reason as its tooltip."""

    def __init__(self, name: str, label: str, meaning: str, press: Callable[[], None]) -> None:
        self._meaning = meaning
        # a disabled button shows no tooltip of its own
        with ui.element('span'):
            self.button = ui.button(label, on_click=press).props(f'no-caps flat dense data-name="{name}"')
            self._tooltip = ui.tooltip(meaning)
        self._is_primary = False

    def show(self, refusal: str, is_primary: bool) -> None:
        """Update it; nothing is sent where it has not changed."""
        if is_primary != self._is_primary:
            self._is_primary = is_primary
            self.button.style(f'display: {"none" if is_primary else "inline-flex"}')
        if self._tooltip.text != (text := refusal or self._meaning):
            self.button.enabled, self._tooltip.text = not refusal, text


def _release() -> Update:
    with _card('The last free decay and the model'):
        words = _text('text-body2', 'release', 1)
        releases = _text('text-body2 opacity-70 whitespace-pre-line', 'releases', 4)
        chart = ui.echart(release_options()).classes('w-full h-64').props('data-name=release-chart')

    def update(view: View) -> None:
        words.text, releases.text = view.release_words, '\n'.join(view.releases)
        if view.release:
            _fill(chart, [view.release['measured'], view.release['fitted']])

    return update


def _motion(axis: str) -> Update:
    with _card(f'{axis.capitalize()} and its forecast (50, 90, 99 %)'):
        chart = ui.echart(motion_options('deg')).classes('w-full h-64')

    def update(view: View) -> None:
        if axis in view.motion:
            _move(chart, view.motion[axis])

    return update


def _heave() -> Update:
    """The vertical motion of the first named point, where points are forecast."""
    card = _card('Heave')
    with card:
        name = _text('text-body2', 'point')
        chart = ui.echart(motion_options('m')).classes('w-full h-64')
    card.visible = False

    def update(view: View) -> None:
        points = [quantity for quantity in view.motion if quantity not in AXES]
        card.visible = bool(points)
        if points:
            name.text = points[0]
            _move(chart, view.motion[points[0]])

    return update


def _health() -> Update:
    with _card('Health'):
        lines = ui.column().classes('gap-1 w-full').props('data-name=health')
    shown: list = []

    def update(view: View) -> None:
        if shown != view.health:
            shown[:] = view.health
            lines.clear()
            with lines:
                for name, level, sentence in view.health:
                    with ui.row().classes('items-start no-wrap w-full gap-2'):
                        ui.label('\u25cf').classes(f'text-{COLOURS.get(level, "negative")}')
                        _text('', 'status', 2).text = f'{name}: {sentence}'

    return update


def _model() -> Update:
    with _card('Model'):
        words = _text('text-body2 whitespace-pre-line', 'model', 4)
        with ui.expansion('Equation').props('dense').classes('w-full'):
            equation = _text('text-body2', 'equation', 1)
        charts = {name: ui.echart(curve_options(title)).classes('w-full h-48') for name, title in CURVES.items()}

    def update(view: View) -> None:
        words.text, equation.text = '\n'.join(view.model_words), view.equation
        for name, chart in charts.items():
            if view.model:
                _fill(chart, curve_series(view.model[name], view.model[f'measured_{name}']))

    return update


def _calm() -> Update:
    with _card('Sea and calm'):
        calm = _text('text-body1', 'calm', 4)
        sea = _text('text-body2 whitespace-pre-line', 'sea', 4)
        valid = _text('text-body2 opacity-70', 'valid', 1)

    def update(view: View) -> None:
        calm.text, sea.text, valid.text = view.calm, view.sea, view.valid

    return update


def _trials() -> Update:
    with _card('Campaign'):
        table = ui.table(columns=TRIAL_COLUMNS, rows=[], row_key='file')
        table.classes('w-full').props('dense flat data-name=trials')
        missing = _text('text-body2', 'missing').classes('whitespace-pre-line')

    def update(view: View) -> None:
        if table.rows != view.trials:
            table.rows = view.trials
        missing.text = '\n'.join(['Still missing:', *view.missing] if view.missing else ['Nothing is missing.'])

    return update


def _text(classes: str, name: str, lines: int = 0) -> Any:
    """A text by name, with a least height in lines."""
    label = ui.label().classes(f'{classes} w-full min-w-0 break-words').props(f'data-name={name}')
    if lines:
        label.classes('lines').style(f'--lines: {lines}')
    return label


def _move(chart: Any, changes: dict[str, Any]) -> None:
    """New motion, sent as a call: options would be processed twice per number and browser."""
    chart.run_chart_method('setOption', changes)


def _fill(chart: Any, data: list[list]) -> None:
    """New data for the series of a chart; nothing is sent where they have not changed."""
    series = chart.options['series']
    if any(each.get('data') != values for each, values in zip(series, data, strict=True)):
        for each, values in zip(series, data, strict=True):
            each['data'] = values
        chart.update()
