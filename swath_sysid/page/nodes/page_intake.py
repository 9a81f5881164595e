"""What the page takes from others: its callbacks live with whatever comes, and report what cannot be shown."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from swath_sysid.common.errors import InputError
from swath_sysid.nodes.parameters.table import Values, parameters_of


def coming_from(source: str) -> Callable:
    """A callback of `PageNode` whose `InputError` is reported as what cannot be shown of a topic or node."""

    def guarded(take: Callable) -> Callable:
        return lambda node, *content: node.take(source, partial(take, node), *content)

    return guarded


def keeping(name: str, source: str, read: Callable[[Any], Any]) -> Callable:
    """Such a callback that sets one attribute of the record."""

    @coming_from(source)
    def take(node: Any, message: Any) -> None:
        content = read(message)
        with node.lock:
            setattr(node.record, name, content)

    return take


def values_of(node: str, names: Sequence[str], found: Sequence[Any]) -> Values:
    """The values of parameters of a node; raises `InputError` where they are not those of its table."""
    try:
        values = dict(zip(names, found, strict=True))
        table = [parameter for parameter in parameters_of(node, values) if parameter.name in names]
        wrong = [each.name for each in table if not _is_like(values[each.name], each.default)]
        wrong += [each.name for each in table if not wrong and each.problem(values[each.name])]
    except (TypeError, ValueError):
        wrong = list(names)
    if wrong:
        raise InputError(f'another node is called {node}, without its parameter {wrong[0]}: end or rename that node')
    return values


def _is_like(value: Any, default: Any) -> bool:
    if isinstance(default, list):
        return isinstance(value, list) and all(type(each) is type(default[0]) for each in value)
    return type(value) is type(default)
