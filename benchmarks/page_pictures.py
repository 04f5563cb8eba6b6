"""Make the pictures of the pages.

    python benchmarks/page_pictures.py [NAME …]   # default: all, into docs/pictures

Each function of `PICTURES` makes one picture and has its name. Pictures of the app need playwright
and a Chromium browser on the path.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent

WINDOW: Any = {"width": 1100, "height": 700}  # of the browser, px

COLOURS = 128  # of a picture's palette: fewer show in the shades of the app, more only cost space

MIN_BYTES = 100_000  # of a picture that gets a palette: smaller ones keep all of their colours


def save_small(picture: Path, target: Path) -> None:
    """Write a picture as a PNG with a palette, which takes about a third of the space."""
    image = Image.open(picture).convert("RGB")
    palette = Image.Quantize.MAXCOVERAGE  # keeps rare colours, as that of the robot
    image.quantize(COLOURS, palette, dither=Image.Dither.NONE).save(target, optimize=True)


def run_netsp(*words: str, folder: Path) -> None:
    """Run a command of netsp in a folder; paths of shipped files start at the repository's root."""
    shipped = ("problems/", "examples/", "scenes/", "missions/")
    command = [str(ROOT / word) if word.startswith(shipped) else word for word in words]
    subprocess.run([sys.executable, "-m", "netsp", *command], cwd=folder, check=True)


@contextmanager
def app_page(problem: str | None = None) -> Iterator[Any]:
    """Open the app in a browser and yield its page (a `playwright.sync_api.Page`).

    Parameters
    ----------
    problem : str, optional
        Problem file to open, from the repository's root; the app gets a copy of it.
    """
    from playwright.sync_api import sync_playwright

    browser_file = shutil.which("chromium") or shutil.which("chromium-browser")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        opened = [shutil.copy(ROOT / problem, folder)] if problem else []
        command = [sys.executable, "-m", "netsp", "app", *opened, "--no-browser"]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=folder) as server:
            try:
                lines = server.stderr or ()
                url = next(found[0] for line in lines if (found := re.search(r"http\S+", line)))
                browser = playwright.chromium.launch(
                    executable_path=browser_file, args=["--no-sandbox"]
                )
                page = browser.new_page(viewport=WINDOW, bypass_csp=True)
                page.goto(url)
                page.wait_for_timeout(500)
                yield page
                browser.close()
            finally:
                server.terminate()


def wait_for_tour(page: Any) -> None:
    """Wait until the app shows a proven tour and its margins."""
    page.wait_for_function("document.querySelector('#answer').textContent.includes('proven')")
    page.wait_for_function("document.querySelector('#panel').textContent.includes('Margins')")


def app(target: Path) -> None:
    """The app with the wharf, its tour and the tether in the middle of it."""
    with app_page("problems/wharf.json") as page:
        wait_for_tour(page)
        page.locator("#along").evaluate(
            "e => { e.value = 400; e.dispatchEvent(new Event('input', { bubbles: true })); }"
        )
        page.mouse.move(400, 300)
        page.wait_for_timeout(1500)
        page.screenshot(path=target)


def app_reach(target: Path) -> None:
    """The wharf with a tether that is too short for two goals."""
    with app_page("problems/wharf.json") as page:
        wait_for_tour(page)
        page.get_by_label("tether length (m)").fill("17")
        page.keyboard.press("Enter")
        page.wait_for_function("document.querySelector('#answer').textContent.includes('needs')")
        page.wait_for_timeout(1500)
        page.screenshot(path=target)


def app_import(target: Path) -> None:
    """The dialogue that asks for what a map lacks: here the base, and with it the tether length."""
    site = json.loads((ROOT / "examples" / "site.geojson").read_text())
    site["features"] = [f for f in site["features"] if f["properties"].get("kind") != "base"]
    with app_page() as page, tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "pier.geojson"
        file.write_text(json.dumps(site))
        page.set_input_files("#file", file)
        page.wait_for_selector("dialog", timeout=5000)
        page.wait_for_timeout(500)
        page.screenshot(path=target)


def app_space(target: Path) -> None:
    """The wharf with its tour in space."""
    with app_page("problems/wharf.json") as page:
        wait_for_tour(page)
        page.locator("#map").focus()
        page.keyboard.press("3")
        page.wait_for_function("document.querySelector('#space').dataset.drawn === 'yes'")
        page.locator("#along").evaluate(
            "e => { e.value = 400; e.dispatchEvent(new Event('input', { bubbles: true })); }"
        )
        page.wait_for_timeout(2000)
        page.screenshot(path=target)


def wharf(target: Path) -> None:
    """The wharf with its tour and the tether at each visit."""
    run_netsp(
        "solve", "problems/wharf.json", "-o", "tour.json", "--plot", str(target),
        folder=target.parent,
    )  # fmt: skip


def proof(target: Path) -> None:
    """Draw the triangles of the proof for the wharf, beneath its shortest tour."""
    import numpy as np
    from matplotlib.figure import Figure

    from netsp import Problem, solve
    from netsp.plan.proof.certify import certify
    from netsp.view.pictures import style
    from netsp.view.pictures.problem_picture import draw_map
    from netsp_check.problem_file import read_problem
    from netsp_check.proof_check import read_proof

    problem = Problem.load(ROOT / "problems/wharf.json")
    solution = solve(problem)
    certificate = certify(problem, solution)
    assert certificate.proof is not None
    fields = read_proof(certificate.proof)
    unit = 2.0 ** -read_problem(problem.to_json()).grid
    points = np.reshape(fields["points"], (-1, 2)) * unit + problem.base[:2]
    triangles = np.reshape(fields["triangles"], (-1, 3))
    figure = Figure(figsize=(8.0, 4.4), layout="constrained")
    ax = figure.subplots()
    draw_map(problem, solution, ax=ax)
    ax.triplot(*points.T, triangles, color=style.CANCELLED, linewidth=0.5, zorder=0.5)
    ax.set(xlim=(-0.6, 18.3), ylim=(-0.6, 9.1))
    title = f"{problem.name}: the triangles of the proof that no tour is shorter than"
    ax.set_title(f"{title} {certificate.bound:.2f} {problem.units}", fontsize=10, loc="left")
    style.save(figure, target)


def import_site(target: Path) -> None:
    """The problem made from the map `examples/site.geojson`."""
    run_netsp(
        "import", "examples/site.geojson", "-o", "site.json", "--plot", str(target),
        folder=target.parent,
    )  # fmt: skip


def import_tank(target: Path) -> None:
    """The problem made from the drawing `examples/tank.dxf`."""
    run_netsp(
        "import", "examples/tank.dxf", "--units", "mm", "--tether", "25", "--clearance", "0.2",
        "-o", "tank.json", "--plot", str(target), folder=target.parent,
    )  # fmt: skip


def import_basin(target: Path) -> None:
    """The problem made from the occupancy image `examples/basin.yaml`."""
    run_netsp(
        "import", "examples/basin.yaml", "--base", "6,8", "--goals", "examples/basin-goals.csv",
        "--tether", "60", "--clearance", "0.3", "-o", "basin.json", "--plot", str(target),
        folder=target.parent,
    )  # fmt: skip


def compare_solvers(target: Path) -> None:
    """Lengths of two solvers' tours in the study `examples/study.toml`."""
    run_netsp("compare", "examples/study.toml", "-o", "rows.jsonl", folder=target.parent)
    run_netsp("report", "rows.jsonl", "-o", "rows.html", "--figures", "png", folder=target.parent)
    (target.parent / "rows-length.png").rename(target)


def tether(target: Path) -> None:
    """The tour's length as a function of the tether's length."""
    run_netsp("tether", "problems/wharf.json", "--plot", str(target), folder=target.parent)


def briefing(target: Path) -> None:
    """The upper part of the briefing sheet of the wharf's tour."""
    from playwright.sync_api import sync_playwright

    folder = target.parent
    run_netsp("solve", "problems/wharf.json", "--margin", "0.3", "-o", "tour.json", folder=folder)
    run_netsp(
        "report", "tour.json", "--problem", "problems/wharf.json", "-o", "tour.html",
        folder=folder,
    )  # fmt: skip
    browser_file = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_file, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 900, "height": 1250})
        page.goto((folder / "tour.html").as_uri())
        page.wait_for_timeout(500)
        page.screenshot(path=target)
        browser.close()


def site(target: Path) -> None:
    """The site of the page on structures in 3D, which the page's block of Python makes."""
    text = (ROOT / "docs" / "guide" / "structures-in-3d.md").read_text(encoding="utf-8")
    block = re.findall(r"^```python\n(.*?)^```", text, re.S | re.M)[0]
    subprocess.run([sys.executable, "-c", block], cwd=target.parent, check=True)
    run_netsp("plot", "site.json", "-o", str(target), folder=target.parent)


def flown(target: Path) -> None:
    """The flight of the page on structures in 3D."""
    folder = target.parent
    site(target)
    run_netsp(
        "cover", "site.json", "--anchor=-3,-3,-1", "--inspect", "mesh", "--patch", "0.5",
        "--camera", "3", "--share", "0.9", "-o", "survey.json", folder=folder,
    )  # fmt: skip
    run_netsp("solve", "survey.json", "--time-limit", "20", "-o", "planned.json", folder=folder)
    run_netsp("execute", "planned.json", "-o", "flown", folder=folder)
    shutil.copy(folder / "flown" / "run.png", target)


@contextmanager
def vehicle_page(**options: Any) -> Iterator[tuple[Any, Any]]:
    """Open the page of a guard in a browser, and yield its server (a `guard_page.Page`) and itself.

    Options are those of the server, which shows the wharf.
    """
    from playwright.sync_api import sync_playwright

    from netsp import Problem
    from netsp.online.guard.guard_page import Page

    browser_file = shutil.which("chromium") or shutil.which("chromium-browser")
    problem = Problem.load(ROOT / "problems" / "wharf.json")
    with Page(problem, 0, **options) as served, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_file, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1080, "height": 860})
        page.goto(served.address)
        page.wait_for_timeout(1000)
        yield served, page
        page.wait_for_timeout(1000)
        browser.close()


def guard(target: Path) -> None:
    """The page of a guard at the moment when the recorded vehicle closes a loop."""
    from netsp import Problem
    from netsp.online.guard.replay import read_fixes
    from netsp.online.guard.stream import replay_fixes
    from netsp.online.guard.tether_guard import Guard, GuardOptions
    from netsp.online.link.geo_frame import Frame

    problem = Problem.load(ROOT / "problems" / "wharf.json")
    watching = Guard(problem, GuardOptions(noise=0.05, drift=0.1))
    fixes = list(read_fixes(ROOT / "examples" / "wharf-loop.csv.gz", Frame(problem)))
    with vehicle_page() as (served, page):
        for report in replay_fixes(watching, fixes):
            served.send(report.as_row())
            page.wait_for_timeout(10)
            if any(alarm.kind == "loop" and alarm.level == 4 for alarm in report.alarms):
                break
        page.wait_for_timeout(1000)
        page.screenshot(path=target)


def fly(target: Path) -> None:
    """The page of a flight past the middle of the tour of the wharf."""
    from netsp import Problem, solve
    from netsp.command.fly import _guard_callback
    from netsp.online.execute.execution_log import ExecutionOptions
    from netsp.online.execute.tour_execution import execute

    problem = Problem.load(ROOT / "problems" / "wharf.json")
    flown = execute(problem, solve(problem), ExecutionOptions(speed=0.5))
    with vehicle_page(accepts_events=True) as (served, page):
        show = _guard_callback(problem, served, 0.5)
        for row in flown.rows[: int(0.55 * len(flown.rows))]:
            show(row)
            page.wait_for_timeout(5)
        page.wait_for_timeout(1000)
        page.screenshot(path=target)


def rehearse(target: Path) -> None:
    """A simulated run with an obstacle, a cancelled goal and a push."""
    folder = target.parent
    run_netsp("solve", "problems/wharf.json", "-o", "tour.json", folder=folder)
    run_netsp(
        "execute", "problems/wharf.json", "tour.json", "--surprise", "examples/surprises.json",
        "-o", "run", folder=folder,
    )  # fmt: skip
    shutil.copy(folder / "run" / "run.png", target)


PICTURES: tuple[Callable[[Path], None], ...] = (
    app,
    app_reach,
    app_import,
    app_space,
    wharf,
    proof,
    import_site,
    import_tank,
    import_basin,
    compare_solvers,
    tether,
    briefing,
    site,
    flown,
    guard,
    fly,
    rehearse,
)


def main() -> None:
    """Make the pictures that are named, or all."""
    made = {function.__name__.replace("_", "-"): function for function in PICTURES}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(made))
    parser.add_argument("--folder", type=Path, default=ROOT / "docs" / "pictures")
    args = parser.parse_args()
    for name in args.names or made:
        with tempfile.TemporaryDirectory() as folder:
            raw = Path(folder) / f"{name}.png"
            made[name](raw)
            if raw.stat().st_size < MIN_BYTES:
                shutil.copy(raw, args.folder / f"{name}.png")
            else:
                save_small(raw, args.folder / f"{name}.png")
        print(f"{name}.png: {(args.folder / f'{name}.png').stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
