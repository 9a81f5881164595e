"""Messages of which one field is spoilt, each in every way that its type allows."""

from copy import deepcopy

LONG = 'x' * 100_000
WHOLE = {'int8': (-(2**7), 2**7 - 1), 'uint8': (0, 2**8 - 1), 'int32': (-(2**31), 2**31 - 1), 'uint32': (0, 2**32 - 1)}
NAN, INF = float('nan'), float('inf')
VALUES = {
    **{kind: (*bounds, 1) for kind, bounds in WHOLE.items()},
    'double': (NAN, INF, -INF, 0.0, -1.0, 5e-324, 1e30, -1.7e308),
    'float': (NAN, INF, -INF, 0.0, -1.0, 3e38),
    'boolean': (False, True),
    'octet': (b'\x00', b'\x07', b'\xff'),
    'string': ('', 'x', 'a: [', '{}', '5', '\x00<b>\x1b[31m', 'nan', '-1', '1e400', LONG),
    'sequence<double>': ([], [NAN], [INF, -INF], [1e308] * 3, [0.1] * 1000),
    'sequence<string>': ([], ['roll'], ['roll', 'roll'], ['roll', 'pitch'], ['<b>', ''], [LONG]),
    'sequence<uint8>': ([], [255], [255] * 4096),
}


def ways_of(kind, value):
    if kind in VALUES:
        return VALUES[kind]
    if kind.startswith('double['):
        return [NAN] * len(value), [-1.0] + [0.0] * (len(value) - 1), [1e308] * len(value), [-INF] * len(value)
    if kind.startswith('sequence<'):
        return [], list(value)[:1], [*value, *value], [*value] * 1000
    return (type(value)(),)


def fields_of(message, before=()):
    """The way to each field and its type, the fields of messages in it included, and of the first two of a sequence."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        yield (*before, name), kind
        if hasattr(value, 'get_fields_and_field_types'):
            yield from fields_of(value, (*before, name))
        elif kind.startswith('sequence<') and '/' in kind:
            for place, each in enumerate(value[:2]):
                yield from fields_of(each, (*before, name, place))


def of(message, way):
    for step in way:
        message = message[step] if isinstance(step, int) else getattr(message, step)
    return message


def spoilt(good):
    """Each copy of a message with one spoilt field, and what that is."""
    for way, kind in fields_of(good):
        for value in ways_of(kind, of(good, way)):
            copy = deepcopy(good)
            setattr(of(copy, way[:-1]), way[-1], deepcopy(value))
            yield f'{".".join(map(str, way))} = {str(value)[:40]}', copy
