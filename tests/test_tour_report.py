"""The page about a solution or a run explains itself, in a real browser too."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from netsp.command.main import main

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
const before = document.getElementById("tether").getAttribute("points");
slider.value = slider.max;
slider.dispatchEvent(new Event("input"));
const after = document.getElementById("tether").getAttribute("points");
slider.value = Math.floor(slider.max / 2);
slider.dispatchEvent(new Event("input"));
const robot = document.getElementById("robot").getBoundingClientRect();
const map = document.getElementById("map").getBoundingClientRect();
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


def test_what_does_not_belong_together_is_refused(pages, tmp_path, capsys):
    solution = str(pages[0].parent / "s.json")
    out = str(tmp_path / "x.html")
    assert main(["report", solution, "-o", out]) == 2
    assert "expected that file, too" in capsys.readouterr().err
    other = str(next(p for p in PROBLEMS.glob("*.json") if p.stem != "wharf"))
    assert main(["report", solution, "--problem", other, "-o", out]) == 2
    assert "solves another problem" in capsys.readouterr().err
    assert main(["report", str(tmp_path), "-o", out]) == 2
    assert "cannot be read" in capsys.readouterr().err
