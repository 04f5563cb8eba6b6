"""The map in the browser: versions, the solver beside it, who is let in, and the page itself."""

import itertools
import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError, Problem, Solution, Tethers, solve, verify
from netsp.app.solving import Worker
from netsp.app.state import Document
from netsp.app.tethers import Cursor

testclient = pytest.importorskip("starlette.testclient")

from netsp.app.server import Session, application  # noqa: E402

ROOT = Path(__file__).parent.parent
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
    assert (said["goal"], said["needed"]) == (1, pytest.approx(50.0))
    made._process.kill()
    made._process.join()
    time.sleep(0.2)
    made.solve(101, Problem.load(WHARF).to_json())
    assert heard(box, lambda m: m["version"] == 101 and m["stage"] == "done")["length"]


def test_the_tether_at_the_cursor_is_that_of_the_class_of_the_tour():
    problem = Problem.load(WHARF)
    solution = solve(problem)
    cursor = Cursor(problem, solution.path)
    tethers = Tethers(problem)
    for visit in solution.tour:
        x, y, _ = problem.goals[visit.goal].position
        assert tuple(cursor.hover(x, y)["word"]) == visit.signature
        lengths = [c["length"] for c in cursor.classes(visit.goal)]
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
    assert "script-src 'self'" in page.headers["content-security-policy"]
    assert "'unsafe-inline'" not in page.headers["content-security-policy"]
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

            first = f"{solve(Problem.load(file)).length:.2f} m, proven shortest"
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
            assert answer() == f"{solve(problem).length:.2f} m, proven shortest"
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
            page.mouse.move(500, 500)
            wait(lambda: "word" in page.inner_text("#where"))
            page.keyboard.press("Control+s")
            wait(lambda: page.locator("#save").is_disabled())
            assert len(Problem.load(file).obstacles) == 9
            assert faults == []
            browser.close()
        finally:
            server.terminate()
