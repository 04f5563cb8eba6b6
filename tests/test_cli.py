"""The command line as a user meets it: exit codes, one-line errors, nothing overwritten."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import jsonschema
import pytest

from netsp.command.main import main

ROOT = Path(__file__).parent.parent
PROBLEMS = ROOT / "problems"
SMALL = str(PROBLEMS / "known" / "far-pair.json")


def run(*args, **kwargs):
    return subprocess.run(
        [sys.executable, "-m", "netsp", *map(str, args)],
        capture_output=True, text=True, timeout=120, cwd=ROOT, check=False, **kwargs,
    )  # fmt: skip


def test_solve_writes_a_solution_that_verify_accepts(tmp_path, capsys):
    out, png = tmp_path / "s.json", tmp_path / "s.png"
    assert main(["solve", SMALL, "-o", str(out), "--plot", str(png)]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "proven shortest by this solver" in captured.err
    assert png.read_bytes().startswith(b"\x89PNG")
    assert main(["verify", SMALL, str(out)]) == 0
    text = capsys.readouterr().out
    assert text.endswith("verified; not checked: that no tour is shorter\n")
    assert "FAIL" not in text


@pytest.mark.parametrize("solver", ["auto", "mip"])
def test_without_output_the_solution_goes_to_stdout_and_nothing_else_does(solver):
    done = run("solve", SMALL, "--solver", solver)
    assert done.returncode == 0
    solution = json.loads(done.stdout)
    assert solution["status"] == "optimal"
    assert "tour" in done.stderr
    schema = json.loads(run("schema", "solution").stdout)
    jsonschema.validate(solution, schema)


def test_every_problem_that_comes_along_is_what_the_schema_says(capsys):
    assert main(["schema", "problem"]) == 0
    schema = jsonschema.Draft202012Validator(json.loads(capsys.readouterr().out))
    files = [f for f in PROBLEMS.rglob("*.json") if f.name not in ("optima.json", "records.json")]
    assert files
    for file in files:
        schema.validate(json.loads(file.read_text()))


def test_quiet_says_nothing(tmp_path, capsys):
    assert main(["solve", SMALL, "-o", str(tmp_path / "s.json"), "--quiet"]) == 0
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


BAD_CALLS = {
    "no such file": (["solve", "none.json"], "none.json: cannot be read"),
    "unknown solver": (["solve", SMALL, "--solver", "magic"], "solver: unknown 'magic'; expected"),
    "unknown roadmap": (["solve", SMALL, "--roadmap", "x"], "roadmap: unknown 'x'; expected"),
    "unknown backend": (
        ["solve", SMALL, "--mip-backend", "x"],
        "option 'backend': unknown 'x'; expected",
    ),
    "picture format": (["solve", SMALL, "--plot", "a.xyz"], "a.xyz: cannot draw this format"),
    "no folder": (["solve", SMALL, "-o", "/none/s.json"], "/none/s.json: cannot be written"),
    "a folder": (["solve", SMALL, "-o", "/tmp"], "/tmp: cannot be written: it is a directory"),
    "verify nonsense": (["verify", SMALL, SMALL], "solution: missing"),
}


@pytest.mark.parametrize("case", BAD_CALLS)
def test_bad_calls_give_one_line_and_exit_code_2(case, capsys):
    args, expected = BAD_CALLS[case]
    if case == "verify nonsense":
        expected = f"{SMALL}: "
    assert main(args) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1 or case.startswith("unknown")
    assert expected in captured.err
    assert "Traceback" not in captured.err


@pytest.mark.parametrize("limit", ["0", "-1", "nan", "inf", "soon"])
def test_a_bad_time_limit_is_refused(limit, capsys):
    assert main(["solve", SMALL, "--time-limit", limit]) == 2
    assert "expected a positive number of seconds" in capsys.readouterr().err


def test_a_goal_out_of_reach_exits_with_3(tmp_path, capsys):
    data = json.loads(Path(SMALL).read_text())
    data["tether_length"] = 10.0
    short = tmp_path / "short.json"
    short.write_text(json.dumps(data))
    assert main(["solve", str(short), "-o", str(tmp_path / "s.json")]) == 3
    err = capsys.readouterr().err.splitlines()[-1]
    assert err.startswith("netsp: goal #0 is out of reach: tether_length is 10")
    assert not (tmp_path / "s.json").exists()


def test_a_failed_verification_exits_with_5(tmp_path, capsys):
    out = tmp_path / "s.json"
    main(["solve", SMALL, "-o", str(out), "--quiet"])
    data = json.loads(out.read_text())
    data["tour"][0]["signature"] = [9]
    out.write_text(json.dumps(data))
    assert main(["verify", SMALL, str(out)]) == 5
    assert "FAIL  tether word at every goal" in capsys.readouterr().out


def test_bad_input_overwrites_nothing(tmp_path):
    out = tmp_path / "s.json"
    out.write_text("precious")
    bad = tmp_path / "bad.json"
    bad.write_text("{")
    assert main(["solve", str(bad), "-o", str(out)]) == 2
    assert out.read_text() == "precious"


def test_a_warm_start_of_another_problem_is_refused(tmp_path, capsys):
    out = tmp_path / "s.json"
    main(["solve", SMALL, "-o", str(out), "--quiet"])
    other = str(PROBLEMS / "known" / "square.json")
    assert main(["solve", other, "--warm-start", str(out)]) == 2
    assert "none of its goals is in the problem" in capsys.readouterr().err
    again = str(tmp_path / "again.json")
    assert main(["solve", SMALL, "--warm-start", str(out), "-o", again, "--quiet"]) == 0


def test_plot_draws_problem_and_solution(tmp_path):
    out = tmp_path / "s.json"
    main(["solve", SMALL, "-o", str(out), "--quiet"])
    for k, args in enumerate([[SMALL], [SMALL, str(out)]]):
        svg = tmp_path / f"{k}.svg"
        assert main(["plot", *args, "-o", str(svg)]) == 0
        assert "<svg" in svg.read_text()
    assert main(["plot", str(PROBLEMS / "known" / "square.json"), str(out), "-o", str(svg)]) == 2


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_and_sigterm_leave_a_verified_solution_and_no_process(number, tmp_path):
    """A large problem is interrupted; its tour so far is written and judged."""
    from tests.worlds import random_world

    problem = tmp_path / "p.json"
    problem.write_text(random_world(2, goals=45, tether=400.0).to_json())
    out = tmp_path / "s.json"
    command = [sys.executable, "-m", "netsp", "solve", str(problem), "-o", str(out)]

    def heard() -> None:
        """Have the process hear Ctrl-C, or ignore it as one in the background does, which SIGTERM
        ends all the same."""
        handler = signal.default_int_handler if number == signal.SIGINT else signal.SIG_IGN
        signal.signal(signal.SIGINT, handler)

    with subprocess.Popen(
        [*command, "--mip-backend", "cbc"], stderr=subprocess.PIPE, text=True, cwd=ROOT,
        preexec_fn=heard,
    ) as process:  # fmt: skip
        for line in process.stderr:
            if " root " in line or " core " in line:  # with many classes the core comes first
                break
        time.sleep(0.5)
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        begun = children.read_text().split() if children.exists() else []
        process.send_signal(number)
        process.stderr.read()
        process.wait(timeout=60)
    assert process.returncode == 0
    assert not any(Path(f"/proc/{child}").exists() for child in begun)
    solution = json.loads(out.read_text())
    assert solution["status"] == "feasible"
    assert 0 < solution["gap"] < 1
    assert main(["verify", str(problem), str(out), "--quiet"]) == 0


def test_sigterm_before_any_result_ends_as_ctrl_c_does(monkeypatch, capsys):
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(
        "netsp.command.plot.run", lambda _: signal.raise_signal(signal.SIGTERM) or time.sleep(9.0)
    )
    assert main(["plot", "problems/known/square.json", "-o", "x.png"]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGTERM) is before


LOST_IN = {
    "a finalizer": """
class Dying:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)

def run(args):
    Dying()
    time.sleep(300.0)
    return 0

import netsp.command.plot
netsp.command.plot.run = run
argv = ["plot", "problems/known/square.json", "-o", OUT]
""",
    "a fork": """
import os
os.register_at_fork(before=lambda: signal.raise_signal(signal.SIGINT))
argv = ["solve", PROBLEM, "--solver", "mip", "--mip-backend", "cbc", "-o", OUT, "--quiet"]
""",
}
"""Where Python forgets what is raised, and a command to which that happens."""


@pytest.mark.parametrize("where", LOST_IN)
def test_an_interrupt_that_python_forgets_is_heard(where, tmp_path):
    """Ctrl-C came while CBC was being started, and the proof went on to its end."""
    from tests.worlds import random_world

    problem, out = tmp_path / "p.json", tmp_path / "s.json"
    problem.write_text(random_world(2, goals=12, tether=300.0).to_json())
    code = (
        "import signal, sys, time\n"
        "from netsp.command.main import main\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"PROBLEM, OUT = {str(problem)!r}, {str(out)!r}\n"
        f"{LOST_IN[where]}\n"
        "sys.exit(main(argv))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=60
    )
    assert "Traceback" not in done.stderr
    if where == "a fork":
        assert done.returncode == 0
        assert json.loads(out.read_text())["status"] == "feasible"
    else:
        assert done.returncode == 130, done.stderr


def test_help_imports_nothing_heavy():
    code = (
        "import sys, netsp.command.main as c\n"
        "try: c.main(['--help'])\n"
        "except SystemExit: pass\n"
        "names = {'numpy', 'numba', 'pydantic', 'pulp', 'matplotlib', 'shapely'}\n"
        "heavy = names & set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_reader_that_leaves_early_is_no_error():
    done = subprocess.run(
        f"{sys.executable} -m netsp solve {SMALL} --quiet | head -1",
        shell=True, capture_output=True, text=True, cwd=ROOT, check=False,
    )  # fmt: skip
    assert "Traceback" not in done.stderr
