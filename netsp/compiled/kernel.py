"""The decorator of compiled functions, and what is kept of them on disk.

Numba keeps a compiled function until its own file changes. That is too long in two cases: a kernel
in another file that it calls (and that is compiled into it) has changed, and a class in its
signature has another name (the kept index then cannot be read: AttributeError). And of two
processes that compile one function for different types at the same time, both may call their file
by the same number: then the one's is found under the other's types, in every run from then on. All
three are mended here, so that no one ever has to delete a cache by hand.
"""

from __future__ import annotations

import glob
import hashlib
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from numba import njit
from numba.core.caching import IndexDataCacheFile

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parent.parent
_IMPORTS = re.compile(r"^from (netsp[\w.]*) import (\([^)]*\)|[^\n]*)", re.M)


def kernel(function: F) -> F:
    """A function that is compiled when first called, and kept on disk.

    Its annotations are for the callers and the type checker; Numba infers types of its own. Other
    threads run meanwhile.
    """
    compiled = njit(cache=True, nogil=True)(function)
    disk = getattr(compiled, "_cache", None)  # none where NUMBA_DISABLE_JIT is set
    if disk is not None:
        kept = disk._cache_file
        disk._cache_file = Kept(
            kept._cache_path,
            kept._index_name.removesuffix(".nbi"),
            (kept._source_stamp, stamps(Path(function.__code__.co_filename))),
        )
    return compiled  # type: ignore[no-any-return]


class Kept(IndexDataCacheFile):  # type: ignore[misc]
    """An index that is as good as none where it names what is no more, of files that are called by
    what they are of."""

    def save(self, key: Any, data: Any) -> None:
        """Keep what has been compiled: first it, then the index, so that no other process finds an
        older one under its name."""
        name = self._data_name(int(hashlib.sha256(self._dump(key)).hexdigest()[:15], 16))
        self._save_data(name, data)
        overloads = self._load_index()
        fresh = not overloads
        overloads[key] = name
        self._save_index(overloads)
        if fresh:
            self._tidy(set(overloads.values()))

    def _tidy(self, named: set[str]) -> None:
        """Remove files of sources that are no more; whoever looks for one compiles anew."""
        of_all = glob.escape(self._index_name.removesuffix(".nbi")) + ".*.nbc"
        for old in Path(self._cache_path).glob(of_all):
            if old.name not in named:
                old.unlink(missing_ok=True)

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except (AttributeError, ImportError):
            return {}


@cache
def stamps(file: Path) -> tuple[tuple[str, int, int], ...]:
    """Name, time of change (ns) and size of each file with kernels that a file imports, directly or
    by way of others; without the file itself."""
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
    """The files with kernels that a file imports."""
    found = set()
    for module, names in _IMPORTS.findall(file.read_text(encoding="utf-8")):
        at = _PACKAGE.parent.joinpath(*module.split("."))
        for one in (at, *(at / name for name in re.findall(r"\w+", names))):
            source = one.with_suffix(".py")
            if source.is_file() and "netsp.compiled.kernel" in source.read_text(encoding="utf-8"):
                found.add(source)
    return frozenset(found)
