"""The page about a solution or a run explains itself, in a real browser too."""

import csv
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from netsp import Problem, Solution
from netsp.command.main import main
from netsp.roadmap.paths import TautPaths
from netsp.world.side_names import Passage, back_from, listed, passages

PROBLEMS = Path(__file__).parent.parent / "problems"
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")

PROBE = """
<script>
const faults = [];
window.onerror = (message) => { faults.push(message); };
console.error = (message) => { faults.push(String(message)); };
</script>
"""

ASK = """
<script>
const before = document.querySelector(".map .tether").getAttribute("points");
slider.value = slider.max;
slider.dispatchEvent(new Event("input"));
const after = document.querySelector(".map .tether").getAttribute("points");
slider.value = Math.floor(slider.max / 2);
slider.dispatchEvent(new Event("input"));
const robot = document.querySelector(".map .robot").getBoundingClientRect();
const map = document.querySelector(".map").getBoundingClientRect();
const inside = robot.left >= map.left && robot.right <= map.right;
document.title = [before !== after, inside && map.width > 300, faults.length].join(";");
</script>
"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """A page about a solution, and one about a run with surprises."""
    here = tmp_path_factory.mktemp("pages")
    problem, solution = str(PROBLEMS / "wharf.json"), str(here / "s.json")
    assert main(["solve", problem, "-o", solution, "--quiet"]) == 0
    surprises = here / "e.json"
    surprises.write_text('{"schema_version": 1, "events": [{"time": 20, "push": [1, 1, 0]}]}')
    run, options = str(here / "run"), ["--surprise", str(surprises), "--quiet"]
    assert main(["execute", problem, solution, "-o", run, *options]) == 0
    a, b = here / "tour.html", here / "run.html"
    assert main(["report", solution, "--problem", problem, "-o", str(a)]) == 0
    assert main(["report", run, "-o", str(b)]) == 0
    return a, b


def browse(*args):
    return subprocess.run(
        [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", *args],
        capture_output=True, text=True, timeout=120, check=True,
    ).stdout  # fmt: skip


def test_pages_need_nothing_else_and_say_what_matters(pages):
    for page in pages:
        text = page.read_text()
        assert not re.search(r'(src|href)="(?!data:)', text)
        for part in ("Map", "Goals in their order", "Measures of entanglement", "slider"):
            assert part in text
        assert text.count("<td>") > 40
    tour, run = (p.read_text() for p in pages)
    assert "contractible over triangles" in tour
    assert "push" in run
    assert "recovered free" in run


@pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")
@pytest.mark.parametrize("which", [0, 1])
def test_the_slider_moves_the_tether_in_a_browser_without_errors(pages, which, tmp_path):
    text = pages[which].read_text()
    probed = tmp_path / "probed.html"
    probed.write_text(
        text.replace("<head>", "<head>" + PROBE, 1).replace("</body>", ASK + "</body>", 1)
    )
    shown = browse("--dump-dom", f"file://{probed}")
    assert "<title>true;true;0</title>" in shown


@pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")
def test_pages_print(pages, tmp_path):
    out = tmp_path / "page.pdf"
    browse(f"--print-to-pdf={out}", f"file://{pages[0]}")
    assert out.read_bytes()[:5] == b"%PDF-"
    assert out.stat().st_size > 10_000


@pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")
def test_pages_are_as_wide_as_a_phone_and_print_on_a4(pages, tmp_path):
    probed = tmp_path / "narrow.html"
    ask = (
        "<script>document.title = [document.documentElement.scrollWidth <= window.innerWidth, "
        "window.innerWidth].join(';');</script>"
    )
    for page in pages:
        probed.write_text(page.read_text().replace("</body>", ask + "</body>", 1))
        shown = browse("--window-size=390,800", "--dump-dom", f"file://{probed}")
        assert re.search(r"<title>true;(3|4|5)\d\d</title>", shown)
    out = tmp_path / "page.pdf"
    browse(f"--print-to-pdf={out}", f"file://{pages[0]}")
    sheets = re.findall(rb"/MediaBox\s*\[0 0 (\d+)[\d.]* (\d+)", out.read_bytes())
    assert 1 <= len(sheets) <= 3
    assert all(abs(int(w) - 595) <= 1 and abs(int(h) - 842) <= 1 for w, h in sheets)


def test_the_sheet_says_what_an_operator_asks(pages):
    text = pages[0].read_text()
    problem = Problem.load(PROBLEMS / "wharf.json")
    solution = Solution.load(pages[0].parent / "s.json")
    for n, visit in enumerate(solution.tour, 1):
        assert f'<td>{n}</td><td class="words">{problem.goal_name(visit.goal)}</td>' in text
    for part in ("How the tether runs", "if it snags here", "Margins", "may be off by", "x (m)",
                 "course (° from y)", "depth (m)", "turning (°)"):  # fmt: skip
        assert part in text
    assert '<text x="' in text
    assert ">N</text>" not in text  # north is not known


CROSS = {
    "base": (0, 0), "tether_length": 40, "clearance": 0.5,
    "obstacles": [{"center": (10, 0), "radius": 1, "name": "A"},
                  {"center": (20, 5), "radius": 1, "name": "B"}],
}  # fmt: skip


@pytest.mark.parametrize(
    ("word", "origin", "said"),
    [
        ((1,), {"latitude": 55, "longitude": 12}, "north of A (rests on it)"),
        ((), {"latitude": 55, "longitude": 12}, "south of A (rests on it)"),
        ((1,), {"latitude": 55, "longitude": 12, "heading": 90}, "east of A (rests on it)"),
        ((1,), None, "+y of A (rests on it)"),
        ((1, 2), None, "+x +y of A, −x +y of B (rests on it)"),
    ],
)
def test_a_tether_runs_by_the_names_of_obstacles(word, origin, said):
    problem = Problem(**CROSS, goals=[(20, 0) if len(word) < 2 else (25, 4)], origin=origin)
    tether = TautPaths(problem).tether(0, word)
    run = passages(problem, tether, word)
    if len(word) == 2:
        assert [(p.obstacle, p.rests) for p in run][-1] == (1, True)
        assert [p.obstacle for p in run] == [0, 1]
        return
    assert listed(problem, run) == said


def test_after_a_snag_one_goes_back_to_where_less_is_touched():
    problem = Problem(**CROSS, goals=[(5, 0), (20, 0)])
    on_a, on_b = Passage(0, "north", True), Passage(1, "east", True)
    runs, names = [[], [on_a], [on_a, on_b], [on_b]], ["w", "x", "y", "z"]
    assert back_from(problem, runs, names, 0).startswith("straight home")
    assert back_from(problem, runs, names, 1) == (
        "back the way it came to visit 1 (w), which clears A"
    )
    assert back_from(problem, runs, names, 2) == (
        "back the way it came to visit 2 (x), which clears B"
    )
    assert back_from(problem, [[on_a], [on_b, on_a]], ["x", "y"], 1) == (
        "home along the tether: north of A, east of B"
    )


def test_what_does_not_belong_together_is_refused(pages, tmp_path, capsys):
    solution = str(pages[0].parent / "s.json")
    out = str(tmp_path / "x.html")
    assert main(["report", solution, "-o", out]) == 2
    assert "expected --problem FILE" in capsys.readouterr().err
    other = str(next(p for p in PROBLEMS.glob("*.json") if p.stem != "wharf"))
    assert main(["report", solution, "--problem", other, "-o", out]) == 2
    assert "solves another problem" in capsys.readouterr().err
    assert main(["report", str(tmp_path), "-o", out]) == 2
    assert "is not the folder of a run" in capsys.readouterr().err


def test_the_page_of_a_run_shows_what_was_driven_and_what_was_out(pages):
    run = pages[1].parent / "run"
    text = pages[1].read_text()
    assert "plan at the start" in text
    with open(run / "visits.csv") as stream:
        visits = [row for row in csv.DictReader(stream) if row["goal"] != "-1"]
    for row in visits:
        assert f"<td>{float(row['time']):.1f}</td>" in text
        assert f"<td>{float(row['tether']):.5g}</td>" in text
    assert "plan at the start" not in pages[0].read_text()


def test_a_page_is_html_and_nothing_else(pages, tmp_path, capsys):
    run = pages[1].parent / "run"
    assert main(["report", str(run), "-o", str(tmp_path / "x.pdf")]) == 2
    assert "a page is HTML" in capsys.readouterr().err
    assert not (tmp_path / "x.pdf").exists()
