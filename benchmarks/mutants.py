"""Mutation tests: break the code in one place at a time, and list the faults that no test notices.

    python benchmarks/mutants.py                  # all of `benchmarks/mutants.toml`, minutes
    python benchmarks/mutants.py --only guard     # those whose name contains a word
    python benchmarks/mutants.py --every 5        # every fifth, for a quick look

A mutant replaces one piece of text in one file by another and runs the tests named with it. The
file on disk stays as it is: the process that runs the tests imports the mutated text in its place.
A mutant is noticed if a test fails. One whose tests fail without it, or whose text is not found
exactly once, is an error of the list.
"""

from __future__ import annotations

import argparse
import importlib.abc
import importlib.machinery
import io
import os
import signal
import sys
import time
import tomllib
import traceback
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIST = Path(__file__).with_suffix(".toml")

SURVIVED, NOTICED, STALE = 0, 1, 2


@dataclass(frozen=True)
class Mutant:
    """Fault put into one file.

    Parameters
    ----------
    name : str
        Package and what is wrong, such as ``clock: a part takes its share of the whole limit``.
    file : str
        The file that is changed, relative to the root of the project.
    old : str
        The text that is replaced; it occurs exactly once in the file.
    new : str
        The text in its place.
    tests : tuple of str
        Arguments of pytest that select the related tests.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    @property
    def text(self) -> str:
        """Text of the mutated file; ValueError unless the old text occurs exactly once."""
        source = (ROOT / self.file).read_text(encoding="utf-8")
        if source.count(self.old) != 1:
            raise ValueError(
                f"{self.name}: {self.file} has {source.count(self.old)} × {self.old!r}"
            )
        return source.replace(self.old, self.new)


def mutants(only: str = "", every: int = 1) -> list[Mutant]:
    """Return the mutants of the list whose name contains a text, every n-th of them."""
    rows = tomllib.loads(LIST.read_text(encoding="utf-8"))["mutant"]
    found = [Mutant(**{**row, "tests": tuple(row["tests"])}) for row in rows]
    return [m for m in found if only in m.name][::every]


class _Replaced(importlib.abc.MetaPathFinder):
    """Importer of the mutated text of one file."""

    def __init__(self, mutant: Mutant) -> None:
        self.file, self.text = ROOT / mutant.file, mutant.text

    def find_spec(self, name: str, path: object, target: object = None) -> object:
        """Return the spec of a module, as `importlib.abc.MetaPathFinder.find_spec` does."""
        if not name.startswith("netsp"):
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)  # type: ignore[arg-type]
        if spec is None or spec.origin != str(self.file):
            return None
        text = self.text.encode()

        class Loader(importlib.machinery.SourceFileLoader):
            def get_code(self, fullname: str) -> object:
                return compile(text, self.path, "exec", dont_inherit=True)

        spec.loader = Loader(name, str(self.file))
        return spec


def outcome(mutant: Mutant | None, tests: tuple[str, ...], seconds: int) -> tuple[int, str]:
    """Return the result of tests on a mutant, or on the unchanged code, in a separate process.

    Parameters
    ----------
    mutant : Mutant or None
        None for the code as it is.
    tests : tuple of str
        Arguments of pytest.
    seconds : int
        CPU time after which a mutant counts as noticed: its tests do not end.

    Returns
    -------
    code : int
        `SURVIVED`, `NOTICED` or `STALE`.
    said : str
        The end of what pytest printed.
    """
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        out = io.StringIO()
        code = STALE
        try:
            os.setpgid(0, 0)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.setitimer(signal.ITIMER_PROF, seconds)
            signal.signal(signal.SIGPROF, lambda *_: os._exit(NOTICED))
            if mutant is not None:
                sys.meta_path.insert(0, _Replaced(mutant))
                if "@kernel" in mutant.text:  # compiled code is kept by the file's date
                    os.environ["NUMBA_DISABLE_JIT"] = "1"
            import pytest

            with redirect_stdout(out), redirect_stderr(out):
                code = {0: SURVIVED, 1: NOTICED}.get(
                    int(pytest.main(["-q", "-x", "-p", "no:cacheprovider", *tests])), STALE
                )
            if code == STALE and mutant is not None and "Error" in out.getvalue():
                code = NOTICED  # the mutated module cannot even be imported
        except BaseException:
            out.write(traceback.format_exc())
        finally:
            os.write(write, out.getvalue()[-2000:].encode()[-4000:])
            os._exit(code)
    os.close(write)
    with os.fdopen(read, "rb") as stream:
        said = stream.read().decode(errors="replace")
    _, status = os.waitpid(child, 0)
    return (os.waitstatus_to_exitcode(status) if os.WIFEXITED(status) else NOTICED), said


def _import_libraries() -> None:
    """Import the libraries that every child needs, once for all children."""
    import numba  # noqa: F401
    import pydantic  # noqa: F401
    import scipy.sparse.csgraph
    import scipy.spatial  # noqa: F401
    import shapely  # noqa: F401


def examined(chosen: list[Mutant], seconds: int = 120) -> Iterator[tuple[Mutant, int, str, float]]:
    """Yield each mutant with its outcome, the output of its tests, and seconds. The tests run on
    the unchanged code first."""
    _import_libraries()
    files = dict.fromkeys(name for m in chosen for name in m.tests if name.endswith(".py"))
    code, said = outcome(None, tuple(files), 10 * seconds)
    if code != SURVIVED:
        raise SystemExit(f"{', '.join(files)}: fail without any mutant:\n{said}")
    for mutant in chosen:
        begin = time.monotonic()
        yield mutant, *outcome(mutant, mutant.tests, seconds), time.monotonic() - begin


def main() -> None:
    """Print a line for each mutant, and the number of mutants noticed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--only", default="", metavar="TEXT", help="those whose name contains it")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="every N-th of them")
    parser.add_argument("--verbose", action="store_true", help="what the tests of survivors print")
    args = parser.parse_args()
    os.chdir(ROOT)
    chosen = mutants(args.only, args.every)
    noticed = 0
    for mutant, code, said, seconds in examined(chosen):
        told = {SURVIVED: "SURVIVED", NOTICED: "noticed", STALE: "STALE"}[code]
        noticed += code == NOTICED
        print(f"{told:<9} {seconds:6.1f} s  {mutant.name}", flush=True)
        if args.verbose and code != NOTICED:
            print(said)
    print(f"\n{noticed} of {len(chosen)} noticed")
    raise SystemExit(noticed < len(chosen))


if __name__ == "__main__":
    main()
