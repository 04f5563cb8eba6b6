"""Input that nobody would write on purpose ends in one line, exit code 2, nothing written."""

import gzip
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from netsp import Circle, InputError, Problem, Solution, solve, verify
from netsp.base.errors import brief
from netsp.base.files import csv_cell, read_gzip, write_text
from netsp.command.main import main
from netsp.exchange.maps.site_import import read_site
from netsp.exchange.missions import Projection, export
from netsp.exchange.missions.mission_files import ExportSettings
from netsp.online.execute import ExecutionOptions, Surprises, execute
from netsp.online.execute.events import problem_after
from netsp.view.pictures import style
from netsp.view.pictures.style import literal
from netsp.world.mission.mission import Mission

ROOT = Path(__file__).parent.parent
SMALL = str(ROOT / "problems" / "known" / "triangle.json")
WHARF = ROOT / "problems" / "wharf.json"
NASTY = ["$\\frac{$", "$", "a$b$c", "=1+1", "<script>alert(1)</script>", "-2+3", "@x", "_é"]


def one_line(capsys) -> str:
    err = capsys.readouterr().err
    assert err.startswith("netsp: "), err
    assert err.count("\n") == 1, err
    assert "Traceback" not in err
    assert len(err) < 1000
    return err


def nasty(name: str, second: str | None = None, pile: str | None = None) -> Problem:
    second, pile = second or name + "2", pile or name
    return Problem(
        name=name, units=name[:20], base=(0, 0), tether_length=9,
        goals=[{"name": name, "position": (5, 1)}, {"name": second, "position": (5, -1)}],
        obstacles=[Circle(center=(3, 0), radius=0.5, name=pile)],
    )  # fmt: skip


FORMULAS = [name for name in NASTY if name[0] in "=-@"]
"""Of tables: to a picture they are all alike."""


@pytest.mark.parametrize("names", [*([n] for n in NASTY if n not in FORMULAS), FORMULAS], ids=str)
def test_a_name_is_drawn_as_it_is_in_every_picture(names, tmp_path):
    """Matplotlib takes what is between two dollars for a formula, and most are none."""
    problem = nasty(*names)
    file, tour = tmp_path / "p.json", tmp_path / "s.json"
    file.write_text(problem.to_json())
    code = main(["solve", str(file), "-o", str(tour), "--quiet", "--plot", str(tmp_path / "a.svg"),
                 "--plot-trace", str(tmp_path / "b.svg")])  # fmt: skip
    assert code == 0
    for k, more in enumerate([["--roadmap", "taut"], ["--tethers-to", "0"], [str(tour)]]):
        assert main(["plot", str(file), *more, "-o", str(tmp_path / f"{k}.png")]) == 0
    assert main(["execute", str(file), str(tour), "-o", str(tmp_path / "run"), "--quiet"]) == 0
    page = tmp_path / "page.html"
    assert main(["report", str(tour), "--problem", str(file), "-o", str(page)]) == 0
    assert "<script>alert(1)" not in page.read_text()


def test_dollars_are_literal_and_the_labels_of_ticks_are_not():
    figure = Figure()
    axes = figure.subplots()
    axes.loglog([1, 1e6], [1, 1e6])
    axes.set_title("$\\frac{$ and $")
    literal(figure).canvas.draw()
    assert axes.title.get_text() == "$\\frac{$ and $"
    assert not axes.title.get_parse_math()
    assert axes.xaxis.get_major_ticks()[0].label1.get_parse_math()


@pytest.mark.parametrize(
    "text",
    [
        '{"schema_version": 1, "base": [0, 0], "goals": [[1, 1]], "tether_length": %s}'
        % ("9" * 400),
        '{"schema_version": 1, "base": [1e301, 0], "goals": [[1, 1]], "tether_length": 5}',
        '{"schema_version": 1, "base": [0, 0], "goals": [[1, 1]], "tether_length": 1e999}',
        '{"schema_version": 1, "name": "a\\u0000b", "base": [0, 0], "goals": [[1, 1]], '
        '"tether_length": 5}',
        '{"schema_version": 1, "name": "\\ud800", "base": [0, 0], "goals": [[1, 1]], '
        '"tether_length": 5}',
        '{"schema_version": 1, "name": "%s", "base": [0, 0], "goals": [[1, 1]], '
        '"tether_length": 5}' % ("x" * 5000),
        '{"schema_version": 1, "%s": 1, "base": [0, 0], "goals": [[1, 1]], "tether_length": 5}'
        % ("y" * 5000),
        "[" * 100_000,
    ],
)  # fmt: skip
def test_absurd_numbers_and_names_are_told_in_one_short_line(text, tmp_path, capsys):
    file, out = tmp_path / "p.json", tmp_path / "out.json"
    file.write_text(text)
    out.write_text("precious")
    assert main(["solve", str(file), "-o", str(out)]) == 2
    one_line(capsys)
    assert out.read_text() == "precious"


@pytest.mark.parametrize(
    "command",
    [
        ["solve", "{}"], ["verify", "{}", "{}"], ["plot", "{}", "-o", "x.png"],
        ["simulate", "{}"], ["execute", "{}", "{}"], ["import", "{}"], ["compare", "{}", "-o", "r"],
        ["report", "{}", "-o", "x.html"], ["order", "{}"],
    ],
)  # fmt: skip
def test_pipes_devices_and_folders_are_no_input(command, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pipe = tmp_path / "pipe.jsonl"
    os.mkfifo(pipe)
    for source in (str(pipe), "/dev/zero", str(tmp_path)):
        if command[0] == "report" and source == str(tmp_path):
            continue  # the folder of a run is what it reads
        assert main([word.format(source) for word in command]) == 2
        one_line(capsys)


def test_a_bomb_of_zeros_is_not_unpacked(tmp_path, capsys):
    bomb = tmp_path / "r.jsonl.gz"
    with gzip.open(bomb, "wb", compresslevel=9) as stream:
        for _ in range(300):
            stream.write(b"\0" * 2**20)
    assert bomb.stat().st_size < 2**20
    assert main(["report", str(bomb), "-o", str(tmp_path / "x.html")]) == 2
    assert "unpacks to more than" in one_line(capsys)


def test_gzip_is_read_whole_in_one_member_or_many(tmp_path):
    file = tmp_path / "a.gz"
    file.write_bytes(gzip.compress(b"one ") + gzip.compress(b"two"))
    assert read_gzip(file) == b"one two"
    file.write_bytes(gzip.compress(b"one" * 1000)[:-9])
    with pytest.raises(InputError, match="not a gzip file, or cut short"):
        read_gzip(file)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no full device on this system")
def test_a_full_or_closed_stdout_is_told():
    run = [sys.executable, "-m", "netsp", "solve", SMALL, "--quiet"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(run, stdout=full, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "No space left" in done.stderr
    words = " ".join(map(repr, run)).replace("'", '"')
    done = subprocess.run(["sh", "-c", f"{words} >&-"], stderr=subprocess.PIPE, text=True, cwd=ROOT)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "closed" in done.stderr


def test_an_output_is_no_input_and_a_link_is_followed(tmp_path, capsys):
    problem = tmp_path / "p.json"
    problem.write_text(Path(SMALL).read_text())
    for name in (problem, tmp_path / "link.json"):
        if name != problem:
            name.symlink_to(problem)
        assert main(["solve", str(problem), "-o", str(name)]) == 2
        assert "it is an input" in one_line(capsys)
    target, link = tmp_path / "t.json", tmp_path / "l.json"
    target.write_text("old")
    link.symlink_to(target)
    assert main(["solve", str(problem), "-o", str(link), "--quiet"]) == 0
    assert link.is_symlink()
    assert Solution.load(target).length == 12.0
    write_text(link, "new")
    assert (link.is_symlink(), target.read_text()) == (True, "new")


@pytest.mark.parametrize("seed", ["-1", "1e3", "99999999999999999999999999", "x"])
def test_seeds_of_any_size_or_sign(seed, capsys):
    for command in (["solve", SMALL], ["simulate", str(ROOT / "missions" / "basin.json")],
                    ["world"]):  # fmt: skip
        assert main([*command, "--seed", seed]) == 2
        assert "--seed" in one_line(capsys)


@pytest.mark.parametrize("seed", [0, 2**31, 2**62])
def test_large_seeds_work_everywhere(seed):
    pytest.importorskip("ompl")
    problem = Problem.load(SMALL)
    assert solve(problem, "lns", seed=seed, iteration_limit=5).length == pytest.approx(12.0)
    few = {"samples": 300}
    assert solve(nasty("pile"), roadmap="prm", roadmap_options=few, seed=seed).length


@pytest.mark.parametrize(
    "change",
    [
        {"speed": 1e-9}, {"delta": 1e-9}, {"cell": 1e-9}, {"waypoints": [[1e11, 0, 0]]},
        {"waypoints": [[1e301, 0, 0]]}, {"tether_length": "x" * 999}, {"cell": 0},
    ],
)  # fmt: skip
def test_missions_of_absurd_size_are_refused(change, tmp_path, capsys):
    data = json.loads((ROOT / "missions" / "basin.json").read_text())
    data["scene"] = str(ROOT / "scenes" / "basin.json")
    file = tmp_path / "m.json"
    file.write_text(json.dumps(data | change))
    assert main(["simulate", str(file), "--quiet"]) == 2
    assert next(iter(change)) in one_line(capsys)


@pytest.mark.parametrize(
    "event", [{"push": [1e12, 0, 0]}, {"push": [-1e12, 1e12, 0]},
              {"move": {"obstacle": 0, "by": [9e11, 9e11]}}],
)  # fmt: skip
def test_pushes_and_moves_of_any_length_end(event):
    problem = nasty("pile")
    events = Surprises.model_validate({"schema_version": 1, "events": [{"time": 3, **event}]})
    run = execute(problem, solve(problem), ExecutionOptions(speed=0.5), surprises=events)
    assert run.summary["home"]
    assert run.summary["tether_free"]
    assert run.summary["exceedance_s"] == 0.0


def test_library_calls_with_wrong_types_are_told():
    problem = Problem.load(SMALL)
    solution = solve(problem)
    for call in (
        lambda: solve(None), lambda: solve(problem, warm_start="x"), lambda: solve(problem, 3),
        lambda: verify(None, solution), lambda: verify(problem, None), lambda: solve("a" * 999),
    ):  # fmt: skip
        with pytest.raises(InputError) as caught:
            call()
        assert len(str(caught.value)) < 300
    # a copy may hold a status as text, as files do
    assert verify(problem, solution.model_copy(update={"status": "optimal"}))


def test_messages_cut_what_they_quote():
    long = "z" * 3000
    assert len(brief(f"field: expected a number, got {long!r}; and {long}")) < 300
    assert brief("a 'short' one, and it's fine") == "a 'short' one, and it's fine"
    assert "\n" not in brief("two\nlines")


def test_cells_of_a_table_are_no_formulas():
    assert [csv_cell(t) for t in ("=1+1", "@x", "+a", "-b", "\tq", "pile 3", "-2 3 1", None)] == [
        "'=1+1", "'@x", "'+a", "'-b", "'\tq", "pile 3", "-2 3 1", "",
    ]  # fmt: skip


def test_two_of_one_name_are_numbered_and_told_on_import(tmp_path, capsys):
    point = {"type": "Point", "coordinates": [12.7, 55.5]}
    features = [
        {"type": "Feature", "properties": {"kind": "base", "tether_length": 50}, "geometry": point},
        *({"type": "Feature", "properties": {"kind": "goal", "name": "A1"},
           "geometry": {"type": "Point", "coordinates": [12.7 + 1e-4 * k, 55.5001]}}
          for k in (1, 2)),
    ]  # fmt: skip
    file = tmp_path / "site.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    out = tmp_path / "p.json"
    assert main(["import", str(file), "-o", str(out)]) == 0
    assert [g.name for g in Problem.load(out).goals] == ["A1", "A1 2"]
    assert "'A1' is 'A1 2' (features[2])" in capsys.readouterr().err


def test_damaged_rows_are_told_and_a_page_escapes_every_field(tmp_path, capsys, monkeypatch):
    rows, evil = tmp_path / "r.jsonl", "<img src=x onerror=alert(1)>"
    assert main(["compare", "-o", str(rows), "--goals", "3", "--tethers", "200", "--solvers",
                 "greedy", "--worlds", "1", "--quiet"]) == 0  # fmt: skip
    good = json.loads(rows.read_text())

    def walk(value, path=()):
        items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(
            value, list) else ()  # fmt: skip
        for key, child in items:
            yield (*path, key)
            yield from walk(child, (*path, key))

    others, draw = (None, [], {}, -1, True, 1e308), style.svg
    for k, path in enumerate(walk(good)):
        # most of the time would go into drawing
        monkeypatch.setattr(style, "svg", draw if k % 9 == 1 else lambda figure: "")
        for bad in (evil, others[k // 9 % len(others)]) if k % 9 == 1 else (evil,):
            damaged = json.loads(json.dumps(good))
            at = damaged
            for key in path[:-1]:
                at = at[key]
            at[path[-1]] = bad
            rows.write_text(json.dumps(damaged) + "\n")
            page = tmp_path / "x.html"
            code = main(["report", str(rows), "-o", str(page)])
            assert code in (0, 2), (path, bad)
            if code == 2:
                one_line(capsys)
            else:
                capsys.readouterr()
                assert evil not in page.read_text(), path


def test_missions_read_from_text_keep_to_their_types():
    with pytest.raises(InputError, match="waypoints"):
        Mission.from_json('{"schema_version": 1, "scene": "s", "anchor": [0, 0, 0], '
                          '"start": [0, 0, 0], "waypoints": [], "tether_length": 5}')  # fmt: skip


def kinds(folder: Path) -> dict[str, str]:
    """A file of every kind that netsp reads as JSON."""
    tour = folder / "tour.json"
    tour.write_text(solve(Problem.load(SMALL)).to_json())
    return {
        "problem": SMALL,
        "solution": str(tour),
        "mission": str(ROOT / "missions" / "basin.json"),
        "scene": str(ROOT / "scenes" / "pipes.json"),
        "surprise file": str(ROOT / "examples" / "surprises.json"),
    }


def test_a_file_of_another_kind_is_called_what_it_is(tmp_path, capsys):
    files = kinds(tmp_path)
    wanted = {
        "problem": ["tether", "FILE"],
        "solution": ["verify", SMALL, "FILE"],
        "mission": ["simulate", "FILE"],
        "surprise file": ["execute", SMALL, files["solution"], "--surprise", "FILE"],
    }
    for kind, command in wanted.items():
        for other, file in files.items():
            if other == kind:
                continue
            assert main([file if word == "FILE" else word for word in command]) == 2
            assert f"this is a {other}; expected a {kind}" in one_line(capsys)


@pytest.mark.parametrize(
    "command",
    [
        ["execute", SMALL, "TOUR", "--vehicle", "x"],
        ["execute", SMALL, str(WHARF)],
        ["simulate", str(ROOT / "missions" / "basin.json"), "--planner", "x"],
        ["simulate", SMALL],
    ],
)
def test_a_run_that_cannot_begin_leaves_no_folder(command, tmp_path, capsys):
    tour = kinds(tmp_path)["solution"]
    run = tmp_path / "run"
    assert main([tour if word == "TOUR" else word for word in command] + ["-o", str(run)]) == 2
    one_line(capsys)
    assert not run.exists()
    run.mkdir()
    assert main([tour if word == "TOUR" else word for word in command] + ["-o", str(run)]) == 2
    assert run.exists()


BAD_CALLS = {
    "load of nothing": (lambda t, s: Problem.load(None), "path: expected the name of a file"),
    "load of a number": (lambda t, s: Problem.load(3), "path: expected the name of a file"),
    "text that is none": (lambda t, s: Problem.from_json(5), "problem: expected text, got 5"),
    "execute without a solution": (lambda t, s: execute(t, None), "solution: expected a Solution"),
    "options as a mapping": (
        lambda t, s: execute(t, s, {"speed": 1}), "options: expected a ExecutionOptions",
    ),
    "speed as text": (
        lambda t, s: execute(t, s, ExecutionOptions(speed="x")), "speed: expected a number",
    ),
    "current of two": (
        lambda t, s: execute(t, s, ExecutionOptions(current=(1, 2))), "current: expected three",
    ),
    "gusts that are none": (
        lambda t, s: execute(t, s, ExecutionOptions(gusts=None)), "gusts: expected a number",
    ),
    "negative seed": (
        lambda t, s: execute(t, s, ExecutionOptions(seed=-1)), "seed: expected a whole number",
    ),
    "format as a list": (lambda t, s: export(t, s, "x.csv", ["csv"]), "format: expected plan"),
    "export of nothing": (lambda t, s: export(t, None, "x.csv", "csv"), "solution: expected a Sol"),
    "acceptance as text": (
        lambda t, s: export(t, s, "x.csv", "csv", acceptance="x"), "acceptance: expected a number",
    ),
    "hold as text": (
        lambda t, s: export(t, s, "x.csv", "csv", settings=ExportSettings(goal_hold_s="a")),
        "hold: expected whole",
    ),
    "latitude of nothing": (lambda t, s: Projection(None, 0), "latitude: expected a number"),
    "save to a name too long": (lambda t, s: s.save("x" * 3000), "cannot be written"),
    "save to half a character": (lambda t, s: s.save("\ud800"), "cannot be written"),
    "save to a name with a zero": (lambda t, s: s.save("a\0b"), "cannot be written"),
}  # fmt: skip


@pytest.mark.parametrize("call", BAD_CALLS.values(), ids=BAD_CALLS.keys())
def test_calls_with_wrong_values_are_refused_naming_the_argument(call, tmp_path, monkeypatch):
    run, message = call
    monkeypatch.chdir(tmp_path)
    problem = Problem(base=(0, 0), goals=[(3, 4)], obstacles=[], tether_length=6)
    solution = solve(problem)
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        run(problem, solution)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_solutions_with_names_that_cannot_be_written_or_times_that_are_no_numbers_are_refused():
    problem = Problem(base=(0, 0), goals=[(3, 4)], obstacles=[], tether_length=6)
    text = solve(problem).to_json()
    for bad in (
        text.replace('"solver": "auto"', '"solver": "\\ud800"'),
        re.sub(r'"roadmap_s": [\d.e-]+', '"roadmap_s": NaN', text),
    ):
        assert bad != text
        with pytest.raises(InputError):
            Solution.from_json(bad)


def test_numbers_and_arrays_of_numpy_are_as_good_as_those_of_python(tmp_path):
    problem = Problem(base=(0, 0), goals=[(3, 4)], obstacles=[], tether_length=6)
    solution = solve(problem)
    options = ExecutionOptions(
        speed=np.float64(1), current=np.zeros(3), gusts=np.float32(0), seed=np.int64(3)
    )
    assert execute(problem, solution, options).summary["visited"] == 1
    settings = ExportSettings(
        goal_hold_s=np.int64(5), bend_hold_s=np.int64(1), speed=np.float64(0.5)
    )
    export(problem, solution, tmp_path / "x.csv", "csv", settings=settings)
    assert (tmp_path / "x.csv").exists()


@pytest.mark.parametrize("which", [True, -1, 1.5, None, 2**40, [0]])
def test_obstacles_of_surprises_are_named_or_numbered_and_nothing_else(which, tmp_path, capsys):
    file = tmp_path / "s.json"
    file.write_text(json.dumps({"schema_version": 1, "events": [{"time": 1, "vanish": which}]}))
    with pytest.raises(InputError) as caught:
        Surprises.load(file)
    assert str(caught.value).startswith(f"{file}: events[0]")
    assert "int" not in str(caught.value).replace("integer", "")  # pydantic's inner names


def test_a_surprise_may_call_an_obstacle_as_messages_do():
    problem = Problem(
        base=(0, 0), goals=[(8, 0)], tether_length=30,
        obstacles=[{"center": (4, 0), "radius": 1}, {"center": (4, 9), "radius": 1, "name": "#0"}],
    )  # fmt: skip
    for which, gone in (("#0", 1), (0, 0), (1, 1)):
        event = {"time": 1, "vanish": which}
        (event,) = Surprises(events=[event]).events
        (left,) = problem_after(problem, event).obstacles
        assert left == problem.obstacles[1 - gone]
    nameless = problem.model_copy(update={"obstacles": problem.obstacles[:1]})
    assert (
        problem_after(nameless, Surprises(events=[{"time": 1, "vanish": "#0"}]).events[0]).obstacles
        == ()
    )


def test_an_event_that_cannot_be_is_told_with_its_file(tmp_path, capsys):
    problem, solution = tmp_path / "p.json", tmp_path / "s.json"
    problem.write_text(Problem.load(SMALL).to_json())
    assert main(["solve", str(problem), "-o", str(solution), "--quiet"]) == 0
    file = tmp_path / "surprises.json"
    file.write_text('{"schema_version": 1, "events": [{"time": 1, "vanish": "nobody"}]}')
    capsys.readouterr()
    assert main(["execute", str(problem), str(solution), "--surprise", str(file), "--quiet"]) == 2
    assert f"{file}: events[0]: vanish" in one_line(capsys)


def test_complaints_about_a_site_name_its_features(tmp_path, capsys):
    def at(x, **properties):
        place = {"type": "Point", "coordinates": [12.0 + x, 55.0]}
        return {"type": "Feature", "properties": properties, "geometry": place}

    file = tmp_path / "site.geojson"
    features = [at(0, kind="base", tether_length=100), at(3e-4), at(6e-4, radius_m=1.0), at(3e-4)]
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    assert main(["import", str(file)]) == 2
    said = one_line(capsys)
    assert "features[3]: same position" in said
    assert "as features[1]" in said
    features[2]["properties"]["radius_m"] = -1.0
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features[:3]}))
    assert main(["import", str(file)]) == 2
    assert "features[2].radius" in one_line(capsys)


def test_models_made_by_a_call_are_refused_in_one_line():
    for call, said in (
        (lambda: Problem(base=None, goals=[(1, 2)], tether_length=3), "base: expected [x, y]"),
        (lambda: Problem(base=(0, 0), goals=[(1, 2)], tether_length=3,
                         obstacles=[{"center": (5, 5), "radius": -1}]), "obstacles[0].radius"),
        (lambda: Mission(anchor=(0, 0, 0)), "missing"),
        (lambda: Surprises(events=3), "events"),
    ):  # fmt: skip
        with pytest.raises(InputError) as caught:
            call()
        assert said in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_tour_may_be_longer_than_any_length_of_its_problem():
    far = 9e11
    problem = Problem(base=(0, 0), goals=[(far, 0), (-far, 0)], tether_length=1e12)
    solution = solve(problem)
    assert solution.length == pytest.approx(4 * far)
    assert verify(problem, Solution.from_json(solution.to_json()))


@pytest.mark.parametrize("obstacle", [
    {"center": (3e-8, 0), "radius": 3e-8}, {"center": (5, 3), "radius": 1e-80},
    {"polygon": [(5, 3), (5 + 1e-9, 3), (5, 3 + 1e-9)]},
])  # fmt: skip
def test_obstacles_too_small_to_be_seen_beside_the_others_are_refused(obstacle):
    with pytest.raises(InputError, match=r"obstacles\[1\]: is .* wide, too little"):
        Problem(base=(0, 0), goals=[(10, 0), (3, 7)], tether_length=30,
                obstacles=[{"center": (5, 5), "radius": 1}, obstacle])  # fmt: skip


@pytest.mark.parametrize("turn", range(8))
def test_an_obstacle_just_large_enough_may_touch_the_base(turn):
    r = 6e-7
    centre = (r * math.cos(turn * math.pi / 4), r * math.sin(turn * math.pi / 4))
    obstacles = [{"center": (5, 5), "radius": 1}, {"center": centre, "radius": r}]
    problem = Problem(base=(0, 0), goals=[(10, 0), (3, 7)], tether_length=30, obstacles=obstacles)
    solution = solve(problem, roadmap_options={"classes": "non-looping"})
    assert verify(problem, solution)


def test_lists_are_cut_in_messages():
    assert len(brief(f"state.signature: expected letters, got {list(range(40_000))}")) < 200
    assert brief("word [1, -4]") == "word [1, -4]"


def test_values_of_a_study_are_each_given_once(tmp_path, capsys):
    file = tmp_path / "study.toml"
    for line in ("seeds = [0, 0]", "goals = [4, 4]"):
        text = 'name = "x"\ntether_lengths = [250]\n[[solvers]]\nname = "auto"\n'
        head = line if "goals" in line else f"goals = [4]\n{line}"
        file.write_text(f"{head}\n{text}")
        assert main(["compare", str(file), "-o", str(tmp_path / "r.jsonl"), "--quiet"]) == 2
        assert "appears twice" in one_line(capsys)


def test_a_report_of_a_solution_whose_length_is_not_its_paths_is_refused(tmp_path, capsys):
    problem = Problem.load(SMALL)
    solution = solve(problem)
    (tmp_path / "p.json").write_text(problem.to_json())
    wrong = solution.model_copy(update={"length": 2 * solution.length})
    (tmp_path / "s.json").write_text(wrong.to_json())
    out = tmp_path / "r.html"
    args = ["report", str(tmp_path / "s.json"), "--problem", str(tmp_path / "p.json")]
    assert main([*args, "-o", str(out)]) == 2
    assert "path: is" in one_line(capsys)
    assert not out.exists()


@pytest.mark.parametrize("name", ["鹿児島 桟橋", "x" * 200, "ж" * 200, "🐟"])
def test_names_in_any_script_and_of_any_length_leave_no_remark(name, tmp_path, recwarn):
    problem = nasty("pile").model_copy(update={"name": name})
    goals = tuple(
        g.model_copy(update={"name": f"{k}{name}"[:200]}) for k, g in enumerate(problem.goals)
    )
    problem = problem.model_copy(update={"goals": goals})
    from netsp.view.pictures.problem_picture import save

    save(problem, solve(problem), tmp_path / "p.png")
    assert not [str(w.message) for w in recwarn]


def test_positions_on_the_earth_are_of_the_earth():
    here = Projection(55.0, 12.0)
    for wrong in ([[math.nan, 0.0]], "here", [[1, 2, 3]], [[1e9, 0.0]], None):
        with pytest.raises(InputError, match="xy: expected"):
            here.to_earth(wrong)
    for wrong in ([[91.0, 0.0]], [[0.0, math.inf]], "there"):
        with pytest.raises(InputError, match="latlon: expected"):
            here.to_plane(wrong)


@pytest.mark.parametrize("name", ["杭\u3000一", "می\u200cخواهم", "WEA\u00a05", "👩\u200d👩"])
def test_names_of_every_script_are_welcome(name):
    assert Circle(center=(0, 0), radius=1, name=name).name == name


def test_numbers_too_long_to_write_are_told_in_one_line():
    many = 10**5000
    for call in (
        lambda: Problem(base=(0, 0), goals=[[1, 2]], tether_length=many),
        lambda: Problem(base=(0, 0), goals=[[1, 2]], tether_length=1, bounds=[many] * 4),
        lambda: solve(Problem.load(SMALL), seed=many),
        lambda: solve(Problem.load(SMALL), iteration_limit=many),
        lambda: solve(Problem.load(SMALL), time_limit=10**400),
        lambda: Projection(1, 2).to_plane([[10**400, 1]]),
    ):
        with pytest.raises(InputError) as caught:
            call()
        assert "\n" not in str(caught.value)


def test_points_of_three_coordinates_are_no_positions_on_the_earth():
    here = Projection(55.0, 12.0)
    for wrong in ([[1, 2, 3], [4, 5, 6]], [[1, 2, 3, 4]], [["1", "2"]], [[True, False]]):
        with pytest.raises(InputError, match="expected pairs of numbers"):
            here.to_earth(wrong)
    assert here.to_earth([]).shape == (0, 2)
    assert here.to_earth([0.0, 0.0]) == pytest.approx(np.array([[55.0, 12.0]]))
    with pytest.raises(InputError, match="base: expected"):
        Projection(55.0, 12.0, base=(0, 0, 0))


@pytest.mark.parametrize(
    "event", [{"add_goal": [1e9, 0]}, {"appear": {"center": [4, 1], "radius": 1e-12}}]
)
def test_events_of_absurd_size_are_refused_before_the_run(event):
    problem = nasty("pile")
    surprises = Surprises(events=[{"time": 1, **event}])
    with pytest.raises(InputError, match=r"events\[0\]: (add_goal|appear)"):
        execute(problem, solve(problem), surprises=surprises)


@pytest.mark.parametrize(
    "line", ["goals = [true]", 'goals = ["3"]', "seeds = [true]", "seeds = [1.0]",
             "seeds = [1180591620717411303424]", 'memory_limit = "4"'],
)  # fmt: skip
def test_studies_take_numbers_only(line, tmp_path, capsys):
    file, out = tmp_path / "study.toml", tmp_path / "r.jsonl"
    head = line if "goals" in line else f"goals = [4]\n{line}"
    file.write_text(f'name = "x"\ntether_lengths = [250]\n{head}\n[[solvers]]\nname = "auto"\n')
    assert main(["compare", str(file), "-o", str(out), "--quiet"]) == 2
    assert line.split()[0] in one_line(capsys)
    assert not out.exists()


def test_the_parts_of_a_named_multipolygon_are_numbered(tmp_path):
    def ring(x):
        corners = [[x, 55.001], [x + 1e-4, 55.001], [x + 1e-4, 55.0011], [x, 55.0011]]
        return [[*corners, corners[0]]]

    features = [
        {"type": "Feature", "properties": {"kind": "base", "tether_length": 500},
         "geometry": {"type": "Point", "coordinates": [12.0, 55.0]}},
        {"type": "Feature", "properties": {},
         "geometry": {"type": "Point", "coordinates": [12.001, 55]}},
        {"type": "Feature", "properties": {"name": "quay"},
         "geometry": {"type": "MultiPolygon", "coordinates": [ring(12.0), ring(12.0003)]}},
    ]  # fmt: skip
    (tmp_path / "s.geojson").write_text(
        json.dumps({"type": "FeatureCollection", "features": features})
    )
    assert [o.name for o in read_site(tmp_path / "s.geojson", None).obstacles] == [
        "quay 1",
        "quay 2",
    ]


def test_files_of_another_kind_are_told_what_reads_them(tmp_path, capsys):
    site = Path(__file__).parent.parent / "examples" / "site.geojson"
    assert main(["solve", str(site)]) == 2
    assert "netsp import" in one_line(capsys)
    ring = Path(__file__).parent.parent / "examples" / "7ring28.gtsp"
    assert main(["solve", str(ring)]) == 2
    assert "netsp gtsp" in one_line(capsys)
    path = tmp_path / "path.csv"
    path.write_text("x,y\n0,0\n1,1\n")
    wharf = Path(__file__).parent.parent / "problems" / "wharf.json"
    assert main(["plot", str(wharf), str(path), "-o", str(tmp_path / "x.png")]) == 2
    assert "--measures" in one_line(capsys)


def test_an_obstacle_of_neither_form_is_told_both(tmp_path, capsys):
    file = tmp_path / "p.json"
    data = {"schema_version": 1, "base": [0, 0], "goals": [[3, 0]], "tether_length": 9}
    file.write_text(json.dumps({**data, "obstacles": [{"vertices": [[1, 1], [2, 1], [2, 2]]}]}))
    assert main(["solve", str(file)]) == 2
    told = one_line(capsys)
    assert "obstacles[0]" in told
    assert '"polygon"' in told
    assert '"center"' in told


def test_an_obstacle_that_appears_in_degrees_is_refused(tmp_path, capsys):
    from netsp.online.execute.events import Surprises

    origin = {"latitude": 57.7, "longitude": 11.95}
    problem = Problem(base=(0, 0), goals=[(9, 0)], tether_length=60, origin=origin)
    corners = [[11.9505, 57.7001], [11.9506, 57.7001], [11.9506, 57.7002]]
    events = Surprises.model_validate(
        {"schema_version": 1, "events": [{"time": 1, "appear": {"polygon": corners}}]}
    )
    with pytest.raises(InputError, match="not degrees"):
        events.check(problem)


def test_a_path_through_an_obstacle_is_told_when_it_is_measured(tmp_path, capsys):
    wharf = Path(__file__).parent.parent / "problems" / "wharf.json"
    path = tmp_path / "path.csv"
    path.write_text("x,y\n0,2.5\n9,2.5\n")
    assert main(["verify", str(wharf), str(path), "--measures"]) == 0
    told = capsys.readouterr()
    assert "passes through obstacle A1" in told.err
    assert "word" in told.out
