"""Compiled kernels on disk.

Numba recompiles a function only when the function's own file changes. Its cache fails in three
cases, which this module handles, so that no user has to delete a cache:

- A kernel in another file, which was inlined, has changed. So the index of a kernel depends on all
  files with kernels that the kernel's own file imports.
- A class in a signature was renamed. Loading the index then raises AttributeError; here, such an
  index counts as empty.
- Two processes compile one function for different types at the same time. Numba may then give both
  files the same number, and load the code of one for the types of the other. Here, the name of a
  file is a hash of its signature.

Files that cannot be read, as after a full disk or a power failure, count as absent.

This module and `netsp.base.compiled.tiered` use private parts of Numba. The function `is_supported`
of each module checks that these exist.
"""

from __future__ import annotations

import contextlib
import glob
import hashlib
import pickle
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from numba import njit
from numba.core.caching import FunctionCache, IndexDataCacheFile

from netsp.base.compiled.lazy_library import LINKABLE, is_for_kernel, is_linkable

FORMAT_VERSION = 7
"""Format version of the files; kernels in files of another version are compiled again."""

_PACKAGE = Path(__file__).resolve().parents[2]
_IMPORTS = re.compile(r"^from (netsp[\w.]*) import (\([^)]*\)|[^\n]*)", re.M)
_HAS_KERNELS = re.compile(r"^from netsp\.base\.compiled\.kernel import", re.M)


class KernelFile(IndexDataCacheFile):  # type: ignore[misc]
    """Files of one kernel: an index by signature, and a file for each signature, named by it."""

    def save(self, key: Any, data: Any) -> None:
        """Save a compiled kernel: first its file, then the index, so that the index never names a
        file of older code."""
        if is_linkable(data):
            if not is_for_kernel():  # machine code for Python is saved in a moment
                return
            key = (LINKABLE, key)
        name = self._data_name(int(hashlib.sha256(self._dump(key)).hexdigest()[:15], 16))
        self._save_data(name, data)
        overloads = self._load_index()
        fresh = not overloads
        overloads[key] = name
        self._save_index(overloads)
        if fresh:
            self._tidy(set(overloads.values()))

    def contains(self, key: Any) -> bool:
        """Return whether the code that the caller, Python or another kernel, needs is on disk."""
        index, keys = self._load_index(), _keys(key) if is_for_kernel() else [key]
        names = [index[one] for one in keys if one in index]
        return any(Path(self._data_path(name)).is_file() for name in names)

    def contains_any(self) -> bool:
        """Return whether a kernel that Python can call is on disk, for any argument types."""
        return any(key[0] != LINKABLE for key in self._load_index())

    def load(self, key: Any) -> Any:
        """Return a compiled kernel, or None if there is none or it cannot be read."""
        for one in _keys(key):
            with contextlib.suppress(Exception):  # pickle may raise anything on damaged bytes
                data = super().load(one)
                if data is not None:
                    return data
        return None

    def _save_data(self, name: str, data: Any) -> None:
        dumped = self._dump(data)
        super()._save_data(name, (hashlib.sha256(dumped).digest(), dumped))

    def _load_data(self, name: str) -> Any:
        digest, dumped = super()._load_data(name)
        if hashlib.sha256(dumped).digest() != digest:
            raise ValueError(f"{name}: the file is damaged")
        return pickle.loads(dumped)

    @property
    def lock(self) -> Path:
        """File that is locked while the kernel is compiled."""
        return Path(self._index_path).with_suffix(".lock")

    def _tidy(self, named: set[str]) -> None:
        """Remove the files of older sources; a process that still needs one compiles the kernel
        again."""
        pattern = glob.escape(self._index_name.removesuffix(".nbi")) + ".*.nbc"
        for old in Path(self._cache_path).glob(pattern):
            if old.name not in named:
                old.unlink(missing_ok=True)

    def _load_index(self) -> Any:
        with contextlib.suppress(Exception):  # pickle may raise anything on damaged bytes
            index = super()._load_index()
            if isinstance(index, dict) and all(isinstance(name, str) for name in index.values()):
                return index
        return {}


def _keys(key: Any) -> list[Any]:
    """Return the keys of a kernel without and with machine code, the preferred one first."""
    keys = [(LINKABLE, key), key]
    return keys if is_for_kernel() else keys[::-1]


def keep_on_disk(dispatcher: Any, function: Callable[..., Any]) -> None:
    """Make a dispatcher from `cached` save its code in a `KernelFile`, if a folder is writable."""
    kept = getattr(dispatcher._cache, "_cache_file", None)
    if kept is None:
        return
    dispatcher._cache._cache_file = KernelFile(
        kept._cache_path,
        kept._index_name.removesuffix(".nbi"),
        (kept._source_stamp, source_stamps(Path(function.__code__.co_filename)), FORMAT_VERSION),
    )


def is_on_disk(dispatcher: Any, types: tuple[Any, ...]) -> bool:
    """Return whether a kernel is on disk, compiled for Numba's types of the arguments."""
    kept, file = dispatcher._cache, _file_of(dispatcher)
    if file is None:
        return False
    return file.contains(kept._index_key(types, dispatcher.targetctx.codegen()))


def is_any_on_disk(dispatcher: Any) -> bool:
    """Return whether a kernel that Python can call is on disk, for any argument types."""
    file = _file_of(dispatcher)
    return file is not None and file.contains_any()


def lock_file(dispatcher: Any) -> Path | None:
    """Return the file that is locked while a kernel is compiled; None if nothing is saved."""
    file = _file_of(dispatcher)
    return None if file is None else file.lock


def _file_of(dispatcher: Any) -> KernelFile | None:
    file = getattr(dispatcher._cache, "_cache_file", None)
    return file if isinstance(file, KernelFile) else None


def cached(function: Callable[..., Any], has_wrapper: bool = True) -> Any:
    """Return Numba's dispatcher of a function; it saves compiled code if a folder is writable.

    Parameters
    ----------
    has_wrapper : bool
        Whether to compile a wrapper for calls from Python at once. `LazyLibrary` adds it later.
    """
    # nothing calls kernels from C
    options = {"no_cfunc_wrapper": True, "no_cpython_wrapper": not has_wrapper}
    try:
        return njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # neither the package's nor the user's folder is writable
        return njit(nogil=True, **options)(function)


@cache
def is_supported() -> bool:
    """Return whether this release of Numba has the private parts that `keep_on_disk` uses.

    Otherwise Numba's own cache is used. A kernel is then not compiled again when a kernel that it
    calls changes in another file, which only matters to developers of netsp.
    """

    def probe() -> None:
        pass

    methods = {
        "_load_index",
        "_save_index",
        "_load_data",
        "_save_data",
        "_data_name",
        "_data_path",
        "_dump",
        "load",
        "save",
    }
    fields = {"_cache_path", "_index_name", "_index_path", "_source_stamp"}
    try:
        kept = IndexDataCacheFile("", "probe", None)
        cache = cached(probe)._cache
    except (AttributeError, TypeError):
        return False
    return (
        methods | fields <= set(dir(kept))
        and callable(getattr(FunctionCache, "_index_key", None))
        and (
            not isinstance(cache, FunctionCache)  # no folder is writable
            or isinstance(getattr(cache, "_cache_file", None), IndexDataCacheFile)
        )
    )


@cache
def source_stamps(file: Path) -> tuple[tuple[str, int, int], ...]:
    """Return name, modification time (ns) and size (bytes) of the files that a file depends on.

    These are the files with kernels that it imports, directly or not, without the file itself.
    """
    found: set[Path] = set()
    new = {file}
    while new:
        new = {other for one in new for other in _imported(one)} - found - {file}
        found |= new
    return tuple(
        (str(one.relative_to(_PACKAGE)), one.stat().st_mtime_ns, one.stat().st_size)
        for one in sorted(found)
    )


@cache
def _imported(file: Path) -> frozenset[Path]:
    """Return the files with kernels that a file imports."""
    found = set()
    for module, names in _IMPORTS.findall(file.read_text(encoding="utf-8")):
        at = _PACKAGE.parent.joinpath(*module.split("."))
        for one in (at, *(at / name for name in re.findall(r"\w+", names))):
            source = one.with_suffix(".py")
            if source.is_file() and _HAS_KERNELS.search(source.read_text(encoding="utf-8")):
                found.add(source)
    return frozenset(found)
