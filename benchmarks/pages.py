"""Every fenced command and Python snippet of README and docs, run exactly as written.

A page runs in a temporary folder that holds the repository's own files and nothing else, its blocks
from top to bottom, so that one may use what another has left. A snippet whose first line names a
module, as `# my_solver.py`, is saved under that name before it runs. `make` would run this again,
and packages cannot be installed everywhere: of those only what they name is looked up.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import textwrap
import time
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

PAGES = ["README.md", *sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").rglob("*.md")),
         "problems/README.md", "scenes/README.md"]  # fmt: skip

SHIPPED = ("problems", "scenes", "missions", "studies", "examples")
"""Folders that commands may name."""

NOT_RUN = {
    "dask": "a cluster",
    "pip": "packages from a registry",
    "source": "an environment of the reader's own",
}
"""First words of commands that are not run, with what they need."""

_FILE = re.compile(r"# (\w+\.py)\n")
"""First line of a snippet that readers are to save as a module."""

_FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```", re.S | re.M)
"""A block of code, which may be indented as a part of a numbered step."""


@dataclass(frozen=True)
class Block:
    """Something to run. line : of the page. kind : sh or python."""

    page: str
    line: int
    kind: str
    text: str


def blocks(page: str) -> Iterator[Block]:
    """The runnable blocks of a page; those of no language count when they begin with a command."""
    text = (ROOT / page).read_text(encoding="utf-8")
    for found in _FENCE.finditer(text):
        kind, body = found[2], textwrap.dedent(found[3])
        line = text.count("\n", 0, found.start()) + 1
        if kind == "python":
            yield Block(page, line, "python", body)
        elif kind in ("sh", "bash", "console") or (
            not kind and body.lstrip().startswith(("netsp ", "make ", "python "))
        ):
            yield Block(page, line, "sh", body)


def commands(block: Block) -> Iterator[str]:
    """The commands of a block that are to be run, checking those that are not."""
    for raw in block.text.replace("\\\n", " ").splitlines():
        command = raw.split(" #")[0].strip()
        if not command or command.startswith("#"):
            continue
        first = command.split()[0]
        if first == "make":
            targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.M)
            missing = [t for t in command.split()[1:] if t not in targets and "=" not in t]
            if missing:
                raise AssertionError(f"{block.page}:{block.line}: no target {missing[0]}")
        elif first not in NOT_RUN:
            yield command
        elif first == "pip":
            extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
            for extra in re.findall(r"netsp\[(\w+)\]", command):
                if extra not in extras["optional-dependencies"]:
                    raise AssertionError(f"{block.page}:{block.line}: no extra {extra}")


def run_page(page: str, folder: Path) -> list[tuple[str, float]]:
    """Run a page's blocks in a folder; what was run, with its seconds. AssertionError with the
    output for what fails."""
    for name in SHIPPED:
        if not (folder / name).exists():
            shutil.copytree(ROOT / name, folder / name)
    scripts = sysconfig.get_path("scripts")
    env = dict(os.environ) | {"PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}",
                              "MPLBACKEND": "Agg", "PYTHONWARNINGS": "ignore"}  # fmt: skip
    ran = []
    for block in blocks(page):
        if block.kind == "python":
            if module := _FILE.match(block.text):
                (folder / module[1]).write_text(block.text, encoding="utf-8")
            steps = [[sys.executable, "-c", block.text]]
        else:
            steps = [["sh", "-ec", command] for command in commands(block)]
        for step in steps:
            begin = time.perf_counter()
            done = subprocess.run(step, cwd=folder, env=env, capture_output=True, text=True,
                                  stdin=subprocess.DEVNULL, timeout=600)  # fmt: skip
            if done.returncode:
                raise AssertionError(
                    f"{page}:{block.line}: exit {done.returncode}: {step[-1]}\n"
                    f"{done.stdout[-2000:]}{done.stderr[-2000:]}"
                )
            ran.append((step[-1].strip().splitlines()[0], time.perf_counter() - begin))
    return ran
