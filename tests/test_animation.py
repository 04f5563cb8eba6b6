"""Moving pictures of tours and runs."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from netsp import Circle, Problem, solve
from netsp.base.errors import InputError
from netsp.command.main import main
from netsp.online.execute.events import Event, Surprises
from netsp.online.execute.execution_files import write_execution
from netsp.online.execute.execution_log import ExecutionOptions
from netsp.online.execute.tour_execution import execute
from netsp.plan.space.mission_solver import solve_mission
from netsp.view.pictures import style
from netsp.view.pictures.animation import save_animation
from netsp.view.pictures.film import film_of_mission, film_of_plan, steps_of
from netsp.view.pictures.moments import moments_of_flight, moments_of_plan
from netsp.view.report.opened import opened
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import read_run, write_run
from netsp.world.simulator.mission_run import simulate
from tests.pages import unpacked
from tests.worlds import FEW_CELLS

ROOT = Path(__file__).parent.parent
SITE = Problem(
    base=(0, 0), goals=[(6, 2, -1), (6.5, -2, -1)], tether_length=12,
    obstacles=[Circle(center=(4, 0), radius=0.6, name="pile")], clearance=0.4,
)  # fmt: skip


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("animation")
    tour = solve(SITE)
    (folder / "p.json").write_text(SITE.to_json())
    (folder / "s.json").write_text(tour.to_json())
    (folder / "g.json").write_text(solve(SITE, solver="greedy").to_json())
    write_execution(execute(SITE, tour, ExecutionOptions()), folder / "run")
    return folder


def seen(picture, colour):
    """Pixels of about a colour."""
    pixels = np.asarray(picture.convert("RGB"), dtype=int)
    wanted = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
    return int((np.abs(pixels - wanted).sum(axis=2) < 24).sum())


def test_the_tether_of_a_plan_is_taut_from_the_base_to_the_robot_and_gone_at_the_end(files):
    tour = solve(SITE)
    moments = moments_of_plan(SITE, tour, 40)
    assert len(moments) == 41
    for m in moments:
        assert m.nodes[0] == pytest.approx(SITE.base)
        assert m.nodes[-1] == pytest.approx(m.path[-1])
    longest = max(np.linalg.norm(np.diff(m.nodes, axis=0), axis=1).sum() for m in moments)
    assert longest <= max(v.tether_length for v in tour.tour) + 0.1
    assert np.ptp(moments[-1].nodes, axis=0).max() < 1e-6


def test_a_gif_shows_the_robot_with_its_tether_and_what_it_has_gone(files):
    out = files / "tour.gif"
    told = ["animate", str(files / "s.json"), "--problem", str(files / "p.json"), "-o", str(out)]
    assert main([*told, "--seconds", "3", "--fps", "10", "--quiet"]) == 0
    with Image.open(out) as film:
        assert film.n_frames >= 25
        shown = []
        for k in (1, film.n_frames // 2, film.n_frames - 1):
            film.seek(k)
            shown.append([seen(film, c) for c in (style.PATH, style.TETHER, style.ROBOT)])
    (begun, _, robot), (half, tether, _), (done, gone, _) = shown
    assert begun < half < done
    assert tether > 100 > gone
    assert robot > 20


def test_a_run_and_a_tour_stand_side_by_side_in_a_film(files):
    pytest.importorskip("imageio_ffmpeg")
    import imageio_ffmpeg

    out = files / "both.mp4"
    two = [str(files / "run"), str(files / "g.json")]
    told = ["animate", *two, "--problem", str(files / "p.json"), "-o", str(out)]
    assert main([*told, "--seconds", "2", "--quiet"]) == 0
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(out))
    assert frames >= 30
    assert 2.0 <= seconds <= 4.5


@pytest.mark.parametrize("suffix", ["gif", "mp4"])
def test_what_ctrl_c_cuts_off_leaves_the_file_that_was_there(files, suffix, monkeypatch, capfd):
    def stop(done, of):
        if done == 5:
            raise KeyboardInterrupt

    site, tour = Problem.load(files / "p.json"), solve(SITE)
    film = film_of_plan(site, tour, 20)
    out = files / f"kept.{suffix}"
    out.write_text("before")
    with pytest.raises(KeyboardInterrupt):
        save_animation([film], out, seconds=2.0, on_progress=stop)
    assert out.read_text() == "before"
    assert not list(files.glob(".netsp-*"))
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("change", "says"),
    [({"-o": "film.avi"}, "film.avi"), ({"source": ["no.json"]}, "no.json"),
     ({"source": 4}, "expected 3 or fewer"), ({"--problem": None}, "problem")],
)  # fmt: skip
def test_what_cannot_be_animated_is_told_in_a_line(files, change, says, capsys, monkeypatch):
    monkeypatch.chdir(files)
    source = change.get("source", ["s.json"])
    source = ["s.json"] * source if isinstance(source, int) else source
    problem = change.get("--problem", "p.json")
    words = ["animate", *source, *(["--problem", problem] if problem else [])]
    assert main([*words, "-o", change.get("-o", "x.gif")]) == 2
    told = capsys.readouterr().err
    assert says in told
    assert told.count("\n") == 1
    assert not (files / "x.gif").exists()


def test_an_obstacle_that_appears_is_in_the_film_from_then_on_and_not_before(files):
    tour = solve(SITE)
    boat = Circle(center=(2.0, 3.0), radius=0.9, name="boat")
    run = execute(SITE, tour, surprises=Surprises(events=(Event(time=12, appear=boat),)))
    write_execution(run, files / "changed")
    out = files / "changed.gif"
    told = ["animate", str(files / "changed"), "-o", str(out), "--seconds", "3", "--quiet"]
    assert main(told) == 0
    with Image.open(out) as film:
        counts = []
        for k in range(0, film.n_frames, 3):
            film.seek(k)
            counts.append(seen(film, style.OBSTACLE))
    share = 12.0 / run.rows[-1].time
    before = counts[: int(0.8 * share * len(counts))]
    after = counts[int(1.2 * share * len(counts)) + 1 :]
    assert before
    assert after
    assert min(after) > 1.5 * max(before)


@pytest.fixture(scope="module")
def lost(files):
    """A run in which an obstacle comes to stand on a goal, and the other goal is visited."""
    boat = Circle(center=(6.4, -2.2), radius=0.7, name="boat")
    run = execute(SITE, solve(SITE), surprises=Surprises(events=(Event(time=3, appear=boat),)))
    assert set(run.left_out) == {1}
    write_execution(run, files / "lost")
    return files / "lost"


def test_a_goal_under_an_obstacle_is_shown_as_left_out_from_then_on(lost):
    film = opened(lost, None).film(60)
    for moment in film.moments:
        time = float(moment.text.split(" s;")[0])
        assert moment.fates["left out"] == ((1,) if time >= 3.0 else ())
    assert film.moments[0].fates["visited"] == ()
    assert film.moments[-1].fates["visited"] == (0,)


@pytest.mark.parametrize("command", ["animate", "report"])
def test_such_a_run_is_a_page_though_its_map_is_no_problem_that_can_be_solved(
    lost, tmp_path, command
):
    page = tmp_path / "lost.html"
    assert main([command, str(lost), "-o", str(page)]) == 0
    text = page.read_text()
    assert "boat, from 3 s" in text
    with pytest.raises(InputError, match="lies inside obstacles"):
        Problem.load(lost / "problem.json")


def test_goals_of_a_plan_are_visited_in_their_order_as_the_robot_comes_by(files):
    tour = solve(SITE)
    moments = moments_of_plan(SITE, tour, 50)
    order = [visit.goal for visit in tour.tour]
    counts = []
    for moment in moments:
        visited = moment.fates["visited"]
        assert list(visited) == order[: len(visited)]
        counts.append(len(visited))
        for goal in visited[-1:]:
            gone = np.linalg.norm(moment.path - np.array(SITE.goals[goal].position), axis=1)
            assert gone.min() < 1e-6
    assert counts == sorted(counts)
    assert (counts[0], counts[-1]) == (0, len(SITE.goals))


def test_a_run_and_a_plan_take_as_long_and_two_plans_go_as_fast(files):
    tour, run = solve(SITE), opened(files / "run", None).film(20)
    plan = film_of_plan(SITE, tour, 20)
    what, steps = steps_of([plan, run], 11)
    assert what == "done (%)"
    assert steps[-1].moments == (len(plan.moments) - 1, len(run.moments) - 1)
    longer = replace(plan, length=2.0 * plan.length)
    what, steps = steps_of([plan, longer], 11)
    assert what == "distance (m)"
    assert steps[5].moments == (len(plan.moments) - 1, (len(plan.moments) - 1) // 2)


def test_two_tours_are_a_page_with_two_maps_that_one_slider_moves(files, tmp_path):
    page = tmp_path / "two.html"
    two = [str(files / "run"), str(files / "g.json")]
    assert main(["animate", *two, "--problem", str(files / "p.json"), "-o", str(page)]) == 0
    text = page.read_text()
    assert text.count('<svg class="map"') == 2
    assert text.count('id="slider"') == 1
    data = json.loads(re.search(r'id="frames">(.*?)</script>', text).group(1))
    assert [max(film["at"]) for film in data] == [len(film["moments"]) - 1 for film in data]
    assert len({len(film["at"]) for film in data}) == 1


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    mission = Mission.load(ROOT / "missions" / "basin.json")
    mission = mission.model_copy(update={"waypoints": mission.waypoints[:6]})
    scene = mission.load_scene()
    run = simulate(mission, scene=scene)
    write_run(run, folder / "run")
    return folder, run, scene


def test_a_flight_reads_back_as_it_was_written(flight):
    folder, run, _ = flight
    again = read_run(folder / "run")
    assert again.planner == run.planner
    assert again.summary == run.summary
    assert len(again.log) == len(run.log)
    for a, b in zip(again.log, run.log, strict=True):
        assert (a.waypoint, a.mode, a.shortening) == (b.waypoint, b.mode, b.shortening)
        assert (a.time, a.x, a.tether) == pytest.approx((b.time, b.x, b.tether), abs=1e-5)


def test_the_tether_of_a_flight_is_as_long_as_its_log_says(flight):
    _, run, scene = flight
    stamps = np.array([r.time for r in run.log])
    for moment in moments_of_flight(run, scene, 30):
        time = float(moment.text.split(" s;")[0])
        told = run.log[int(np.argmin(np.abs(stamps - time)))].tether
        drawn = float(np.linalg.norm(np.diff(moment.nodes, axis=0), axis=1).sum())
        assert drawn == pytest.approx(told, abs=0.06)


def test_a_flight_is_shown_in_space_as_a_gif_and_as_a_page(flight):
    folder, _, _ = flight
    gif, page = folder / "f.gif", folder / "f.html"
    assert main(["animate", str(folder / "run"), "-o", str(gif), "--seconds", "2", "--quiet"]) == 0
    with Image.open(gif) as film:
        film.seek(film.n_frames // 2)
        assert seen(film, style.TETHER) > 50
        assert seen(film, style.ROBOT) > 20
    assert main(["animate", str(folder / "run"), "-o", str(page)]) == 0
    assert len(unpacked(page)["frames"]) == 120


def test_a_planned_mission_is_a_film_and_a_page(flight, tmp_path, capsys):
    folder, run, _ = flight
    planned = tmp_path / "planned.json"
    mission = run.mission.model_copy(update={"scene": str(ROOT / "scenes" / "basin.json")})
    (tmp_path / "m.json").write_text(mission.model_dump_json(exclude_none=True))
    assert main(["animate", str(tmp_path / "m.json"), "-o", str(tmp_path / "x.gif")]) == 2
    assert "tour: the mission has none" in capsys.readouterr().err
    found = solve_mission(mission, time_limit=60.0, policy=FEW_CELLS).mission
    planned.write_text(found.model_dump_json(exclude_none=True))
    film = film_of_mission(Mission.load(planned), run.mission.load_scene(), 40)
    visited = [len(m.fates["visited"]) for m in film.moments]
    assert visited == sorted(visited)
    assert (visited[0], visited[-1]) == (0, 6)
    for suffix in ("gif", "html"):
        out = str(tmp_path / f"x.{suffix}")
        assert main(["animate", str(planned), "-o", out, "--seconds", "1", "--quiet"]) == 0
    both = [str(planned), str(folder / "run")]
    assert main(["animate", *both, "-o", str(tmp_path / "both.html"), "--quiet"]) == 0
    names = [t.get("name") for t in unpacked(tmp_path / "both.html")["data"]]
    assert names.count("robot") == 2


def test_the_plane_and_space_are_no_page_together(files, flight, tmp_path, capsys):
    folder, _, _ = flight
    two = [str(files / "run"), str(folder / "run")]
    assert main(["animate", *two, "-o", str(tmp_path / "x.html")]) == 2
    assert "is in space and" in capsys.readouterr().err


def test_a_page_of_a_tour_has_a_button_that_plays(files):
    page = files / "tour.html"
    told = ["animate", str(files / "s.json"), "--problem", str(files / "p.json")]
    assert main([*told, "-o", str(page)]) == 0
    assert 'id="play"' in page.read_text()


def test_a_flight_that_is_damaged_or_whose_map_changed_is_told_in_a_line(flight, tmp_path, capsys):
    folder, run, _ = flight
    for change, says in (
        (lambda f: (f / "log.csv").write_text("time,x\n1,2\n"), "damaged"),
        (lambda f: (f / "log.csv").write_text("time,x\n"), "holds no row"),
        (lambda f: (f / "summary.json").write_text(
            json.dumps({**run.summary, "surprises": {"appear": 1}})), "the map changed"),
    ):  # fmt: skip
        copy = tmp_path / says.split()[0]
        shutil.copytree(folder / "run", copy)
        data = json.loads((copy / "mission.json").read_text())
        data["scene"] = str(ROOT / "scenes" / "basin.json")
        (copy / "mission.json").write_text(json.dumps(data))
        change(copy)
        assert main(["animate", str(copy), "-o", str(tmp_path / "x.gif")]) == 2
        told = capsys.readouterr().err
        assert says in told
        assert told.count("\n") == 1


@pytest.mark.parametrize("maps", ["[]", "{}", '[{"time": 5, "problem": {}}]', "3", "[NaN]"])
def test_damaged_maps_of_a_run_are_told_in_a_line(files, tmp_path, maps, capsys):
    shutil.copytree(files / "run", tmp_path / "run")
    (tmp_path / "run" / "maps.json").write_text(maps)
    assert main(["animate", str(tmp_path / "run"), "-o", str(tmp_path / "x.gif")]) == 2
    told = capsys.readouterr().err
    assert "maps.json" in told
    assert told.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("log.csv", lambda rows: rows[:2]),
        ("log.csv", lambda rows: [rows[0], *(["0" + r[r.index(","):] for r in rows[1:]])]),
        ("log.csv", lambda rows: [*rows[:-1], "nan" + rows[-1][rows[-1].index(","):]]),
        ("log.csv", lambda rows: [*rows[:-1], "inf" + rows[-1][rows[-1].index(","):]]),
        ("tethers.json", lambda rows: ['[{"time": NaN, "nodes": [[0, 0, 0], [1, 1, 1]]}]']),
        ("tethers.json", lambda rows: ['[{"time": 1, "nodes": 5}]']),
        ("tethers.json", lambda rows: ["[" * 100_000]),
        ("tethers.json", lambda rows: [f'[{{"time": {10**400}, "nodes": [[0, 0, 0]]}}]']),
        ("maps.json", lambda rows: [f'[{{"time": {10**400}, "problem": {{}}}}]']),
    ],
)  # fmt: skip
@pytest.mark.parametrize("suffix", ["gif", "html"])
def test_a_damaged_run_is_told_in_a_line_and_nothing_is_drawn(
    files, tmp_path, name, change, suffix, capsys
):
    shutil.copytree(files / "run", tmp_path / "run")
    file = tmp_path / "run" / name
    file.write_text("\n".join(change(file.read_text().split("\n")[:-1] if file.exists() else [])))
    assert main(["animate", str(tmp_path / "run"), "-o", str(tmp_path / f"x.{suffix}")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / f"x.{suffix}").exists()
