"""The page itself: cards that fit a phone and a wide screen."""

from collections.abc import Callable
from typing import Any

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.page.bring_up import STEPS
from swath_sysid.page.charts import curve_options, curve_series, motion_options
from swath_sysid.page.desk import Desk, View
from swath_sysid.pipeline.health import OK, WARN

try:
    from nicegui import ui
except ImportError:  # `server` says what to install
    ui = None  # type: ignore[assignment]

SCREEN_PERIOD = 0.4  #: s between pictures.

COLOURS = {OK: 'positive', WARN: 'warning'}
CURVES = {'period': 'natural period [s]', 'damping': 'equivalent damping ratio'}
CARD = 'w-full min-w-0'
BUTTONS = {
    'identify': ('Identify', 'fit a model to the last minute of motion now'),
    'accept': ('Accept', 'keep this model: motion is not refitted by itself any more'),
    'refine': ('Refine', 'let further releases refine the model again'),
    'rollback': ('Rollback', 'return to the model before'),
    'save': ('Save', 'write the model to a file on the machine of the page'),
    'restart': ('Start again', 'begin with the rest before a push'),
}
TRIAL_COLUMNS = [
    {'name': name, 'label': name, 'field': name, 'align': 'left'} for name in ('file', 'axis', 'loading', 'angle')
]

Update = Callable[[View], None]  #: What brings one card up to date.


def build(desk: Desk) -> None:
    """Lay out the page for one browser and keep it up to date."""
    with ui.header().classes('items-center py-2'):
        ui.label('swath_sysid').classes('text-lg')
        ui.space()
        ui.toggle(list(AXES), value=desk.view.axis or AXES[0], on_change=lambda event: desk.choose(event.value)).props(
            'dense color=primary toggle-color=secondary text-color=white'
        ).mark('axis')
    with ui.element('div').classes('w-full grid items-start gap-3 grid-cols-1 lg:grid-cols-2 xl:grid-cols-3'):
        updates = [
            _guide(desk),
            *(_motion(axis) for axis in AXES),
            _health(),
            _model(),
            _calm(),
            _heave(),
        ]
        if desk.manifest:
            updates.append(_trials())

    def refresh() -> None:
        for update in updates:
            update(desk.view)

    ui.timer(SCREEN_PERIOD, refresh)


def _card(title: str) -> Any:
    card = ui.card().classes(CARD).props('flat bordered')
    with card:
        ui.label(title).classes('text-subtitle1 opacity-70')
    return card


def _guide(desk: Desk) -> Update:
    with _card('Bring-up'):
        progress = ui.linear_progress(0.0, show_value=False).props('rounded')
        sentence = _text('text-h6', 'sentence')
        cure = _text('text-body1 text-weight-medium text-red-6', 'cure')
        with ui.row().classes('gap-2'):
            buttons = {
                name: ui.button(label, on_click=lambda name=name: desk.press(name))
                .props(f'no-caps {"" if name == "accept" else "outline"} data-name={name}')
                .tooltip(meaning)
                for name, (label, meaning) in BUTTONS.items()
            }
            record = ui.button(on_click=lambda: desk.press('record')).props('no-caps outline data-name=record')
        answers = _text('text-caption opacity-70', 'answers').classes('whitespace-pre-line')

    def update(view: View) -> None:
        guidance = view.guidance
        progress.value = (STEPS.index(guidance.step) + 1) / len(STEPS)
        sentence.text = guidance.sentence
        cure.text = f'{guidance.fault}: {guidance.cure}' if guidance.fault else ''
        record.text = 'Stop recording' if view.is_recording else 'Record to a bag'
        answers.text = '\n'.join(view.answers)
        buttons['accept'].enabled = bool(view.model)

    return update


def _motion(axis: str) -> Update:
    with _card(f'{axis.capitalize()} and its forecast with 50, 90 and 99 % intervals'):
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
                        ui.label(f'{name}: {sentence}').classes('min-w-0 break-words')

    return update


def _model() -> Update:
    with _card('Model'):
        words = _text('text-body2', 'model').classes('whitespace-pre-line')
        charts = {name: ui.echart(curve_options(title)).classes('w-full h-52') for name, title in CURVES.items()}

    def update(view: View) -> None:
        words.text = '\n'.join(view.model_words)
        for name, chart in charts.items():
            chart.visible = bool(view.model)
            if view.model:
                _fill(chart, curve_series(view.model[name]))

    return update


def _calm() -> Update:
    with _card('Sea and calm'):
        calm = _text('text-body1', 'calm')
        sea = _text('text-body2 whitespace-pre-line', 'sea')

    def update(view: View) -> None:
        calm.text, sea.text = view.calm, view.sea

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


def _text(classes: str, name: str) -> Any:
    return ui.label().classes(f'{classes} min-w-0 break-words').props(f'data-name={name}')


def _move(chart: Any, changes: dict[str, Any]) -> None:
    """New motion, as a call: as options each number would be looked at twice on its way, for each browser."""
    chart.run_chart_method('setOption', changes)


def _fill(chart: Any, data: list[list]) -> None:
    """New data for the series of a chart; nothing is sent where they are the same."""
    series = chart.options['series']
    if any(each.get('data') != values for each, values in zip(series, data, strict=True)):
        for each, values in zip(series, data, strict=True):
            each['data'] = values
        chart.update()
