"""What all YAML files of models share: reading the text, and checking fields and numbers."""
import yaml

from swath_sysid.errors import InputError


def text_of(path):
    """Text of a model file.

    Raises
    ------
    InputError
        It cannot be read, or is no text.
    """
    try:
        with open(path, encoding='utf-8') as file:
            return file.read()
    except OSError as error:
        raise InputError(f'cannot read the model file {path}: {error.strerror}') from error
    except UnicodeDecodeError as error:
        raise InputError(f'{path} is no model file: it is not text') from error


def yaml_content(text, source):
    """Plain content of a YAML text.

    Raises
    ------
    InputError
        It is not YAML.
    """
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        line = getattr(getattr(error, 'problem_mark', None), 'line', 0) + 1
        raise InputError(f'{source} is not YAML (line {line}): give a file written by identify --output') from error


def check_fields(mapping, expected, source):
    """Raise `InputError` unless a mapping holds exactly the fields expected."""
    if not isinstance(mapping, dict):
        raise InputError(f'{source}: expected the fields {", ".join(expected)}')
    unknown = [str(name) for name in mapping if name not in expected]
    missing = [name for name in expected if name not in mapping]
    if unknown:
        raise InputError(f"{source}: unknown field '{unknown[0]}'; fields are {', '.join(expected)}")
    if missing:
        raise InputError(f"{source}: the field '{missing[0]}' is missing")


def number_of(value, source):
    """A plain number as float; `InputError` where it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{source}: '{value}' is not a number")
    return float(value)
