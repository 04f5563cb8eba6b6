"""The map in the browser: versions, the solver beside it, who is let in, and the page itself."""

import asyncio
import itertools
import json
import re
import shutil
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InfeasibleError, InputError, Problem, Solution, Tethers, solve, verify
from netsp.app.dragged_tethers import Cursor
from netsp.app.facts import facts, shortest_sufficient
from netsp.app.served_files import EXPORTS, bare_name
from netsp.app.shown import read_shown
from netsp.app.solving import Worker
from netsp.app.state import Document
from netsp.app.view_box import Frame
from netsp.base.geometry import polylines
from netsp.exchange.maps.path_file import read_paths
from netsp.exchange.maps.site_import import read_site
from netsp.exchange.missions.mission_files import export
from netsp.model.problem import Origin
from netsp.online.execute.events import Event, Surprises
from netsp.online.execute.execution_files import write_execution
from netsp.online.execute.tour_execution import execute
from netsp.plan.sizing.tether_margins import margins
from netsp.study.paths import measure_path
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import write_run
from netsp.world.simulator.mission_run import simulate

testclient = pytest.importorskip("starlette.testclient")

from netsp.app.page_session import Session  # noqa: E402
from netsp.app.server import application  # noqa: E402

ROOT = Path(__file__).parent.parent
JS = ROOT / "tests" / "js"
WHARF = ROOT / "problems" / "wharf.json"
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")

edits = st.one_of(
    st.builds(lambda v: {"set": ["tether_length"], "value": v}, st.floats(1, 99)),
    st.builds(lambda x, y: {"add": "goals", "value": [x, y]}, st.floats(-9, 9), st.floats(-9, 9)),
    st.builds(lambda k: {"delete": [["goals", k]]}, st.integers(0, 3)),
    st.builds(lambda k, x: {"set": ["goals", k], "value": [x, 1.0]}, st.integers(0, 3),
              st.floats(-9, 9)),
    st.builds(lambda r: {"add": "obstacles", "value": {"center": [3, 3], "radius": r}},
              st.floats(-1, 2)),
    st.sampled_from([{"undo": True}, {"redo": True}]),
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(changes=st.lists(edits, max_size=30))
def test_every_version_can_be_gone_back_to_and_nothing_is_lost_on_the_way(
    changes, tmp_path_factory
):
    """A list of versions and a place in it are all that is needed to foretell the document."""
    file = tmp_path_factory.mktemp("d") / "p.json"
    file.write_text(WHARF.read_text())
    document = Document(file)
    versions, at = [document.data], 0
    for change in changes:
        before = json.dumps(document.data)
        if "undo" in change:
            assert document.undo() == (at > 0)
            at = max(at - 1, 0)
        elif "redo" in change:
            assert document.redo() == (at < len(versions) - 1)
            at = min(at + 1, len(versions) - 1)
        else:
            try:
                document.apply(change)
            except InputError:
                assert json.dumps(document.data) == before
                continue
            versions = [*versions[: at + 1], document.data]
            at += 1
        assert document.data == versions[at]
        assert Document(file).data == versions[at]  # as after a crash
        if document.complaint() is None:
            assert isinstance(document.problem(), Problem)
    assert Problem.load(file) == Problem.load(WHARF)  # not saved, not touched


def test_a_version_shares_what_an_edit_does_not_change(tmp_path):
    """Ten thousand versions of a large problem would not fit into memory else."""
    document = Document(None, json.loads(Problem.load(WHARF).to_json()))
    before = document.data
    place = [1.0, 2.0, -3.0]
    document.apply({"set": ["goals", 2, "position"], "value": place})
    after = document.data
    assert after["obstacles"] is before["obstacles"]
    assert all(a is b for k, (a, b) in enumerate(zip(after["goals"], before["goals"], strict=True))
               if k != 2)  # fmt: skip
    assert before["goals"][2]["position"] != place
    place[0] = 9.0
    assert after["goals"][2]["position"] == [1.0, 2.0, -3.0]
    with pytest.raises(InputError):
        document.apply({"delete": [["goals", 0], ["goals", 99]]})
    assert document.data is after


def test_one_slide_is_one_version_to_go_back_from():
    document = Document(None, json.loads(Problem.load(WHARF).to_json()))
    before = document.data["tether_length"]
    for slide in (1, 2):
        for length in (10.0, 20.0, 30.0 * slide):
            document.apply({"set": ["tether_length"], "value": length, "merge": slide})
    document.apply({"set": ["tether_length"], "value": 5.0})
    seen = []
    while document.undo():
        seen.append(document.data["tether_length"])
    assert seen == [60.0, 30.0, before]
    # what was gone back from is not written over
    document.redo()
    document.apply({"set": ["tether_length"], "value": 7.0, "merge": 1})
    document.undo()
    assert document.data["tether_length"] == 30.0


def test_what_is_saved_is_what_the_command_line_reads(tmp_path):
    file = tmp_path / "p.json"
    document = Document(file)
    assert document.complaint() == "there is no goal yet"
    with pytest.raises(InputError, match="no goal"):
        document.save()
    document.apply({"add": "goals", "value": {"name": "a", "position": [3, 4, -1]}})
    document.apply({"set": ["tether_length"], "value": -4})
    assert "tether_length: expected" in document.complaint()
    document.undo()
    document.save()
    assert file.read_text() == document.problem().to_json()
    assert document.saved
    assert [f.name for f in tmp_path.iterdir()] == ["p.json"]
    for wrong in ({"set": ["goal"], "value": 1}, {"set": ["goals", 7], "value": 1}, {"move": 1},
                  {"add": "walls"}, {"delete": []}, {"delete": [["goals", "0"]]},
                  {"set": ["goals", 0, 1], "value": 2},
                  {"set": ["clearance"], "value": float("nan")}):  # fmt: skip
        with pytest.raises(InputError):
            document.apply(wrong)
        assert document.saved


def heard(box, until, seconds=30.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if box and until(box[-1]):
            return box[-1]
        time.sleep(0.01)
    raise AssertionError(f"not heard: {box[-1:]}")


@pytest.fixture(scope="module")
def worker():
    box = []
    made = Worker(box.append, 20.0)
    yield made, box
    made.close()


def test_the_solver_answers_the_latest_version_only(worker):
    made, box = worker
    slow = (ROOT / "problems" / "lillgrund-part.json").read_text()
    problem = Problem.load(WHARF)
    for version in range(20):
        made.solve(version, slow)
    made.solve(99, problem.to_json())
    said = heard(box, lambda m: m["version"] == 99 and m["stage"] == "done")
    solution = Solution.from_json(said["solution"])
    assert verify(problem, solution)
    assert solution.length == pytest.approx(solve(problem).length)
    assert np.array(said["path"])[0] == pytest.approx(problem.points[0])
    assert [v["goal"] for v in said["visits"]] == [v.goal for v in solution.tour]


def test_what_cannot_be_solved_is_told_and_a_dead_solver_is_replaced(worker):
    made, box = worker
    far = Problem(base=(0, 0), goals=[(1, 0), (30, 40)], tether_length=20)
    made.solve(100, far.to_json())
    said = heard(box, lambda m: m["version"] == 100)
    assert said["unreached"] == [{"goal": 1, "needed": pytest.approx(50.0)}]
    assert said["needed"] == pytest.approx(50.0)
    made._process.kill()
    made._process.join()
    time.sleep(0.2)
    made.solve(101, Problem.load(WHARF).to_json())
    assert heard(box, lambda m: m["version"] == 101 and m["stage"] == "done")["length"]
    far = {**json.loads(Problem.load(WHARF).to_json()), "base": [1e9, 1e9, 0.0]}
    made.solve(102, json.dumps(far))
    said = heard(box, lambda m: m["version"] == 102 and m["stage"] == "done")
    assert said["error"]
    assert (said["unreached"], said["needed"]) == ([], None)


def test_the_tether_at_the_cursor_is_that_of_the_class_of_the_tour():
    problem = Problem.load(WHARF)
    solution = solve(problem)
    cursor = Cursor(problem, solution.path)
    tethers = Tethers(problem)
    for visit in solution.tour:
        x, y, _ = problem.goals[visit.goal].position
        assert tuple(cursor.hover(x, y)["word"]) == visit.signature
        told = cursor.classes(visit.goal)
        lengths = [c["length"] for c in told["classes"]]
        assert told["count"] >= len(lengths) > 0
        assert lengths == sorted(lengths)
        assert min(abs(length - visit.tether_length) for length in lengths) < 1e-6
    ends = [cursor.along(s) for s in (0.0, 1.0)]
    assert [e["length"] for e in ends] == pytest.approx([0.0, 0.0], abs=1e-6)
    for share in np.linspace(0.05, 0.95, 20):
        told = cursor.along(float(share))
        assert told["length"] <= problem.tether_length * (1 + 1e-9)
        assert tethers.to(told["x"], told["y"], tuple(told["word"])) is not None


@pytest.fixture
def client(tmp_path):
    file = tmp_path / "wharf.json"
    file.write_text(WHARF.read_text())
    session = Session(Document(file), 20.0)
    app = application(session, "secret", 1234)
    with testclient.TestClient(app, base_url="http://127.0.0.1:1234") as made:
        yield made, file
    session.close()


def test_nobody_comes_in_without_the_token_or_from_elsewhere(client):
    made, _ = client
    assert made.get("/").status_code == 403
    assert made.get("/?token=Secret").status_code == 403
    page = made.get("/?token=secret")
    assert page.status_code == 200
    policy = page.headers["content-security-policy"].split("; ")
    assert "script-src 'self'" in policy
    assert "default-src 'none'" in policy
    rebound = {"host": "evil.example:1234"}
    assert made.get("/?token=secret", headers=rebound).status_code == 403
    assert made.get("/?token=secret", headers={"origin": "http://evil"}).status_code == 403
    assert made.get("/static/../server.py").status_code == 404
    assert made.get("/static/%2e%2e/server.py").status_code == 404
    assert made.get("/download/problem.json").status_code == 403
    assert made.get("/download/passwd?token=secret").status_code in (404, 409)
    for url, headers in (
        ("/live", {}), ("/live?token=wrong", {}), ("/live?token=secret", rebound),
        ("/live?token=secret", {"origin": "http://127.0.0.1:99"}),
    ):  # fmt: skip
        headers = {"host": "127.0.0.1:1234"} | headers
        with (
            pytest.raises(testclient.WebSocketDisconnect),
            made.websocket_connect(url, headers=headers),
        ):
            pass


def listen(socket, until):
    for _ in range(400):
        message = socket.receive_json()
        if until(message):
            return message
    raise AssertionError("not heard")


def test_an_edit_is_answered_with_a_verified_tour_on_every_page(client):
    made, file = client
    headers = {"host": "127.0.0.1:1234", "origin": "http://127.0.0.1:1234"}
    live = "/live?token=secret"
    with (
        made.websocket_connect(live, headers=headers) as one,
        made.websocket_connect(live, headers=headers) as other,
    ):
        one.send_json(
            {"id": 1, "edit": {"set": ["goals", 2, "position"], "value": [12.5, 4.0, -3]}}
        )
        done = [
            listen(s, lambda m: m.get("tour", {}).get("stage") == "done"
                   and m["tour"]["version"] == 1)["tour"]
            for s in (one, other)
        ]  # fmt: skip
        assert done[0] == done[1]
        problem = Problem.from_json(made.get("/download/problem.json?token=secret").text)
        assert problem.goals[2].position == (12.5, 4.0, -3.0)
        found = Solution.from_json(made.get("/download/solution.json?token=secret").text)
        assert verify(problem, found)
        assert found.length == pytest.approx(solve(problem).length)
        assert "How the tether runs" in made.get("/download/report.html?token=secret").text
        for message, said in (
            ({"id": 2, "hover": [5, 5]}, "hover"), ({"id": 3, "along": 0.4}, "along"),
            ({"id": 4, "classes": 1}, "classes"), ({"id": 5, "classes": 99}, "error"),
            ({"id": 6, "edit": {"set": ["clearance"], "value": "wide"}}, "id"),
            ({"id": 7, "edit": {"eval": "1"}}, "error"), ({"id": 8}, "error"),
        ):  # fmt: skip
            one.send_json(message)
            answer = listen(one, lambda m, n=message["id"]: m.get("id") == n)
            assert said in answer, message
        state = listen(other, lambda m: "state" in m and m["state"]["version"] == 2)["state"]
        assert "clearance: expected a number" in state["error"]
        one.send_text("no json")
        assert "not JSON" in listen(one, lambda m: "error" in m and "id" not in m)["error"]
        one.send_json({"id": 9, "hover": ["a", None]})
        assert "error" in listen(one, lambda m: m.get("id") == 9)
        one.send_json({"undo": True})
        one.send_json({"id": 10, "save": True})
        assert listen(one, lambda m: m.get("id") == 10) == {"id": 10}
    assert Problem.load(file) == problem


def test_what_is_told_beside_the_length_is_true():
    problem = Problem.load(WHARF)
    solution = solve(problem)
    told = facts(problem, solution)
    lengths = [row[1] for row in told["profile"]]
    assert max(lengths) <= problem.tether_length
    at_visits = [min(told["profile"], key=lambda r, v=v: abs(r[0] - v))[1] for v in told["visits"]]
    assert at_visits == pytest.approx([v.tether_length for v in solution.tour], abs=1e-3)
    assert told["margins"] == json.loads(margins(problem, solution).to_json())
    least = told["sufficient"]
    assert solve(problem.model_copy(update={"tether_length": least * (1 + 1e-9)})).length
    with pytest.raises(InfeasibleError):
        solve(problem.model_copy(update={"tether_length": least * (1 - 1e-6)}))
    short = problem.model_copy(update={"tether_length": 0.5 * least})
    assert shortest_sufficient(short) == pytest.approx(least)  # whatever tether there is
    assert facts(problem, solution, lambda: True) is None


def test_what_is_told_without_obstacles_can_be_said_in_json():
    problem = Problem(base=(0, 0), goals=[(3, 4)], tether_length=6)
    told = facts(problem, solve(problem))
    assert json.loads(json.dumps(told, allow_nan=False))["margins"]["obstacles"] is None


def posted(client, file, name=None, content=None):
    return client.post(
        "/import", params={"token": "secret", "name": file.name if name is None else name},
        content=file.read_bytes() if content is None else content,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["harbour.kml", "site.geojson"])
def test_a_map_on_the_page_is_what_the_command_makes_of_it(client, name):
    pytest.importorskip("pyogrio")
    made, _ = client
    file = ROOT / "examples" / name
    assert posted(made, file).status_code == 200
    text = made.get("/download/problem.json?token=secret").text
    assert text == read_site(file).to_json()


def test_the_page_asks_for_what_a_map_lacks_and_reads_it_with_the_answers(client):
    made, _ = client
    before = made.get("/download/problem.json?token=secret").text
    features = [
        {"type": "Feature", "properties": {"man_made": "pier"} if n else {"kind": "path"},
         "geometry": {"type": "LineString", "coordinates": [[12.0001, lat], [12.0002, lat]]}}
        for n, lat in (("north", 55.0001), ("south", 54.9999), (None, 55.0))
    ]  # fmt: skip
    content = json.dumps({"type": "FeatureCollection", "features": features}).encode()
    given = {"token": "secret", "name": "piers.geojson"}
    for answers, asks in (
        ({}, ["base"]),
        ({"base": "55,12"}, ["line_width", "inspect"]),
        ({"line_width": "0.5"}, ["inspect"]),
        ({"viewpoints": "2", "standoff": "1"}, None),
    ):
        given |= answers
        answer = made.post("/import", params=given, content=content)
        if asks is None:
            assert answer.status_code == 200
            continue
        assert answer.status_code == 422
        assert set(asks) <= set(answer.json()["asks"])
        assert "--" not in answer.text
        assert made.get("/download/problem.json?token=secret").text == before
    text = made.get("/download/problem.json?token=secret").text
    (layer,) = Problem.from_json(text).site.imported
    assert layer.used == {"obstacle": 2, "path": 1}
    answer = made.post("/import", params={**given, "radius": "wide"}, content=content)
    assert "radius: expected a positive number" in answer.text


def test_the_page_shows_what_an_import_says_and_that_the_problem_was_edited(client):
    """As `netsp import`: the table, notes, and depth 0 everywhere, without options of a command."""
    made, _ = client
    headers = {"host": "127.0.0.1:1234", "origin": "http://127.0.0.1:1234"}
    hold = [20, 1, 20]
    rows = [f"{k}\t0\t3\t16\t{h}\t0\t0\t0\t55.000{k}\t12.0001\t0\t1" for k, h in enumerate(hold, 1)]
    content = "\n".join(["QGC WPL 110", "0\t1\t0\t16\t0\t0\t0\t0\t55\t12\t0\t1", *rows]).encode()
    given = {"token": "secret", "name": "m.waypoints", "tether": "60"}
    answer = made.post("/import", params=given, content=content)
    assert answer.status_code == 200
    assert "1 waypoint passed by: taken as bends" in answer.text
    assert "all goals are at depth 0" in answer.text
    assert "--" not in answer.text
    with made.websocket_connect("/live?token=secret", headers=headers) as page:
        state = page.receive_json()["state"]
        assert answer.text.split("\n") == state["notes"]
        site = state["data"]["site"]
        assert [(r["layer"], r["used"]) for r in site["imported"]] == [
            ("waypoints", {"goal": 2}), ("bends", {}), ("home", {"base": 1}),
        ]  # fmt: skip
        assert "--" not in json.dumps(site)
        goals = [{**g, "position": [*g["position"][:2], -2.0]} for g in state["data"]["goals"]]
        page.send_json({"edit": {"set": ["name"], "value": "renamed"}})
        assert not listen(page, lambda m: "state" in m)["state"]["data"]["site"]["edited"]
        page.send_json({"edit": {"set": ["goals"], "value": goals}})
        state = listen(page, lambda m: "state" in m)["state"]
        assert state["data"]["site"] == {**site, "edited": True}
        assert not any("depth 0" in note for note in state["notes"])
        page.send_json({"undo": True})
        assert not listen(page, lambda m: "state" in m)["state"]["data"]["site"]["edited"]
    assert Problem.from_json(made.get("/download/problem.json?token=secret").text).site is not None


def test_what_cannot_be_opened_changes_nothing(client):
    made, file = client
    before = made.get("/download/problem.json?token=secret").text
    for name, content, status, said in (
        ("a.json", b"{", 422, "a.json: not JSON"), ("a.json", b"[]", 422, "a.json"),
        ("../../a.exe", b"MZ", 422, "a.exe: expected .json"), ("", b"{}", 422, "expected a name"),
        ("a.kml", b"<kml", 422, "a.kml"), ("a.geojson", b"\xff\xfe", 422, "a.geojson"),
    ):  # fmt: skip
        answer = posted(made, None, name, content)
        assert answer.status_code == status
        assert said in answer.text
        assert answer.text.count("\n") == 0
        assert "/tmp" not in answer.text
    assert made.post("/import?name=a.json", content=b"{}").status_code == 403
    far = {"origin": "http://evil"}
    assert (
        made.post("/import?token=secret&name=a.json", content=b"", headers=far).status_code == 403
    )
    large = {"content-length": str(10**9)}
    assert made.post("/import?token=secret&name=a", content=b"x", headers=large).status_code == 413
    assert made.get("/download/problem.json?token=secret").text == before
    assert Problem.load(file) == Problem.load(WHARF)


def test_a_path_drawn_by_hand_has_the_figures_of_compare_path_and_goes_out_as_geojson(client):
    made, file = client
    headers = {"host": "127.0.0.1:1234", "origin": "http://127.0.0.1:1234"}
    live = "/live?token=secret"
    problem = Problem.load(file)
    assert made.get("/download/drawn.geojson?token=secret").status_code == 409
    points = [[0, 0], [3, 3.5], [7.5, 3.5], [7.5, 5], [0.3, 5]]
    with (
        made.websocket_connect(live, headers=headers) as one,
        made.websocket_connect(live, headers=headers) as other,
    ):
        one.send_json({"id": 1, "drawn": points, "by": "one"})
        told = listen(one, lambda m: m.get("id") == 1)["drawn"]
        assert listen(other, lambda m: "drawn_points" in m)["drawn_points"] == points
        m = measure_path(problem, points)
        assert told["length"] == pytest.approx(m.length)
        assert told["longest_tether"] == pytest.approx(m.longest_tether)
        assert [v["goal"] for v in told["visits"]] == list(m.order) == [0, 1]
        assert told["end_word"] == list(m.end_word)
        assert told["entangled"] == list(m.entangled)
        taut = polylines.length(np.array(told["tether"]))
        assert np.hypot(taut, told["end_z"]) == pytest.approx(m.end_tether, rel=1e-3)
        # with the cursor at the base, once round a pile; what is drawn stays as it is
        one.send_json({"id": 2, "drawn": points[:4], "cursor": [2, 2.5]})
        assert listen(one, lambda m: m.get("id") == 2)["drawn"]["missing"]
        one.send_json({"id": 3, "drawn": [*points, [0.3, 0], [0, 0]]})
        assert listen(one, lambda m: m.get("id") == 3)["drawn"]["free"]
        one.send_json({"id": 4, "order": [0, 1]})
        worth = listen(one, lambda m: m.get("id") == 4)["worth"]
        only = problem.model_copy(update={"goals": problem.goals[:2]})
        assert worth["length"] == pytest.approx(solve(only, keep_order=True).length)
        for wrong in (
            {"drawn": 3}, {"drawn": [[1]]}, {"drawn": [[1, "a"]]}, {"drawn": [[0, 0]] * 9999},
            {"order": [0, 0]}, {"order": [99]}, {"order": "a"},
        ):  # fmt: skip
            one.send_json({"id": 5, **wrong})
            assert "error" in listen(one, lambda m: m.get("id") == 5)
    text = made.get("/download/drawn.geojson?token=secret").text
    file.with_suffix(".geojson").write_text(text)
    (found,) = read_paths(file.with_suffix(".geojson"), problem)
    assert measure_path(problem, found.points).is_free
    with made.websocket_connect(live, headers=headers) as again:  # a page opened later
        assert listen(again, lambda m: "drawn_points" in m)["drawn_points"][-1] == [0.0, 0.0]


MALFORMED = (
    '{"id": 1, "edit": "x"}', "null", "3", "[1, 2]", "{", '{"id": 1, "edit": null}',
    '{"id": 1, "edit": {"set": [["goals"]], "value": 1}}', '{"id": 1, "edit": {"set": [{}]}}',
    '{"id": 1, "edit": {"add": ["goals"], "value": 1}}', '{"id": 1, "edit": {"delete": [[{}, 0]]}}',
    '{"id": 1, "edit": {"add": "goals", "value": 1}}',
    '{"id": 1, "edit": {"set": ["goals"], "value": "abc"}}',
    '{"id": 1, "edit": {"replace": {"goals": "abc"}}}',
    '{"id": 1, "edit": {"replace": {"goals": ["abc"]}}}',
    '{"id": 1, "edit": {"replace": {"goal": []}}}',
    '{"id": NaN, "undo": true}', '{"id": {"a": 1}, "undo": true}',
    '{"id": 1, "edit": {"set": ["tether_length"], "value": NaN}}',
    '{"id": 1, "hover": [1]}', '{"id": 1, "along": {}}', '{"id": 1, "classes": true}',
    '{"id": 1, "save": 3}', '{"id": 1, "space": null}', '{"id": 1, "id": 2}',
    '{"id": ' + "1" * 5001 + "}", "[" * 100_000,
    '{"id": 1, "edit": ' + "[" * 2000 + "]" * 2000 + "}",
    *(
        '{"id": 1, "edit": {' + edit + "[" * 700 + "]" * 700 + "}" * edit.count("{") + "}}"
        for edit in (  # they can be read, but not copied
            '"set": ["name"], "value": ', '"add": "goals", "value": ', '"replace": {"goals": ',
        )
    ),
)  # fmt: skip
"""Messages that a page may not send, each wrong in its own way."""


def test_every_malformed_message_is_answered_and_changes_nothing(client):
    made, file = client
    headers = {"host": "127.0.0.1:1234", "origin": "http://127.0.0.1:1234"}
    with made.websocket_connect("/live?token=secret", headers=headers) as page:
        version = listen(page, lambda m: "state" in m)["state"]["version"]
        for text in MALFORMED:
            page.send_text(text)
            assert listen(page, lambda m: "error" in m and "tour" not in m), text
        page.send_bytes(b"\x00\xff")
        assert "got bytes" in listen(page, lambda m: "error" in m and "tour" not in m)["error"]
        page.send_json({"id": 77, "undo": True})
        assert listen(page, lambda m: m.get("id") == 77) == {"id": 77}
    assert made.app is not None
    with made.websocket_connect("/live?token=secret", headers=headers) as page:
        state = listen(page, lambda m: "state" in m)["state"]
        assert state["version"] == version
        assert Problem.from_json(json.dumps(state["data"])) == Problem.load(file)


@pytest.mark.parametrize("content", [b'{"a":' * 3000 + b"1" + b"}" * 3000, b"[" * 200_000])
def test_deeply_nested_json_is_refused_in_one_line(client, content):
    answer = posted(client[0], None, "a.json", content)
    assert answer.status_code == 422
    assert "nested too deeply" in answer.text
    assert answer.text.count("\n") == 0


def test_an_edit_that_the_disk_does_not_take_is_not_there(tmp_path, monkeypatch):
    """A version is kept beside the file before it becomes the present one."""
    file = tmp_path / "p.json"
    file.write_text(WHARF.read_text())
    document = Document(file)
    document.apply({"set": ["tether_length"], "value": 21.0})
    before, version = document.data, document.version

    def full(path, text):
        raise InputError(f"{path}: cannot be written: No space left on device")

    for change in (
        lambda: document.apply({"set": ["tether_length"], "value": 99.0}),
        lambda: document.apply({"set": ["tether_length"], "value": 99.0, "merge": 1}),
        document.undo,
    ):
        with monkeypatch.context() as patched:
            patched.setattr("netsp.app.state.write_text", full)
            with pytest.raises(InputError, match="No space left"):
                change()
        assert document.data == before
        assert document.version == version
    document.save()
    assert Problem.load(file).tether_length == 21.0


def test_a_page_that_goes_away_during_an_import_ends_without_a_traceback(client):
    """Starlette says by an exception that nobody waits for the answer any more."""
    made, _ = client
    told = []

    async def gone():
        return {"type": "http.disconnect"}

    async def send(message):
        told.append(message)

    scope = {
        "type": "http", "method": "POST", "path": "/import", "raw_path": b"/import",
        "query_string": b"token=secret&name=a.json", "root_path": "", "scheme": "http",
        "headers": [(b"host", b"127.0.0.1:1234"), (b"content-length", b"100")],
        "http_version": "1.1", "server": ("127.0.0.1", 1234), "client": ("127.0.0.1", 1),
    }  # fmt: skip
    asyncio.run(made.app(scope, gone, send))
    assert told[0]["status"] == 400


def test_what_is_exported_is_what_the_command_writes(tmp_path):
    file = tmp_path / "harbour.json"
    problem = Problem.load(WHARF).model_copy(
        update={"origin": Origin(latitude=54.0, longitude=8.0)}
    )
    file.write_text(problem.to_json())
    session = Session(Document(file), 20.0)
    app = application(session, "secret", 1234)
    with testclient.TestClient(app, base_url="http://127.0.0.1:1234") as made:
        end = time.monotonic() + 60
        while session.solution is None or session.answer["stage"] != "done":
            assert time.monotonic() < end
            time.sleep(0.05)
        solution = Solution.from_json(session.solution)
        for kind, name in EXPORTS.items():
            export(problem, solution, tmp_path / name, kind)
            answer = made.get(f"/download/{kind}?token=secret")
            assert answer.text == (tmp_path / name).read_text()
            assert f'filename="{name}"' in answer.headers["content-disposition"]
    session.close()


def test_it_saves_into_the_folder_that_was_opened_and_over_nothing(client, tmp_path):
    made, file = client
    (file.parent / "other.json").write_text("kept")
    headers = {"host": "127.0.0.1:1234"}
    with made.websocket_connect("/live?token=secret", headers=headers) as socket:
        for n, (name, said) in enumerate((
            ("other.json", "exists already"), ("../../new", None), ("", "expected a name"),
            (".hidden", "expected a name"), (7, "expected the name"),
        )):  # fmt: skip
            socket.send_json({"id": n, "save": name})
            answer = listen(socket, lambda m, n=n: m.get("id") == n)
            assert (said in answer["error"]) if said else "error" not in answer
    assert (file.parent / "other.json").read_text() == "kept"
    assert Problem.load(file.parent / "new.json") == Problem.load(WHARF)
    assert sorted(f.name for f in file.parent.iterdir()) == ["new.json", "other.json", "wharf.json"]
    assert bare_name("C:\\a\\b.json") == "b.json"
    for name in ("", "..", ".hidden", "a\0b", "a\nb", "\ud800.json", "a" * 201, "\u00fc" * 101):
        with pytest.raises(InputError):
            bare_name(name)


def test_a_solution_and_runs_can_be_looked_at_and_not_changed(tmp_path):
    problem = Problem.load(WHARF)
    solution = solve(problem)
    (tmp_path / "s.json").write_text(solution.to_json())
    write_execution(execute(problem, solution), tmp_path / "run")
    mission = Mission.load(ROOT / "missions" / "basin.json")
    short = mission.model_copy(update={"waypoints": mission.waypoints[:3]})
    write_run(simulate(short, "predictive"), tmp_path / "flown")
    for source, file, run in (
        ("s.json", WHARF, False), ("run", None, True), ("flown", None, True)
    ):  # fmt: skip
        seen = read_shown(tmp_path / source, file)
        session = Session(Document(None, seen.data), 20.0, seen)
        app = application(session, "secret", 1234)
        with testclient.TestClient(app, base_url="http://127.0.0.1:1234") as made:
            headers = {"host": "127.0.0.1:1234"}
            with made.websocket_connect("/live?token=secret", headers=headers) as socket:
                state = socket.receive_json()["state"]
                assert (state["shown"], state["run"], state["error"]) == (True, run, None)
                assert socket.receive_json()["tour"]["length"] > 0
                rows = socket.receive_json()["facts"]["profile"]
                assert max(r[1] for r in rows) <= state["data"]["tether_length"]
                socket.send_json({"id": 1, "edit": {"delete": [["goals", 0]]}})
                assert "read-only" in socket.receive_json()["error"]
                for share, row in ((0.0, rows[0]), (1.0, rows[-1])):
                    socket.send_json({"id": 2, "along": share})
                    told = socket.receive_json()["along"]
                    assert told["length"] == pytest.approx(row[1], abs=1e-6)
                    assert polylines.length(np.array(told["path"])[:, :2]) <= row[1] + 0.02
                socket.send_json({"id": 3, "space": 0.5})
                space = socket.receive_json()["space"]
                assert space["data"][-1]["name"] == "tether"
            assert posted(made, WHARF).status_code == 422
    with pytest.raises(InputError, match="expected --problem"):
        read_shown(tmp_path / "s.json")
    with pytest.raises(InputError, match="folder of a run"):
        read_shown(tmp_path)


def test_the_map_in_a_notebook(tmp_path):
    problem = Problem.load(WHARF)
    with Frame(problem) as frame:
        assert frame.problem() == problem
        assert f'src="{frame.address}"' in frame._repr_html_()
        server = frame._server
        assert server.poll() is None
    assert server.poll() is not None
    broken = tmp_path / "b.json"
    broken.write_text("{")
    with pytest.raises(InputError, match="JSON"):
        Frame(broken)


@pytest.mark.skipif(not (JS / "node_modules").is_dir(), reason="npm is not installed: make js")
@pytest.mark.parametrize("check", [
    ("tsc", "-p", "tests/js"),
    ("eslint", "--config", "tests/js/eslint.config.mjs", "netsp/app/static",
     "netsp/online/guard/static"),
])  # fmt: skip
def test_the_scripts_of_the_page_pass_the_linter_and_the_type_checker(check):
    done = subprocess.run(
        [JS / "node_modules" / ".bin" / check[0], *check[1:]], cwd=ROOT, capture_output=True,
        text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


def test_a_page_that_goes_away_unread_leaves_no_traceback(tmp_path):
    """As a phone does that goes out of range while the cursor's tethers are on their way to it."""
    client = pytest.importorskip("websockets.sync.client")
    file = tmp_path / "p.json"
    file.write_text(WHARF.read_text())
    with subprocess.Popen(
        [sys.executable, "-m", "netsp", "app", str(file), "--no-browser"],
        stderr=subprocess.PIPE, text=True, cwd=ROOT,
    ) as server:  # fmt: skip
        try:
            said = itertools.takewhile(lambda line: "Ctrl-C" not in line, server.stderr)
            url = re.search(r"http://(\S+)/\?(\S+)", "".join(said))
            live = f"ws://{url[1]}/live?{url[2]}"
            for count in (300, 1500):
                with client.connect(live, max_size=None, close_timeout=0.1) as gone:
                    for k in range(count):
                        gone.send(json.dumps({"id": k, "hover": [k % 10, 3]}))
                    linger = struct.pack("ii", 1, 0)
                    gone.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
                    gone.socket.shutdown(socket.SHUT_RDWR)
            with client.connect(live, max_size=None) as other:
                other.send(json.dumps({"id": 1, "hover": [3, 3]}))
                while json.loads(other.recv(timeout=60)).get("id") != 1:
                    pass
        finally:
            server.terminate()
            text = server.stderr.read()
    assert "Traceback" not in text


@pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")
def test_the_page_in_a_browser(tmp_path):
    """Drag, draw, undo, by pointer and by key; the library agrees with what is shown."""
    playwright = pytest.importorskip("playwright.sync_api")
    file = tmp_path / "p.json"
    file.write_text(WHARF.read_text())
    with subprocess.Popen(
        [sys.executable, "-m", "netsp", "app", str(file), "--no-browser"],
        stderr=subprocess.PIPE, text=True, cwd=ROOT,
    ) as server, playwright.sync_playwright() as p:  # fmt: skip
        try:
            said = itertools.takewhile(lambda line: "Ctrl-C" not in line, server.stderr)
            url = re.search(r"http\S+", "".join(said)).group()
            browser = p.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1200, "height": 800})
            faults = []
            page.on("pageerror", lambda e: faults.append(str(e)))
            page.on("console", lambda m: faults.append(m.text) if m.type == "error" else None)
            page.goto(url)

            def wait(what, seconds=60.0):
                end = time.monotonic() + seconds
                while not what():
                    assert time.monotonic() < end, page.inner_text("#answer")
                    page.wait_for_timeout(20)

            def answer():
                return page.inner_text("#answer")

            first = f"{solve(Problem.load(file)).length:.2f} m, proven shortest by this solver"
            wait(lambda: answer() == first)
            # asked in one go: what is drawn is drawn anew whenever the server says something
            x, y = page.evaluate(
                "() => { const c = document.querySelectorAll('g.goal circle')[2]"
                ".getBoundingClientRect(); return [c.x + c.width / 2, c.y + c.height / 2]; }"
            )
            page.mouse.move(x, y)
            page.mouse.down()
            page.mouse.move(x + 40, y - 30, steps=4)
            page.mouse.up()
            wait(lambda: answer() != first and "proven" in answer())
            edited = json.loads((tmp_path / ".p.json.unsaved").read_text())
            problem = Problem.model_validate(edited)
            assert problem.goals[2] != Problem.load(WHARF).goals[2]
            assert answer() == f"{solve(problem).length:.2f} m, proven shortest by this solver"
            page.locator("#map").focus()
            page.keyboard.press("Control+z")
            wait(lambda: answer() == first)
            page.keyboard.press("c")
            page.mouse.move(300, 300)
            page.mouse.down()
            page.mouse.move(320, 300, steps=3)
            page.mouse.up()
            wait(lambda: page.locator("circle.obstacle").count() == 9)
            wait(lambda: "proven" in answer() or "reach" in answer())
            page.keyboard.press("Escape")
            page.locator("#map").focus()
            page.keyboard.press("n")
            assert page.inner_text("#where").startswith("base at")
            page.keyboard.press("n")
            assert page.inner_text("#where").startswith("goal A1 at")
            page.keyboard.press("Escape")
            page.keyboard.press("p")
            for corner in ((600, 300), (640, 300), (640, 340), (600, 300)):
                page.mouse.click(*corner)  # the first again ends it
            wait(lambda: page.locator("polygon.obstacle").count() == 1)
            page.keyboard.press("Control+z")
            wait(lambda: page.locator("polygon.obstacle").count() == 0)
            page.keyboard.press("Escape")
            page.mouse.move(500, 500)
            wait(lambda: "class" in page.inner_text("#where"))
            wait(lambda: page.locator("svg.chart").count() == 2)
            page.keyboard.press("b")
            page.mouse.move(40, 100)
            page.mouse.down()
            page.mouse.move(870, 720, steps=3)
            page.mouse.up()
            wait(lambda: page.locator("polygon.bounds").count() == 1)
            # a value that has no tour: the panel says why, while its field has the focus
            page.get_by_label("tether length (m)").fill("1")
            page.get_by_label("tether length (m)").press("Tab")
            wait(lambda: page.locator("#panel > p.bad").count() == 1)
            assert page.inner_text("#panel > p.bad") == answer()
            assert "needs" in answer()
            page.locator("#map").focus()
            page.keyboard.press("Control+z")
            wait(lambda: page.locator("#panel > p.bad").count() == 0)
            page.get_by_label("latitude (°)").fill("54.2")
            page.get_by_label("latitude (°)").press("Tab")
            assert page.inner_text("#where").endswith("the longitude is needed, too")
            page.get_by_label("longitude (°)").fill("12.1")
            page.get_by_label("longitude (°)").press("Tab")
            wait(lambda: "origin" in json.loads((tmp_path / ".p.json.unsaved").read_text()))
            assert page.inner_text("#where") == ""
            page.locator("#map").focus()
            page.keyboard.press("Control+z")
            page.keyboard.press("3")
            wait(lambda: page.get_attribute("#space", "data-drawn") == "yes")
            page.keyboard.press("3")
            page.keyboard.press("Control+z")
            page.keyboard.press("Control+s")
            wait(lambda: page.locator("#save").is_disabled())
            assert len(Problem.load(file).obstacles) == 9
            assert faults == []
            browser.close()
        finally:
            server.terminate()


def test_a_run_in_which_an_obstacle_came_onto_a_goal_is_shown(tmp_path):
    """Its site is no problem that could be solved."""
    site = Problem(base=(0, 0), goals=[(6, 2), (6, -2)], tether_length=12)
    boat = Circle(center=(6.0, -2.2), radius=0.7, name="boat")
    events = Surprises(events=(Event(time=1.0, appear=boat),))
    run = execute(site, solve(site), surprises=events)
    assert set(run.left_out) == {1}
    write_execution(run, tmp_path / "run")
    seen = read_shown(tmp_path / "run")
    session = Session(Document(None, seen.data), shown=seen)

    async def told():
        session.begin()
        return session.everything()

    assert asyncio.run(told())
