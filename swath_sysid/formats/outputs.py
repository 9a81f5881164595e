"""Where results are to go, looked at before the work begins: what would destroy something is refused."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import refuse_no_file
from swath_sysid.formats.text_tables import read_head

MODEL_ENDINGS = 'yaml', 'yml'  #: Of model files.
#: A table with a column of which the name begins so is a recording.
TIME_WORDS = ('time', 'stamp', 'packetcounter', 'sampletimefine')


@dataclass(frozen=True)
class Output:
    """One result that a verb writes."""

    option: str  #: As the command line names it, for messages.
    path: Any  #: None: not asked for.
    is_folder: bool = False  #: Whether it is a folder to write into, which may exist already.
    is_recording: bool = False  #: Whether it holds motion itself, and so may replace an earlier one of its kind.
    endings: tuple[str, ...] = ()  #: What the name may end in, without the dot; none: anything.


def check_outputs(outputs: Iterable[Output], inputs: Iterable[str | Path | None] = ()) -> None:
    """Reject outputs of a command that cannot be written, collide, or would destroy an input or a recording."""
    outputs = [output for output in outputs if output.path is not None]
    read = [Path(path) for path in inputs if path is not None and os.path.lexists(path)]
    for place, output in enumerate(outputs):
        named = f'{output.option} {output.path}'
        _check_name(output)
        if not output.is_folder:
            refuse_no_file(output.path, output.option)
        elif os.path.exists(output.path) and (not os.path.isdir(output.path) or _is_bag(output.path)):
            raise InputError(f'{named} is not a folder, or is a rosbag2 bag: choose another name')
        for path in read:
            if not output.is_folder and _are_same(output.path, path):
                raise InputError(f'{named} is read by this command, and would be lost: choose another name')
            if path.is_dir() and _is_bag(path) and _lies_in(output.path, path):
                raise InputError(f'{named} lies in the bag {path}, which is read: choose a place outside of it')
        for other in outputs[:place]:
            if _are_same(output.path, other.path):
                raise InputError(f'{output.option} and {other.option} both name {output.path}: give each its own name')
        _check_folder(output)
        if not (output.is_folder or output.is_recording) and _is_recording(output.path):
            raise InputError(f'{named} is a recording, which it would replace: choose another name, or remove it first')


def refuse_inputs_among(paths: Iterable[Path], inputs: Iterable[str | Path]) -> None:
    """Refuse to write files and folders of fixed names where one of them is, or holds, what is read."""
    for path in paths:
        for read in inputs:
            if _are_same(path, read) or _lies_in(read, path):
                raise InputError(f'{read} is read where {path} is to be written: choose another', 'output-over-input')


def _check_name(output: Output) -> None:
    if not str(output.path).strip():
        raise InputError(f'{output.option} is empty: give a name')
    try:
        os.stat(output.path)
    except FileNotFoundError:
        pass
    except (ValueError, OSError) as error:
        shown = str(output.path)[:80]
        raise InputError(f'cannot write {shown}: {getattr(error, "strerror", error)}; choose another name') from error
    if output.endings and Path(output.path).suffix.lower().lstrip('.') not in output.endings:
        raise InputError(f"{output.option} cannot be '{output.path}': end the name in .{' or .'.join(output.endings)}")


def _check_folder(output: Output) -> None:
    folder = Path(os.path.realpath(output.path))
    if not output.is_folder:
        folder = folder.parent
        if not folder.is_dir():
            raise InputError(f'cannot write {output.path}: there is no folder {folder}; choose one that exists')
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f'cannot write {output.path}: {folder} is not writable; choose another folder')


def _is_bag(path: str | Path) -> bool:
    from swath_sysid.formats.bags import is_bag

    return is_bag(path)


def _are_same(first: str | Path, second: str | Path) -> bool:
    both_exist = os.path.exists(first) and os.path.exists(second)
    return os.path.realpath(first) == os.path.realpath(second) or (both_exist and os.path.samefile(first, second))


def _lies_in(path: str | Path, folder: str | Path) -> bool:
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


def _is_recording(path: str | Path) -> bool:
    """Whether a file that exists holds a recording: a storage file of a bag, or a table with a time."""
    try:
        if not os.path.isfile(path):
            return False
        names = [] if _is_bag(path) else [name.lower().lstrip('_ ') for name in read_head(path).names]
    except (InputError, OSError):
        return False
    return not names or len(names) > 1 and any(n.startswith(TIME_WORDS) or n in ('t_s', 't_ms') for n in names)
