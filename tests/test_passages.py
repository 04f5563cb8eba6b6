"""Gaps that cells do not show are found where they are, as wide as they are, and shown if they can
be."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.command.main import main
from netsp.command.solve_mission import summary
from netsp.online.execute.mission_repair import _name_gaps
from netsp.plan.space.mission_policy import GapPolicy
from netsp.plan.space.mission_solver import solve_mission
from netsp.plan.space.passages import GapGrid, find_hidden_gaps, resolve_gaps
from netsp.plan.space.space_plan import candidate_plans, plan_given_order, prepare_context
from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.mission.planned_tour import PlannedTour
from netsp.world.simulator.mission_run import mission_grid, mission_grid_box

BOUNDS = [-3, -4, -1.5, 3, 4, 1.5]
CLEARANCE = 0.1


def scene_of(
    y: float, width: float, *, angle: float = 0.0, ends: float = 3.0, x: float = 0.0,
    thick: float = 0.2,
) -> Scene:  # fmt: skip
    """A thin wall with a slot, turned about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    solids = []
    for begin, end in ((-ends, y - 0.5 * width), (y + 0.5 * width, ends)):
        middle = 0.5 * (begin + end)
        solids.append({
            "box": {
                "center": [x - s * middle, c * middle, 0], "size": [thick, end - begin, 3.4],
                "rotation": [0, 0, float(np.degrees(angle))],
            }
        })  # fmt: skip
    return Scene(bounds=BOUNDS, solids=solids)


def mission_of(**more) -> Mission:
    return Mission.model_validate({
        "scene": "-", "anchor": (-2, 0, 0), "start": (-2, 0, 0),
        "waypoints": [(2, 0.5, 0), (2, -0.5, 0)], "tether_length": 12.0, "clearance": CLEARANCE,
        **more,
    })  # fmt: skip


def gaps_of(scene: Scene, **more):
    mission = mission_of(**more)
    return find_hidden_gaps(
        GapGrid.in_box(scene.field(), mission_grid_box(mission, scene), CLEARANCE)
    )


@settings(max_examples=16, deadline=None)
@example(y=0.6875, width=0.21875, x=0.0, thick=0.1)
@given(
    y=st.floats(-1.5, 1.5), width=st.floats(0.205, 0.5), x=st.sampled_from([0.0, 0.1]),
    thick=st.sampled_from([0.1, 0.2]),
)  # fmt: skip
def test_a_slot_wide_enough_is_shown_by_the_cells_or_named_with_its_place_and_width(
    y, width, x, thick
):
    """Walls at x = 0 close two layers of cells, those at x = 0.1 a single one if they are thin."""
    scene = scene_of(y, width, x=x, thick=thick)
    grid = GapGrid.in_box(scene.field(), mission_grid_box(mission_of(), scene), CLEARANCE)
    gaps = find_hidden_gaps(grid)
    rows = grid.low[1] + (np.arange(grid.shape[1]) + 0.5) * grid.cell
    # middles of the cells beside a thin wall at x = 0 are a little off its corners
    beside = max(0.0, 0.5 * grid.cell - 0.5 * thick) if x == 0.0 else 0.0
    room = 0.5 * width - np.abs(rows - y)
    shown = (np.hypot(beside, room[room > 0.0]) >= CLEARANCE).any()
    if shown:
        assert gaps == []
    else:
        assert len(gaps) == 1
        assert gaps[0].place[:2] == pytest.approx([x, y], abs=0.12)
        assert gaps[0].width == pytest.approx(width, abs=0.01)


def test_a_gap_too_narrow_for_the_robot_and_a_wall_without_one_are_not_named():
    assert gaps_of(scene_of(0.0, 0.15)) == []
    assert gaps_of(scene_of(0.0, 0.0)) == []
    for thick in (0.02, 0.1):
        assert gaps_of(scene_of(0.0, 0.15, x=0.1, thick=thick)) == []
        assert gaps_of(scene_of(0.0, 0.0, x=0.1, thick=thick)) == []
    bar = {"capsule": {"a": [0, -3, 0], "b": [0, 3, 0], "radius": 0.05}}
    assert gaps_of(Scene(bounds=BOUNDS, solids=[bar])) == []


def test_a_gap_beside_the_bounds_is_within_them():
    high = BOUNDS[4] - 0.15
    wall = {"box": {"center": [0.1, high - 5.0, 0], "size": [0.1, 10.0, 3.4]}}
    (gap,) = gaps_of(Scene(bounds=BOUNDS, solids=[wall]))
    assert gap.place[1] == BOUNDS[4]
    assert gap.width == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize("y", [0.0, 0.42, -1.17])
def test_a_cell_is_chosen_that_shows_a_slot_the_default_does_not(y):
    scene = scene_of(y, 0.24)
    mission = mission_of()
    assert gaps_of(scene)
    cells = resolve_gaps(mission, scene, scene.field())
    assert cells.left == ()
    assert len(cells.shown) == 1
    assert cells.mission.cell == cells.cell < 0.2
    # a cell that was asked for is kept, and the gap is named
    asked = resolve_gaps(mission_of(cell=0.2), scene, scene.field())
    assert asked.mission.cell == 0.2
    assert len(asked.left) == 1
    # and so is it where no cell that may be taken shows it
    few = resolve_gaps(mission, scene, scene.field(), GapPolicy(smallest=0.99))
    assert few.mission.cell is None
    assert len(few.left) == 1


def test_every_way_to_a_plan_names_the_gaps_that_its_cells_do_not_show():
    """Plans of the library and plans on a given grid, as repairs make, name them like a run."""
    scene = scene_of(0.0, 0.24)
    field, asked = scene.field(), mission_of(cell=0.2)
    grid = mission_grid(asked, scene, field)
    first = next(candidate_plans(asked, scene=scene, clock=Clock(5.0)))
    on_grid = plan_given_order(prepare_context(asked, Clock(), field=field, grid=grid))
    for tour in (first.to_mission().tour, on_grid.to_mission().tour):
        (gap,) = tour.unresolved_gaps
        assert gap.width == pytest.approx(0.24, abs=0.005)
    assert "0.24 m at (0, 0, " in _name_gaps(on_grid)
    # and a library's plan takes the cell that shows the gap, like a run
    finer = prepare_context(mission_of(), Clock(), scene=scene)
    assert finer.mission.cell == finer.grid.cell < 0.2
    assert finer.unresolved_gaps == ()


def test_a_search_for_gaps_without_time_does_not_say_that_there_are_none(tmp_path, capsys):
    scene, mission = scene_of(0.0, 0.24), mission_of(waypoints=[(-2, 1, 0)])
    cells = resolve_gaps(mission, scene, scene.field(), clock=Clock(0.0))
    assert cells.left is None
    solved = solve_mission(mission, scene=scene, time_limit=1e-6)
    assert solved.tour.unresolved_gaps is None
    told = summary(mission, solved, 0.0, None, None, "m")
    assert "the search for gaps that cells of 0.2 m do not show was not completed" in told


def test_a_waypoint_behind_a_gap_that_no_cell_shows_is_said_to_lie_there(tmp_path, capsys):
    scene = scene_of(0.0, 0.24, ends=4.2)
    (tmp_path / "scene.json").write_text(scene.model_dump_json(exclude_none=True))
    mission = mission_of(scene="scene.json", cell=0.2, waypoints=[(-2, 1, 0), (2, 0.5, 0)])
    file, out = tmp_path / "mission.json", tmp_path / "planned.json"
    file.write_text(mission.model_dump_json(exclude_none=True))
    assert main(["solve", str(file), "-o", str(out), "--time-limit", "6"]) == 4
    told = capsys.readouterr().err
    assert "left out #1" in told
    assert "perhaps through the gap of 0.24 m at (0, 0" in told
    assert "which cells of 0.2 do not show: give the mission a finer `cell`" in told
    tour = json.loads(Path(out).read_text())["tour"]
    assert tour["status"] != "optimal"
    assert tour["unresolved_gaps"][0]["width"] == pytest.approx(0.24, abs=0.005)


def test_a_flight_through_a_gap_that_no_cell_shows_does_not_end_the_run(tmp_path):
    """Paths through such a gap have no word, so that flight is no tour; there is one round it."""
    scene = scene_of(0.0, 0.24, ends=3.5, x=0.1, thick=0.1)
    (tmp_path / "scene.json").write_text(scene.model_dump_json(exclude_none=True))
    mission = mission_of(
        scene="scene.json", cell=0.2, delta=0.05, speed=0.3, tether_length=20.0,
        waypoints=[(2, 0, 0), (2, 1, 0), (-2, 1, 0)],
    )  # fmt: skip
    file, out = tmp_path / "mission.json", tmp_path / "planned.json"
    file.write_text(mission.model_dump_json(exclude_none=True))
    assert main(["solve", str(file), "-o", str(out), "--time-limit", "5", "--quiet"]) == 0
    assert main(["verify", str(out)]) == 0


def test_optimal_of_an_older_file_is_read_as_what_it_was():
    tour = {
        "stops": [], "home": [[0, 0, 0], [0, 0, 0]], "status": "optimal", "solver": "auto",
        "length": 10.0, "lower_bound": 10.0, "gap": 0.0, "bound_of_all": 9.0, "gap_to_all": 0.1,
    }  # fmt: skip
    assert PlannedTour.model_validate(tour).status.value == "optimal_of_states"
    proven = {**tour, "bound_of_all": 10.0, "gap_to_all": 0.0}
    assert PlannedTour.model_validate(proven).status.value == "optimal"


def test_parameters_of_the_search_for_gaps_are_checked():
    with pytest.raises(InputError, match="smallest: 2; expected between 0 and 1"):
        GapPolicy(smallest=2)
    with pytest.raises(InputError, match="finest: 0; expected 1 or more"):
        GapPolicy(finest=0)
