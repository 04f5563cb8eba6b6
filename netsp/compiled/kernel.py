"""The decorator of compiled functions, and what is kept of them on disk.

Numba keeps a compiled function until its own file changes. That is too long in two cases: a kernel
in another file that it calls (and that is compiled into it) has changed, and a class in its
signature has another name (the kept index then cannot be read: AttributeError). Both are mended
here, so that no one ever has to delete a cache by hand.
"""

from __future__ import annotations

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
        disk._cache_file = _Kept(
            kept._cache_path,
            kept._index_name.removesuffix(".nbi"),
            (kept._source_stamp, stamps(Path(function.__code__.co_filename))),
        )
    return compiled  # type: ignore[no-any-return]


class _Kept(IndexDataCacheFile):  # type: ignore[misc]
    """An index that is as good as none where it names what is no more."""

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
