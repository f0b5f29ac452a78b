"""`KeptCode`: machine code on disk; recompiled where a file cannot be read or written."""

import logging
import os
import stat
import tempfile
from itertools import count
from pathlib import Path
from typing import Any

from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    UserWideCacheLocator,
)

_SAID: set[str] = set()
"""Folders about which a warning was logged."""


class _InTemporaryFolder(UserWideCacheLocator):
    """Files in a folder of this user's in the temporary folder."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        self._own = Path(tempfile.gettempdir(), f"poise-{os.getuid()}")
        self._cache_path = str(self._own / Path(self._cache_path).name)

    def ensure_cache_path(self) -> None:
        """Make the folder; its files are run, so that nobody else may have written them."""
        self._own.mkdir(mode=0o700, exist_ok=True)
        found = self._own.lstat()
        if found.st_uid != os.getuid() or stat.S_IMODE(found.st_mode) & 0o022:
            raise PermissionError(f"{self._own} is not of this user alone")
        super().ensure_cache_path()


class _Places(CompileResultCacheImpl):
    """Numba's choice of a folder, and the last resort."""

    _locator_classes = (*CompileResultCacheImpl._locator_classes, _InTemporaryFolder)


class KeptCode(FunctionCache):
    """Numba's files of one function.

    They lie in the folder that NUMBA_CACHE_DIR names, beside the source, in the user's cache folder
    or in the temporary folder: the first that can be written.
    """

    _impl_class = _Places

    def __init__(self, function: Any, stamp: str) -> None:
        super().__init__(function)
        # Numba's own stamp is of the function's file only, not of its callees'.
        self._cache_file = self._files = _Files(self._cache_path, self._impl.filename_base, stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return machine code for a signature, or None."""
        # Numba's own would first read all that it can compile, SciPy's linear algebra included:
        # three quarters of the time, and nothing that is needed here.
        try:
            return self._load_overload(sig, target_context)
        except Exception as error:  # A damaged file makes pickle and LLVM raise anything.
            self._warn("read", error)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write machine code for a signature, if that can be done."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            self._warn("written", error)

    def has_code(self, target_context: Any) -> bool:
        """Test for code of any signature for this processor."""
        processor = target_context.codegen().magic_tuple()
        return any(key[1] == processor for key in self._files.read_index())

    def files(self) -> set[Path]:
        """List the files of this version of the function, index and machine code."""
        return self._files.files()

    def _warn(self, what: str, error: Exception) -> None:
        if self._cache_path in _SAID:
            return
        _SAID.add(self._cache_path)
        logging.getLogger("poise").warning(
            "compiled code cannot be %s in %s, so that this process compiles it anew (%s: %s); "
            "NUMBA_CACHE_DIR names another folder",
            what,
            self._cache_path,
            type(error).__name__,
            error,
        )


class _Files(IndexDataCacheFile):
    """Files that never mix versions of a source, at whichever moment a process stops."""

    # Numba writes the index before the files, and uses their names again: a reader in between, or
    # after a disk was full, gets the code of another version.

    def __init__(self, folder: str, base: str, stamp: str) -> None:
        super().__init__(folder, base, stamp)
        self._data_name_pattern = f"{base}.{stamp[:12]}.{{number:d}}.nbc"

    def save(self, key: Any, data: Any) -> None:
        """Add code under a key, file before index."""
        names = self.read_index()
        taken = set(names.values())
        name = names.get(key) or next(
            name for number in count(1) if (name := self._data_name(number)) not in taken
        )
        self._save_data(name, data)
        self._save_index({**names, key: name})

    def read_index(self) -> dict[Any, str]:
        """Return file names by key; none where they are of another version or damaged."""
        try:
            return super()._load_index()
        except Exception:  # As above: damaged files are rewritten.
            return {}

    def files(self) -> set[Path]:
        """List the index and what it names."""
        folder = Path(self._cache_path)
        return {folder / name for name in (self._index_name, *self.read_index().values())}

    _load_index = read_index
