"""The map in the browser, measured: drags, the cursor, a thousand edits, a server that is killed.

    python benchmarks/app.py [--drags 200] [--keep]

Needs Playwright and Debian's chromium.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import shapely
from table import ROOT, head, heading, row

from netsp import Problem
from netsp.app.state import Document
from netsp.plan.random_worlds import reachable_world

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")


@contextlib.contextmanager
def served(file: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """The address of a page about a problem file."""
    with subprocess.Popen(
        [sys.executable, "-m", "netsp", "app", str(file), "--no-browser"],
        stderr=subprocess.PIPE, text=True, cwd=ROOT,
    ) as server:  # fmt: skip
        lines = []
        for line in server.stderr:
            lines.append(line)
            if "Ctrl-C" in line:
                break
        try:
            yield re.search(r"http\S+", "".join(lines)).group(), server
        finally:
            server.terminate()


@contextlib.contextmanager
def page_at(url: str):
    from playwright.sync_api import sync_playwright

    with sync_playwright() as p:
        browser = p.chromium.launch(
            executable_path=BROWSER, args=["--no-sandbox", "--js-flags=--expose-gc"]
        )
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.goto(url)
        yield page
        browser.close()


SHOWN = (
    "() => { const d = document.getElementById('map').dataset;"
    " return [Number(d.version), d.tour === '' ? -1 : Number(d.tour),"
    " document.getElementById('answer').classList.contains('bad')]; }"
)


MIDDLE = (
    "(k) => { const c = document.querySelectorAll('g.goal circle')[k].getBoundingClientRect();"
    " return [c.x + c.width / 2, c.y + c.height / 2]; }"
)


def wait_for_tour(page, after: int, seconds: float = 60.0) -> float:
    """Seconds until a tour of a version later than this one is on the map."""
    begin = time.perf_counter()
    while time.perf_counter() < begin + seconds:
        version, tour, bad = page.evaluate(SHOWN)
        if version > after and tour == version:
            return time.perf_counter() - begin
        if version > after and bad:
            return np.inf
        time.sleep(0.002)
    return np.inf


def cases() -> list[tuple[str, Problem]]:
    return [
        ("wharf", Problem.load(ROOT / "problems" / "wharf.json")),
        ("random, 20 goals", reachable_world(1, goals=20, obstacles=20, tether_length=300.0)[0]),
        ("random, 60 goals", reachable_world(1, goals=60, obstacles=60, tether_length=250.0)[0]),
    ]


def dragged(problem: Problem, count: int) -> tuple[int, list[float], list[float]]:
    """Drags that got no tour; seconds of those that did, from letting go of a goal to a tour of the
    new version on the map; and from moving the cursor to its tether."""
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "p.json"
        file.write_text(problem.to_json())
        with served(file) as (url, _), page_at(url) as page:
            wait_for_tour(page, -1)
            took, moved = [], []
            for _ in range(count):
                x, y = page.evaluate(MIDDLE, int(rng.integers(len(problem.goals))))
                before = page.evaluate(SHOWN)[0]
                page.mouse.move(x, y)
                page.mouse.down()
                page.mouse.move(x + float(rng.uniform(-9, 9)), y + float(rng.uniform(-9, 9)))
                page.mouse.up()
                took.append(wait_for_tour(page, before, 20.0))
                if not np.isfinite(took[-1]):  # put on an obstacle, or out of reach: back
                    page.keyboard.press("Control+z")
                    wait_for_tour(page, before + 1)
            for _ in range(count):
                before = page.inner_text("#where")
                begin = time.perf_counter()
                page.mouse.move(*(float(v) for v in rng.uniform((50, 150), (1000, 700))))
                while page.inner_text("#where") == before and time.perf_counter() < begin + 5:
                    time.sleep(0.002)
                while (
                    "tether" not in page.inner_text("#where") and time.perf_counter() < begin + 0.3
                ):
                    time.sleep(0.002)
                if "tether" in page.inner_text("#where"):
                    moved.append(time.perf_counter() - begin)
    known = [t for t in took if np.isfinite(t)]
    return count - len(known), known, moved


def drags(count: int) -> None:
    print(f"### {count} drags and {count} moves of the cursor each\n")
    head("problem", "tour p50 ms", "p95 ms", "not answered", "tether at the cursor p50 ms",
         "p95 ms", name="app")  # fmt: skip
    for name, problem in cases():
        unanswered, known, moved = dragged(problem, count)
        tours, tethers = (
            [f"{1e3 * np.percentile(v, q):.0f}" for q in (50, 95)] for v in (known, moved)
        )
        row(name, *tours, unanswered, *tethers)
    print()


PAN = """async () => {
  const svg = document.getElementById("map"), box = svg.getBoundingClientRect();
  svg.setPointerCapture = () => {};
  const send = (kind, x, y) => svg.dispatchEvent(
    new PointerEvent(kind, { clientX: x, clientY: y, pointerId: 1, bubbles: true }));
  const times = [];
  let n = 0, last = 0;
  send("pointerdown", box.x + 3, box.y + 3);
  await new Promise((done) => {
    const frame = (t) => {
      if (last) times.push(t - last);
      last = t;
      send("pointermove", box.x + 3 + 100 * Math.sin(n / 10), box.y + 3 + 80 * Math.cos(n / 13));
      if (++n < 240) requestAnimationFrame(frame); else done();
    };
    requestAnimationFrame(frame);
  });
  send("pointerup", box.x + 3, box.y + 3);
  return times;
}"""
"""Drags the water about for 240 frames; milliseconds between them."""


def crowded(goals: int = 200, obstacles: int = 100) -> str:
    """A problem file of so many things."""
    problem = reachable_world(1, goals=60, obstacles=obstacles, tether_length=400.0)[0]
    rng = np.random.default_rng(0)
    places = np.array([g.position[:2] for g in problem.goals])
    data = json.loads(problem.to_json())
    free = shapely.union_all([shape_of(o) for o in problem.obstacles])
    while len(data["goals"]) < goals:
        place = rng.uniform(places.min(0), places.max(0))
        if free.distance(shapely.Point(place)) > problem.clearance + 0.1:
            data["goals"].append({"position": [*place.tolist(), 0.0]})
    return json.dumps(data)


def shape_of(obstacle) -> shapely.Geometry:
    if hasattr(obstacle, "center"):
        return shapely.Point(obstacle.center).buffer(obstacle.radius)
    return shapely.Polygon(obstacle.polygon)


def panned() -> np.ndarray:
    """Milliseconds between frames while a map of 100 obstacles and 200 goals is dragged about."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "p.json"
        file.write_text(crowded())
        with served(file) as (url, _), page_at(url) as page:
            wait_for_tour(page, -1, 4.0)  # solved on meanwhile
            page.wait_for_timeout(1000)
            return np.array(page.evaluate(PAN))


def frames() -> None:
    print("### 100 obstacles and 200 goals\n")
    times = panned()
    head("obstacles", "goals", "ms between frames p50", "p95", "worst", name="app-frames")
    row(100, 200, f"{np.median(times):.1f}", f"{np.percentile(times, 95):.1f}",
        f"{times.max():.1f}")  # fmt: skip
    print()


def resident(pid: int) -> float:
    """MiB of a process and its children."""
    import psutil

    process = psutil.Process(pid)
    return sum(p.memory_info().rss for p in (process, *process.children(recursive=True))) / 2**20


def memory(count: int) -> None:
    """MiB of server and solver, and of the page's heap, on the way through so many edits."""
    from websockets.sync.client import connect

    print(f"### Memory over {count} edits\n")
    rng = random.Random(1)

    def moved() -> dict:
        """As many goals as before: the solver takes what the problem asks for."""
        place = [rng.uniform(0, 18), rng.uniform(0, 9), -3.0]
        edit = {"edit": {"set": ["goals", rng.randrange(8), "position"], "value": place}}
        return rng.choice([edit, edit, {"undo": True}, {"redo": True}])

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "p.json"
        file.write_text((ROOT / "problems" / "wharf.json").read_text())
        with served(file) as (url, server), page_at(url) as page:
            head("edits", "server and solver MiB", "page's heap MiB", "two tabs differ",
                 name="app-memory")  # fmt: skip
            other = page.context.browser.new_page()
            other.goto(url)
            at, done = urlsplit(url), 0
            with connect(f"ws://{at.netloc}/live?{at.query}", max_size=None) as socket:
                for until in (count // 10, count // 2, count):
                    for k in range(done, until):
                        socket.send(json.dumps({"id": k, **moved()}))
                        while json.loads(socket.recv()).get("id") != k:
                            pass
                    done = until
                    page.wait_for_timeout(3000)
                    page.evaluate("() => window.gc?.()")
                    heap = page.evaluate("() => performance.memory.usedJSHeapSize") / 2**20
                    seen = [
                        p.evaluate("() => document.getElementById('map').dataset.version + "
                                   "document.getElementById('answer').textContent")
                        for p in (page, other)
                    ]  # fmt: skip
                    row(until, f"{resident(server.pid):.0f}", f"{heap:.1f}",
                        "no" if seen[0] == seen[1] else "yes")  # fmt: skip
    print()


def random_edit(rng: random.Random) -> dict:
    """Some of them break the format for a while, or cannot be made."""
    return rng.choice([
        {"edit": {"set": ["goals", rng.randrange(9)], "value": [rng.uniform(0, 18), 0.5]}},
        {"edit": {"add": "goals", "value": [rng.uniform(0, 18), rng.uniform(0, 9)]}},
        {"edit": {"delete": [["goals", rng.randrange(9)]]}},
        {"edit": {"set": ["tether_length"], "value": rng.uniform(-1, 40)}},
        {"undo": True}, {"redo": True},
    ])  # fmt: skip


def obey(document: Document, message: dict) -> None:
    from netsp import InputError

    with contextlib.suppress(InputError):
        if "edit" in message:
            document.apply(message["edit"])
        elif "undo" in message:
            document.undo()
        else:
            document.redo()


def edits(count: int, kills: int) -> int:
    """Random edits over the line, beside the library's own; the server is killed now and then. How
    often its versions were others."""
    from websockets.sync.client import connect

    rng = random.Random(0)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "p.json"
        file.write_text((ROOT / "problems" / "wharf.json").read_text())
        own = Document(None, json.loads(Problem.load(file).to_json()))
        lost = 0
        for _ in range(kills + 1):
            with served(file) as (url, server):
                at = urlsplit(url)
                live = f"ws://{at.netloc}/live?{at.query}"
                with connect(live, max_size=None) as socket:
                    for k in range(count // (kills + 1)):
                        message = random_edit(rng)
                        socket.send(json.dumps({"id": k, **message}))
                        obey(own, message)
                        while json.loads(socket.recv()).get("id") != k:
                            pass
                server.send_signal(signal.SIGKILL)
            lost += Document(file).data != own.data
            # what was done before a crash can be undone at once only
            now, own = own.data, Document(None, json.loads(Problem.load(file).to_json()))
            own.apply({"replace": now})
    return lost


def edited(count: int, kills: int) -> None:
    print(f"### {count} edits\n")
    lost = edits(count, kills)
    head("edits", "server killed", "versions lost or others", name="app-edits")
    row(count, kills, lost)
    print()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--drags", type=int, default=200)
    parser.add_argument("--edits", type=int, default=1000)
    parser.add_argument("--only", choices=("drags", "edits", "frames", "memory"))
    args = parser.parse_args()
    heading("The map in the browser")
    for name, measure in (
        ("drags", lambda: drags(args.drags)), ("edits", lambda: edited(args.edits, 10)),
        ("frames", frames), ("memory", lambda: memory(2 * args.edits)),
    ):  # fmt: skip
        if args.only in (None, name):
            measure()


if __name__ == "__main__":
    main()
