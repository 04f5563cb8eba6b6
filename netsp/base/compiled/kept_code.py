"""Search for compiled code on disk without loading Numba."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[2]


@cache
def may_be_on_disk() -> bool:
    """Return whether compiled code may be on disk; only Numba can tell for certain.

    The search covers the folders in which Numba keeps its indexes: `NUMBA_CACHE_DIR`, or else the
    folders of the sources and the user's cache folder. It also finds indexes of other packages.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    try:
        if chosen:
            return any(Path(chosen).glob("*/*.nbi"))
        return any(_PACKAGE.glob("**/__pycache__/*.nbi")) or any(
            any(folder.glob("*/*.nbi")) for folder in _user_folders()
        )
    except (OSError, RuntimeError):  # no home folder, or one that cannot be read
        return True


def _user_folders() -> list[Path]:
    """Return Numba's cache folders on Linux, macOS and Windows if the sources are not writable."""
    home = Path.home()
    return [
        Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "numba",
        home / "Library" / "Caches" / "numba",
        Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "numba" / "Cache",
    ]
