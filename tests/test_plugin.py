"""Other people's solvers, roadmaps, tether models, planners, vehicles and readers of maps: by entry
points, and as plain callables."""

import dataclasses
import json
import math
import os
import subprocess
import sys
import typing
from pathlib import Path

import numpy as np
import pytest
import shapely

from netsp import (
    Circle,
    InputError,
    Problem,
    Solution,
    Status,
    TravelGraph,
    solve,
    solve_graph,
    travel_graph,
    verify,
)
from netsp.base.errors import PluginError
from netsp.base.number_ranges import check_not_negative
from netsp.base.registry import Registry
from netsp.command.main import main
from netsp.exchange.maps.feature import Feature, Map
from netsp.exchange.maps.read_map import MAP_READERS
from netsp.exchange.maps.site_import import read_site
from netsp.gtsp.params import read_params
from netsp.gtsp.travel.result import Result
from netsp.study.compare.rows import read_rows
from netsp.study.compare.study import Study
from netsp.study.compare.study_run import compare
from netsp.world import GeodesicTether, Scene
from netsp.world.mission.mission import Mission
from netsp.world.planner import Planner
from netsp.world.simulator.mission_run import simulate

ROOT = Path(__file__).resolve().parent.parent
WHARF = ROOT / "problems" / "wharf.json"
POST = {"capsule": {"a": (0, 0, -3), "b": (0, 0, 3), "radius": 0.5}}


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The example package as pip would install it: its modules, and its entry points beside them.

    pip itself is not asked: it would need an index for the build's requirements."""
    import tomllib

    place = tmp_path_factory.mktemp("site")
    (place / "netsp_plugin").symlink_to(ROOT / "examples" / "plugin" / "netsp_plugin")
    project = tomllib.loads((ROOT / "examples" / "plugin" / "pyproject.toml").read_text())[
        "project"
    ]
    info = place / f"netsp_plugin-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    groups = [
        f"[{group}]\n" + "".join(f"{name} = {where}\n" for name, where in names.items())
        for group, names in project["entry-points"].items()
    ]
    (info / "entry_points.txt").write_text("\n".join(groups))
    return {**os.environ, "PYTHONPATH": f"{place}{os.pathsep}{ROOT}"}


def netsp(env, *args, cwd):
    return subprocess.run(
        [sys.executable, "-m", "netsp", *map(str, args)],
        env=env, cwd=cwd, capture_output=True, text=True, timeout=300,
    )  # fmt: skip


def test_a_solver_of_another_package_works_on_the_command_line(installed, tmp_path):
    done = netsp(installed, "solve", WHARF, "--solver", "sweep", "-o", "s.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "s.json").read_text())
    assert (found["solver"], found["status"]) == ("sweep", "feasible")
    assert netsp(installed, "verify", WHARF, "s.json", cwd=tmp_path).returncode == 0
    option = ("--option", "shuffle=1", "--seed", "3", "--quiet")
    again = netsp(installed, "solve", WHARF, "--solver", "sweep", *option, cwd=tmp_path)
    assert json.loads(again.stdout)["tour"] != found["tour"]


def test_a_solver_of_another_package_works_in_a_study(installed, tmp_path):
    (tmp_path / "study.toml").write_text(
        'name = "mine"\ngoals = [4]\ntether_lengths = [250]\n[worlds]\ncount = 2\n'
        '[[solvers]]\nname = "sweep"\n[[solvers]]\nname = "auto"\n'
    )
    done = netsp(installed, "compare", "study.toml", "-o", "r.jsonl", "--quiet", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in (tmp_path / "r.jsonl").read_text().splitlines()]
    assert sorted(r["solver"]["name"] for r in rows) == ["auto", "auto", "sweep", "sweep"]
    assert {r["status"] for r in rows} == {"optimal", "feasible"}


def test_a_tether_model_and_a_planner_of_another_package_fly(installed, tmp_path):
    data = json.loads((ROOT / "missions" / "basin.json").read_text())
    data |= {"scene": str(ROOT / "scenes" / "basin.json"), "waypoints": data["waypoints"][::12]}
    basin = tmp_path / "basin.json"
    basin.write_text(json.dumps(data))
    args = ("--planner", "cautious", "--tether-model", "straight", "-o", "run", "--quiet")
    done = netsp(installed, "simulate", basin, *args, cwd=tmp_path)
    assert done.returncode == 4, done.stderr  # some waypoints are left out
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["planner"] == "cautious"
    assert 0 < summary["visited"] < summary["waypoints"]
    assert "cautious" in summary["left_out"][0]["reason"]


def test_a_plain_function_solves(tmp_path):
    problem = Problem.load(WHARF)

    def first_classes(graph):
        return [0, *(int(graph.members(c)[0]) for c in range(1, graph.goal_count + 1))]

    solution = solve(problem, solver=first_classes)
    assert solution.solver == "first_classes"
    assert verify(problem, solution)
    assert solution.length >= solve(problem).length


def test_a_function_may_claim_a_bound_but_not_more_than_its_tour():
    graph = TravelGraph.from_costs([[0, 1, 5], [1, 0, 2], [5, 2, 0]], clusters=[0, 1, 2])

    def boaster(graph, limits, rng):
        assert limits.rng is rng
        return Result((0, 1, 2), 1.0, 99.0, Status.OPTIMAL, ())

    with pytest.raises(InputError, match="99 is more than its own tour's length, 8"):
        solve_graph(graph, boaster)
    modest = solve_graph(graph, lambda g: Result((0, 1, 2), 1.0, 7.0, Status.OPTIMAL, ()))
    assert (modest.length, modest.lower_bound) == (8.0, 7.0)


@pytest.mark.parametrize(
    ("tour", "why"),
    [([0, 1, 2, 0], "vertex 0 is repeated at its end"), ([0, 1], "no vertex of cluster 2"),
     ([1, 2, 0], "does not begin at vertex 0"), ([0, 1, 1, 2], "cluster 1 is visited twice"),
     ([0, 1, 7], "7 is not a vertex"), ([0, 1.5, 2], "not a sequence of whole numbers")],
)  # fmt: skip
def test_what_is_wrong_with_a_tour_is_said(tour, why):
    graph = TravelGraph.from_costs([[0, 1, 5], [1, 0, 2], [5, 2, 0]], clusters=[0, 1, 2])
    with pytest.raises(InputError, match=why):
        solve_graph(graph, lambda g: tour)


def test_a_function_is_named_by_its_module_wherever_a_solver_is(tmp_path, monkeypatch):
    """From the folder one is in, without a package."""
    (tmp_path / "mine_here.py").write_text(
        "def first(graph):\n"
        "    return [0, *(int(graph.members(c)[0]) for c in range(1, graph.goal_count + 1))]\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p])
    out = tmp_path / "s.json"
    assert (
        main(["solve", str(WHARF), "--solver", "mine_here:first", "-o", str(out), "--quiet"]) == 0
    )
    assert Solution.load(out).solver == "mine_here:first"
    solvers = [{"name": "mine_here:first"}, {"name": "greedy"}]
    study = {"name": "own", "goals": [3], "tether_lengths": [200], "time_limit": 5,
             "worlds": {"count": 1}, "solvers": solvers}  # fmt: skip
    compare(Study.checked(study, "test"), tmp_path / "rows.jsonl")
    rows = read_rows(tmp_path / "rows.jsonl")
    assert {r["status"] for r in rows} == {"feasible"}
    for name in ("mine_here:second", "no_such_module:f"):
        assert main(["solve", str(WHARF), "--solver", name, "-o", str(out)]) == 2


@pytest.mark.parametrize("wrong", [[0], [1, 2], "abc", 7, [0, 1, 1], [0, 99, 2]])
def test_what_is_no_tour_is_refused_in_one_line(wrong):
    graph = TravelGraph.from_costs([[0, 1, 5], [1, 0, 2], [5, 2, 0]], clusters=[0, 1, 2])
    with pytest.raises(InputError, match="expected vertices from 0 on"):
        solve_graph(graph, lambda graph: wrong)


def test_a_solver_without_options_refuses_them():
    graph = TravelGraph.from_costs([[0, 1, 5], [1, 0, 2], [5, 2, 0]], clusters=[0, 1, 2])
    with pytest.raises(InputError, match="unknown option 'depth'; it takes none"):
        solve_graph(graph, lambda graph: [0, 1, 2], params={"depth": 3})


def test_options_in_a_dataclass_are_checked_before_the_work(installed, tmp_path):
    for option, said in (("shufle=1", "expected one of shuffle"), ("shuffle=x", "a whole number")):
        args = ("solve", WHARF, "--quiet", "--solver", "sweep", "--option", option, "-o", "s.json")
        done = netsp(installed, *args, cwd=tmp_path)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert said in done.stderr
        assert not (tmp_path / "s.json").exists()


def test_no_claim_about_a_tour_that_was_not_returned_is_passed_on():
    from netsp import Status

    claim = Result(None, None, 1e9, Status.NO_SOLUTION_FOUND)
    problem = Problem.load(WHARF)
    found = solve(problem, solver=lambda graph: claim)
    assert (found.status, found.lower_bound) == (Status.NO_SOLUTION_FOUND, None)
    claim = Result(None, None, None, Status.INFEASIBLE)
    with pytest.raises(InputError, match="infeasible, but it has a tour"):
        solve(problem, solver=lambda graph: claim)


def test_a_function_without_arguments_is_refused_in_one_line():
    with pytest.raises(InputError, match="takes no argument"):
        solve(Problem.load(WHARF), solver=lambda: [0])


BROKEN = """
import sys
def fails(graph): raise ZeroDivisionError("division by zero")
def leaves(graph): sys.exit(7)
class Plain:
    def __init__(self, problem): self.problem = problem
    def to_travel_graph(self):
        from netsp import travel_graph
        return travel_graph(self.problem)
"""


def test_what_other_packages_raise_is_told_in_one_line(tmp_path):
    (tmp_path / "broken.py").write_text(BROKEN)
    (tmp_path / "unloadable.py").write_text("1 / 0\n")
    info = tmp_path / "broken-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1\n")
    (info / "entry_points.txt").write_text(
        "[netsp.solvers]\nfails = broken:fails\nleaves = broken:leaves\n"
        "unloadable = unloadable:solve\n[netsp.roadmaps]\nplain = broken:Plain\n"
    )
    env = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    for name, said in (("fails", "ZeroDivisionError"), ("leaves", "SystemExit: 7"),
                       ("unloadable", "cannot be loaded: ZeroDivisionError")):  # fmt: skip
        done = netsp(env, "solve", WHARF, "--solver", name, "--quiet", cwd=tmp_path)
        assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
        assert said in done.stderr
    plain = netsp(env, "solve", WHARF, "--roadmap", "plain", "--time-limit", "20", cwd=tmp_path)
    assert plain.returncode == 0, plain.stderr


def post_scene():
    return Scene.model_validate({"schema_version": 1, "name": "post", "solids": [POST]})


def post_mission():
    return Mission(
        scene="-", anchor=(-2, 0, 0), start=(-2, 0.5, 0), tether_length=9.0,
        waypoints=[(-2, 1, 0), (-2, 2, 0)], speed=0.5,
    )  # fmt: skip


def test_a_tether_model_and_a_planner_may_be_classes_of_ones_own():
    seen = []

    class Mine(GeodesicTether):
        name = "mine"

        def update(self, tether, robot, *more):
            seen.append(np.asarray(robot))
            return super().update(tether, robot, *more)

    class Straight(Planner):
        name = "straight on"

    run = simulate(post_mission(), Straight, tether=Mine, scene=post_scene())
    assert run.planner == "straight on"
    assert run.summary["visited"] == 2
    assert len(seen) > 10


def test_an_error_of_a_planner_of_ones_own_is_not_put_down_to_netsp():
    class Broken(Planner):
        name = "broken"

        def plan(self, robot, tether):
            raise ZeroDivisionError("mine")

    scene = Scene.model_validate({"schema_version": 1, "name": "post", "solids": [POST]})
    mission = Mission(
        scene="-", anchor=(-2, 0, 0), start=(-2, 0.5, 0), tether_length=9.0,
        waypoints=[(-2, 1, 0)], speed=0.5,
    )  # fmt: skip
    run = simulate(mission, Broken, scene=scene)
    (left,) = run.summary["left_out"]
    assert left["reason"] == "a defect of planner 'broken' ended planning (ZeroDivisionError: mine)"


def nearest_classes(problem, *, count: int = 2, seed: int = -1):
    """Return the travel graph of the classes with the shortest tethers."""
    graph = travel_graph(problem)
    kept = [sorted(graph.members(c), key=lambda v: graph.tethers[v])[:count]
            for c in range(1, graph.goal_count + 1)]  # fmt: skip
    part = graph.subgraph([0, *(v for vertices in kept for v in vertices)])
    part.seed_of_run = seed
    return part


def test_a_plain_function_is_a_roadmap():
    """Its bounds hold along it only, and options and seed come by name."""
    problem = Problem.load(WHARF)
    found = solve(problem, roadmap=nearest_classes)
    assert (found.roadmap, found.status) == ("nearest_classes", Status.OPTIMAL_OF_ROADMAP)
    assert verify(problem, found)
    assert found.length >= solve(problem).length
    one = travel_graph(problem, nearest_classes, count=1, seed=7)
    assert (len(one), one.seed_of_run) == (9, 7)
    with pytest.raises(InputError, match="'nearest_classes': unknown option 'size'; expected one"):
        solve(problem, roadmap=nearest_classes, roadmap_options={"size": 1})
    with pytest.raises(InputError, match="expected a TravelGraph from it, got 5"):
        solve(problem, roadmap=lambda problem: 5)


class MatrixLegs:
    """Legs of a matrix of lengths, drawn straight."""

    def __init__(self, points, costs):
        self.points, self.costs = points, costs

    def lengths(self, vertices, wanted=None, clock=None):
        return self.costs[np.ix_(vertices, vertices)]

    def to_base(self):
        return self.costs[0]

    def lower_bounds(self, vertices, rows=None, clock=None):
        bounds = self.lengths(vertices)
        return bounds if rows is None else bounds[rows]

    def path(self, u, v):
        return self.points[[u, v]]


class MatrixRoadmap:
    """Roadmap whose travel graph has faults that tests put in."""

    def __init__(self, change=lambda costs: costs, n_words=None, tether=1.0, legs=MatrixLegs):
        self.change, self.n_words, self.tether, self.legs = change, n_words, tether, legs

    def __call__(self, problem):
        points = problem.points
        costs = np.linalg.norm(points[:, None] - points, axis=2)
        np.fill_diagonal(costs, np.inf)
        n = len(points)
        words = [()] * (n if self.n_words is None else self.n_words)
        legs = self.legs(points, self.change(costs))
        return TravelGraph(range(n), words, np.full(n, self.tether), legs)


@pytest.mark.parametrize(
    ("faults", "said"),
    [
        ({"change": lambda c: np.full_like(c, np.nan)}, "is nan; expected no negative number"),
        ({"change": lambda c: c - 99.0}, "expected no negative number"),
        ({"change": lambda c: c + np.triu(np.ones_like(c))}, "expected a symmetric matrix"),
        ({"n_words": 1}, "1 signatures and 4 tethers; expected one of each for every vertex, 4"),
        ({"tether": np.nan}, r"tethers\[0\] is nan; expected a length"),
        ({"legs": lambda points, costs: None}, "None has no method 'lengths'"),
    ],
)
def test_a_roadmap_that_makes_no_travel_graph_is_refused_in_one_line(faults, said):
    problem = Problem(base=(0, 0), goals=[(3, 4), (6, 0), (4, -3)], tether_length=8)
    assert solve(problem, roadmap=MatrixRoadmap()).length == solve(problem).length
    with pytest.raises(InputError, match=said):
        solve(problem, roadmap=MatrixRoadmap(**faults))


@pytest.mark.parametrize(
    ("part", "made", "said"),
    [
        ("planner", lambda: None, "too many positional arguments; expected a callable with the"),
        ("planner", lambda *args: None, "has no method 'plan'"),
        ("tether", lambda field: None, r"arguments \(field, delta\)"),
        ("tether", lambda field, delta: None, "expected start, update, drive, lay"),
        ("vehicle", lambda: None, r"arguments \(place, speed\)"),
        ("vehicle", lambda place, speed: None, "has no method 'go'; expected go, stop_at"),
    ],
)
def test_a_part_of_a_simulation_that_does_not_fit_is_refused_in_one_line(part, made, said):
    with pytest.raises(InputError, match=f"^{part} .*{said}"):
        simulate(post_mission(), scene=post_scene(), **{"planner": "none", part: made})


def test_errors_of_parts_by_name_are_told_in_one_line_and_those_of_callables_pass(
    tmp_path, monkeypatch
):
    (tmp_path / "loud.py").write_text(
        "from netsp.world.planner import Planner\n"
        "class Loud(Planner):\n"
        "    def step(self, robot, tether): raise ZeroDivisionError('step')\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(PluginError, match=r"planner 'loud:Loud' failed: ZeroDivisionError: step"):
        simulate(post_mission(), "loud:Loud", scene=post_scene())
    import loud

    with pytest.raises(ZeroDivisionError, match="step"):
        simulate(post_mission(), loud.Loud, scene=post_scene())


@pytest.mark.parametrize("name", ["geojson", "dxf", "gpx", ".mine", "MINE", ""])
def test_a_reader_of_maps_has_an_extension_of_its_own(name):
    with pytest.raises(InputError, match=r"^map reader: "):
        MAP_READERS[name] = lambda file: None


@pytest.mark.parametrize(
    ("feature", "said"),
    [
        ("x", "expected a Feature, got 'x'"),
        (Feature("A[0]", "A", "", {}, None), r"A\[0\]: expected a shape, got None"),
        (Feature("A[0]", "A", "", None, shapely.Point(0, 0)), "expected names with values"),
        (Feature("A[0]", "A", "", {}, shapely.Point(math.nan, 0)), "expected finite coordinates"),
    ],
)
def test_features_of_another_reader_are_checked(tmp_path, monkeypatch, feature, said):
    found = Map((feature,), False, {"A": 1}, metres=1.0)
    monkeypatch.setitem(MAP_READERS, "mine", lambda file: found)
    (tmp_path / "site.mine").write_text("")
    with pytest.raises(InputError, match=rf"reader of \.mine: .*{said}"):
        read_site(tmp_path / "site.mine", tether=3.0)


def test_a_model_names_its_fields_where_they_are_given_by_place():
    with pytest.raises(TypeError, match=r"^Circle: expected fields by name: Circle\(center=…, rad"):
        Circle((0, 4), 1)


def test_a_roadmap_of_another_module_is_given_the_seed_and_compared_in_studies(
    tmp_path, monkeypatch
):
    (tmp_path / "roadmap_here.py").write_text(
        "from netsp import InputError, travel_graph\n"
        "def seeded(problem, *, seed=-1):\n"
        "    if seed not in (-1, 3): raise InputError(f'got seed {seed}')\n"
        "    return travel_graph(problem)\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p])
    found = solve(Problem.load(WHARF), roadmap="roadmap_here:seeded", seed=3)
    assert (found.roadmap, found.status) == ("roadmap_here:seeded", Status.OPTIMAL_OF_ROADMAP)
    with pytest.raises(InputError, match="got seed 4"):
        solve(Problem.load(WHARF), roadmap="roadmap_here:seeded", seed=4)
    study = {"name": "own", "goals": [3], "tether_lengths": [200], "time_limit": 5, "seeds": [3],
             "worlds": {"count": 1}, "solvers": [{"name": "auto"}],
             "roadmaps": [{"name": "roadmap_here:seeded"}]}  # fmt: skip
    compare(Study.checked(study, "test"), tmp_path / "rows.jsonl")
    (row,) = read_rows(tmp_path / "rows.jsonl")
    assert row["status"] == "optimal_of_roadmap"
    study["roadmaps"] = [{"name": "no_such_roadmap"}]
    with pytest.raises(InputError, match="unknown roadmap 'no_such_roadmap'; expected one of taut"):
        Study.checked(study, "test")


def test_a_vehicle_may_be_a_class_of_ones_own():
    class Teleporter:
        def __init__(self, place, speed):
            self.position, self.yaw, self.control_s = np.array(place, dtype=float), 0.0, []

        def go(self, path, seconds, yaw, water, fresh, pull=None):
            self.position = np.array(path[0])
            return [self.position], 1

        def stop_at(self, place):
            self.position = np.array(place)

    scene = Scene.model_validate({"schema_version": 1, "name": "post", "solids": [POST]})
    mission = Mission(
        scene="-", anchor=(-2, 0, 0), start=(-2, 0.5, 0), tether_length=9.0,
        waypoints=[(-2, 4, 0)], speed=0.1,
    )  # fmt: skip
    run = simulate(mission, "none", vehicle=Teleporter, scene=scene)
    assert run.summary["visited"] == 1
    assert run.summary["inspection_s"] < 1.0


def test_two_planners_are_compared_one_of_them_by_its_module(tmp_path, monkeypatch, capsys):
    (tmp_path / "planner_here.py").write_text(
        "from netsp.world.planner import Planner\nclass Own(Planner):\n    name = 'own'\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p])
    Scene.model_validate({"schema_version": 1, "name": "post", "solids": [POST]}).save("scene.json")
    Mission(
        scene="scene.json", anchor=(-2, 0, 0), start=(-2, 0.5, 0), tether_length=9.0,
        waypoints=[(-2, 1, 0)], speed=0.5,
    ).save("mission.json")  # fmt: skip
    fly = ["simulate", "mission.json", "--planner", "none", "-o", "run", "--quiet", "--compare"]
    assert main([*fly, "planner_here:Own"]) == 0
    assert (tmp_path / "run" / "planner_here.Own" / "log.csv").exists()
    assert main([*fly, "nobody"]) == 2
    assert "unknown 'nobody'; expected one of predictive" in capsys.readouterr().err


READER = """
import shapely
from netsp.exchange.maps.feature import Feature, Map

def read(file):
    place = {"base": (0, 0), "goal": (3, 4)}
    features = [Feature(f"{kind}[0]", kind, "", {"kind": kind}, shapely.Point(place[kind]))
                for kind in open(file).read().split()]
    return Map(tuple(features), False, {f.layer: 1 for f in features}, metres=1.0)

def read_wrong(file): return 5
"""


def test_a_reader_of_maps_of_another_package_is_found_by_its_extension(tmp_path):
    (tmp_path / "reader.py").write_text(READER)
    info = tmp_path / "reader-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: reader\nVersion: 1\n")
    (info / "entry_points.txt").write_text(
        "[netsp.maps]\nwords = reader:read\nwrong = reader:read_wrong\ngeojson = reader:read\n"
    )
    env = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    (tmp_path / "site.words").write_text("base goal")
    done = netsp(env, "import", "site.words", "--tether", 6, "-o", "site.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert solve(Problem.load(tmp_path / "site.json")).length == pytest.approx(10.0)
    for name, text, code, said in (
        ("a.words", "tree", 1, "reader of .words failed: KeyError: 'tree'"),
        ("a.wrong", "", 2, "reader of .wrong: expected a Map from it, got 5"),
        ("a.geojson", "base goal", 2, "JSON"),  # the extension of a format of netsp's own
    ):
        (tmp_path / name).write_text(text)
        done = netsp(env, "import", name, "--tether", 6, "-o", "a.json", cwd=tmp_path)
        assert done.returncode == code, done.stderr
        assert said in done.stderr


def test_a_reader_of_maps_may_be_a_function_of_ones_own(tmp_path, monkeypatch):
    def read(file):
        point = {"base": shapely.Point(0, 0), "goal": shapely.Point(2, 0)}
        features = [Feature(f"{k}[0]", k, "", {"kind": k}, p) for k, p in point.items()]
        return Map(tuple(features), False, {"base": 1, "goal": 1}, metres=1.0)

    monkeypatch.setitem(MAP_READERS, "mine", read)
    (tmp_path / "site.mine").write_text("")
    assert solve(read_site(tmp_path / "site.mine", tether=3.0)).length == 4.0
    monkeypatch.setitem(MAP_READERS, "mine", lambda file: 5)
    with pytest.raises(InputError, match=r"reader of \.mine: expected a Map from it, got 5"):
        read_site(tmp_path / "site.mine", tether=3.0)


def test_a_name_of_ours_cannot_be_taken_and_a_broken_package_costs_one_line(monkeypatch):
    import importlib.metadata as metadata

    offers = [
        metadata.EntryPoint("auto", "elsewhere:solve", "netsp.solvers"),
        metadata.EntryPoint("gone", "not_installed_at_all:solve", "netsp.solvers"),
    ]
    monkeypatch.setattr(metadata, "entry_points", lambda group: offers)
    from netsp.base.registry import load

    registry = Registry("solver", "netsp.solvers", {"auto": "ours"}, lambda name, where: where)
    assert registry["auto"] == "ours"
    assert list(registry) == ["auto", "gone"]
    with pytest.raises(InputError, match="not_installed_at_all:solve: cannot be loaded"):
        load(registry["gone"])
    with pytest.raises(InputError, match="solver: unknown 'x'; expected one of auto, gone"):
        registry.named("x")


def square():
    return TravelGraph.from_costs([[0, 1, 5], [1, 0, 2], [5, 2, 0]], clusters=[0, 1, 2])


@dataclasses.dataclass
class Wishes:
    depth: int
    share: float = 1
    fast: bool = False
    label: typing.Literal["a", "b"] = "a"
    most: int | None = None
    names: list[str] = dataclasses.field(default_factory=list)


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({}, "'depth': missing"),
        ({"depth": 1.5}, "expected a whole number, got 1.5"),
        ({"depth": 1, "share": "x"}, "expected a number"),
        ({"depth": 1, "fast": 5}, "expected true or false, got 5"),
        ({"depth": 1, "label": "z"}, "expected one of a, b"),
        ({"depth": 1, "dept": 2}, "unknown option 'dept'"),
    ],
)
def test_options_are_checked_by_their_annotations(params, said):
    def wishful(graph, params: Wishes):
        return [0, 1, 2]

    with pytest.raises(InputError, match=said):
        solve_graph(square(), wishful, params=params)


def test_options_arrive_as_they_are_annotated():
    seen = []

    def wishful(graph, params: Wishes | None = None):
        seen.append(params)
        return [0, 1, 2]

    given = {"depth": 2**60 + 1, "share": "0.5", "fast": "true", "most": None, "names": ["x"]}
    solve_graph(square(), wishful, params=given)
    assert seen == [Wishes(2**60 + 1, 0.5, True, "a", None, ["x"])]


@pytest.mark.parametrize(
    "tour", [[0.5, 1.7, 2.2], "012", b"\x00\x01\x02", [False, True, 2], {0: 1, 1: 2, 2: 3},
             {0, 1, 2}, np.array([0, 1, 2.9]), [math.inf, 1], [10**5000, 1, 2]],
)  # fmt: skip
def test_only_sequences_of_whole_numbers_are_tours(tour):
    with pytest.raises(InputError, match="expected vertices from 0 on"):
        solve_graph(square(), lambda graph: tour)


def test_a_bound_that_is_no_number_is_refused_and_own_errors_pass():
    from netsp import Status

    with pytest.raises(InputError, match="lower_bound: expected a number"):
        solve_graph(square(), lambda g: Result((0, 1, 2), 8.0, "x", Status.OPTIMAL))

    def breaks(graph):
        yield 0
        raise ValueError("mine")

    with pytest.raises(ValueError, match="mine"):
        solve_graph(square(), breaks)


@dataclasses.dataclass(frozen=True)
class Cuts:
    rounds: int = 3
    share: float = 0.5

    def __post_init__(self) -> None:
        check_not_negative(self)


@dataclasses.dataclass(frozen=True)
class Policy:
    cuts: Cuts = Cuts()
    size: int = 7


@dataclasses.dataclass(frozen=True)
class Nested:
    policy: Policy = Policy()
    depth: int = 1


@pytest.mark.parametrize(
    ("params", "policy"),
    [
        ({}, Policy()),
        ({"policy": {"cuts": {"rounds": 5}}}, Policy(Cuts(5))),
        ({"policy.cuts.rounds": "5", "policy.size": 2}, Policy(Cuts(5), 2)),
        ({"policy": {"size": 2}, "policy.cuts.rounds": 5}, Policy(Cuts(5), 2)),
        ({"policy": {"cuts.rounds": 5, "cuts.share": 1}}, Policy(Cuts(5, 1.0))),
        ({"policy": Policy(size=9)}, Policy(size=9)),
        ({"policy": {"cuts": Cuts(9)}}, Policy(Cuts(9))),
    ],
)
def test_policies_are_read_from_nested_mappings_and_dotted_names(params, policy):
    assert read_params(Nested, "mine", params) == Nested(policy)


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"policy": {"cut": 1}}, "unknown option 'policy.cut'; expected one of cuts, size"),
        ({"policy.cuts.round": 1}, "unknown option 'policy.cuts.round'; expected one of rounds"),
        ({"policy": {"cuts": {"rounds": 1.5}}}, "option 'policy.cuts.rounds': expected a whole"),
        ({"policy": {"cuts": {"rounds": -1}}}, "policy.cuts.rounds: expected a number that is not"),
        ({"policy": 5}, "option 'policy': got 5; expected a mapping of cuts, size"),
        ({"policy": Cuts()}, r"option 'policy': got Cuts\(.*\); expected a mapping of cuts, size"),
    ],
)
def test_what_is_wrong_with_a_policy_is_named_by_its_path(params, said):
    with pytest.raises(InputError, match=f"^solver 'mine': {said}"):
        read_params(Nested, "mine", params)
