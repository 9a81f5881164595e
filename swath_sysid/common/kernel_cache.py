"""numba's cache of compiled kernels, kept in the user's cache folder; a kernel that it cannot give is compiled again.

Imported only where numba is loaded.
"""

import hashlib
import os
import pickle
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile
from types import CodeType, FunctionType
from typing import Any

from numba.core import caching, config
from numba.core.serialize import dumps

from swath_sysid import __version__
from swath_sysid.common.errors import InputError


def cache_folder() -> Path:
    """That of this version, in ``NUMBA_CACHE_DIR`` where it is set, else in the user's cache."""
    given, of_user = getattr(config, 'CACHE_DIR', ''), os.environ.get('XDG_CACHE_HOME', '')
    root = Path(given) if given else Path(of_user) if os.path.isabs(of_user) else Path.home() / '.cache'
    return root / 'swath_sysid' / __version__


def check_writable() -> None:
    """Raise `InputError` where nothing can be stored in the cache."""
    try:
        cache_folder().mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=cache_folder()):
            pass
    except OSError as error:
        raise InputError(
            f'{cache_folder()}: {error.strerror}, so compiled functions cannot be kept there: make it writable, or set '
            f'NUMBA_CACHE_DIR to a folder that is'
        ) from error


def content_of(code: CodeType, values: dict[str, Any]) -> tuple:
    """What the machine code depends on: bytecode, constants, and the globals it uses, kernels by their own content."""
    constants = (content_of(c, values) if isinstance(c, CodeType) else repr(c) for c in code.co_consts)
    used = (values[name] for name in code.co_names if name in values)
    kernels = ((value, getattr(value, '__wrapped__', None)) for value in used)
    return (
        code.co_code,
        *constants,
        *(
            content_of(f.__code__, f.__globals__) if isinstance(f, FunctionType) else repr(value)
            for value, f in kernels
        ),
    )


class _Place(caching._CacheLocator):
    """Where a kernel is kept: in a folder that need not be writable, by what its machine code is made from. numba's own
    stamp is of one file: a kernel would keep the former code of those that it calls from others.
    """

    def __init__(self, function: FunctionType) -> None:
        content = content_of(function.__code__, function.__globals__)
        self._stamp = hashlib.sha256(repr(content).encode()).hexdigest()

    @classmethod
    def from_function(cls, py_func: FunctionType, py_file: str) -> '_Place':
        return cls(py_func)

    def get_cache_path(self) -> str:
        return str(cache_folder())

    def get_source_stamp(self) -> str:
        return self._stamp

    def get_disambiguator(self) -> str:
        # so that copies of the package share it, and others of the same version have their own
        return self._stamp[:16]


class _Sealed(caching.CompileResultCacheImpl):
    """Compiled code with a checksum: what a power cut has left of it may crash the process."""

    _locator_classes: list[Any] = [_Place]

    def _seal(self, payload: bytes) -> bytes:
        return hashlib.sha256(self.locator.get_source_stamp().encode() + payload).digest()

    def reduce(self, data: Any) -> tuple[bytes, bytes]:
        payload = dumps(super().reduce(data))
        return self._seal(payload), payload

    def rebuild(self, target_context: Any, reduced_data: tuple[bytes, bytes]) -> Any:
        seal, payload = reduced_data
        if seal != self._seal(payload):
            raise ValueError('its checksum is wrong')
        return super().rebuild(target_context, pickle.loads(payload))


class KernelCache(caching.FunctionCache):
    """The cache of one kernel, which never fails: ``report`` gets the reason why it was of no use. ``found`` gets the
    kernel's name when it is at hand, ``missed`` before it is compiled, and may raise an error to prevent that.
    """

    _impl_class = _Sealed

    def __init__(
        self,
        function: Callable,
        report: Callable[[str], None],
        found: Callable[[str], None] = lambda name: None,
        missed: Callable[[str], None] = lambda name: None,
    ) -> None:
        super().__init__(function)
        self._report, self._found, self._missed = report, found, missed
        self._kernel = function.__qualname__

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled code, or None."""
        code = self._loaded(sig, target_context)
        (self._missed if code is None else self._found)(self._kernel)
        return code

    def _loaded(self, sig: Any, target_context: Any) -> Any:
        try:
            found = super().load_overload(sig, target_context)
            if found is not None and found.signature.args != tuple(sig):
                raise ValueError('its code is for other types')  # as when two processes stored at once
            return found
        except OSError as error:
            self._report(f'{cache_folder()}: {error.strerror}')
        except Exception as error:  # noqa: BLE001 - damaged bytes raise anything; what was raised is reported
            self._report(f'{cache_folder()}: a file is damaged, {error or type(error).__name__}')
        with suppress(OSError):  # then the next save fails as well
            self.flush()
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the compiled code."""
        self._found(self._kernel)
        try:
            super().save_overload(sig, data)
        except OSError as error:
            self._report(f'{cache_folder()}: {error.strerror}')
