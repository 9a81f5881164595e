"""Files with wrong bytes: each is read, or refused in one sentence; none hangs, crashes or fills the memory.

Whole files are given, of any format. Of each, copies are made in turn with bits flipped, bytes set, cut out, doubled or
exchanged, and are read as records in a process of their own.

Run it as ``python benchmark/damaged_files.py FILE... [--files 2000] [--seed 0]``.
"""

import argparse
import multiprocessing
import os
import random
import resource
import tempfile
from collections import Counter
from pathlib import Path

from swath_sysid.common.errors import InputError
from swath_sysid.formats.reading import read_trial

LONGEST = 10.0  #: s of the processor; a file that takes longer hangs.
MEMORY = 1 << 30  #: Bytes beyond those of the process when it starts.


def damaged(whole: bytes, rng: random.Random) -> bytes:
    """A copy with one kind of damage."""
    at, size = rng.randrange(len(whole)), rng.choice([1, 4, 64, 1000])
    before, part, after = whole[:at], whole[at : at + size], whole[at + size :]
    match rng.randrange(7):
        case 0:
            copy = bytearray(whole)
            for _ in range(rng.choice([1, 3, 30])):
                copy[rng.randrange(len(copy))] ^= 1 << rng.randrange(8)
            return bytes(copy)
        case 1:
            return before + bytes([rng.choice([0, 255, 32, 44, 127])]) * len(part) + after
        case 2:
            return before + after
        case 3:
            return before + part + part + after
        case 4:
            return before
        case 5:
            return before + rng.randbytes(len(part)) + after
        case _:
            return after[:size] + part + before + after[size:]


def serve(pipe) -> None:
    """Read the files that come through a pipe, and answer what came of each."""
    pages = int(Path('/proc/self/statm').read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY,) * 2)
    while (path := pipe.recv()) is not None:
        try:
            trial = read_trial(path)
            outcome = 'read with words' if trial.advice else 'read'
        except InputError as error:
            lines = str(error).strip().splitlines()
            outcome = 'refused' if len(lines) == 1 and len(lines[0]) < 1000 else f'a refusal of {len(lines)} lines'
        except BaseException as error:  # noqa: BLE001 - what is searched for
            outcome = f'traceback: {type(error).__name__}: {str(error)[:100]}'
        pipe.send(outcome)


def seconds_of(process) -> float:
    """How long a process has run on a processor."""
    fields = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def answer(process, pipe) -> str:
    """What came of a file."""
    began = seconds_of(process)
    try:
        while not pipe.poll(0.5):
            if seconds_of(process) - began > LONGEST:
                return 'hangs'
        return pipe.recv()
    except (EOFError, OSError):
        return 'crashes'


def started(whole: list[Path]):
    """A process that reads and has compiled what it needs, and the end of its pipe."""
    own, other = multiprocessing.Pipe()
    process = multiprocessing.Process(target=serve, args=(other,), daemon=True)
    process.start()
    other.close()
    for path in whole:
        own.send(path)
        print(f'{path.name}, whole: {own.recv()}')
    return process, own


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('whole', nargs='+', type=Path)
    parser.add_argument('--files', type=int, default=2000)
    parser.add_argument('--seed', type=int, default=0)
    arguments = parser.parse_args()
    rng, outcomes, slowest = random.Random(arguments.seed), Counter(), (0.0, '')
    process, pipe = started(arguments.whole)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(arguments.files):
            source = arguments.whole[number % len(arguments.whole)]
            path = Path(folder, f'{number}{source.suffix}')
            path.write_bytes(damaged(source.read_bytes(), rng))
            began = seconds_of(process)
            pipe.send(path)
            outcome = answer(process, pipe)
            if outcome != 'crashes':
                slowest = max(slowest, (seconds_of(process) - began, path.name))
            if outcome in ('hangs', 'crashes'):
                process.kill()
                process.join()
                process, pipe = started(arguments.whole[:1])
            if outcome not in ('read', 'read with words', 'refused'):
                kept = Path(tempfile.gettempdir(), f'damaged_{source.stem}_{number}{source.suffix}')
                kept.write_bytes(path.read_bytes())
                print(f'{kept}: {outcome}', flush=True)
            outcomes[source.suffix, outcome.partition(':')[0]] += 1
            path.unlink()
    pipe.send(None)
    for (ending, outcome), count in sorted(outcomes.items()):
        print(f'{ending:10} {outcome:16} {count}')
    print(f'slowest: {slowest[0]:.1f} s ({slowest[1]})')


if __name__ == '__main__':
    main()
