"""Claims about words and tours in space."""

from __future__ import annotations

from collections.abc import Iterator

from claims.claim import Claim


def groups() -> tuple[str, bool]:
    """What groups scenes have."""
    from space import ANCHOR, HIGH, LOW, shapes

    from netsp.plan.space.space_signature import SpaceSignature
    from netsp.world import Scene

    found = []
    for name, solids in shapes().items():
        made = SpaceSignature.in_box(Scene(solids=solids).field(), LOW, HIGH, 0.2, ANCHOR)
        found.append((name, made.group.rank, len(made.group.relators), made.exact))
    wanted = [
        ("ring", 1, 0, True), ("two rings", 2, 0, True), ("two linked rings", 2, 1, True),
        ("chain of three", 3, 2, True), ("trefoil", 2, 1, False),
        ("frame of a cube", 5, 0, True), ("pipe above the floor", 1, 0, True),
    ]  # fmt: skip
    right = sum(a == b for a, b in zip(found, wanted, strict=True))
    return f"{right} of {len(wanted)}", right == len(wanted)


def loops() -> tuple[str, bool]:
    """Words beside linking numbers, rays, and words of other cells."""
    from space import beside_cells, beside_linking, beside_rays

    rows = [beside(300) for beside in (beside_linking, beside_rays, beside_cells)]
    wrong = sum(r[3] + r[4] for r in rows)
    return f"{wrong} of {sum(r[0] for r in rows)}", wrong == 0


def tours() -> tuple[str, bool]:
    """Tours in space beside the proven shortest of the plane."""
    from space import beside_plane, prism_worlds

    worst = 0.0
    for name, problem in prism_worlds():
        if name in ("pool", "random 0", "random 3"):
            length, _, best, status, _ = beside_plane(problem, limit=15.0)
            worst = max(worst, length / best - 1.0) if status == "optimal" else float("inf")
    return f"{100 * worst:.2f} % longer", worst <= 1e-3


def uprights() -> tuple[str, bool]:
    """Tours of the plane among upright solids, driven, judged and bounded in space."""
    from space import posts_world, prism_world

    from netsp import solve
    from netsp.base.clock import Clock
    from netsp.plan.space.judge import verify_mission
    from netsp.plan.space.places import Places
    from netsp.plan.space.space_plan import candidate_plans
    from netsp.plan.space.upright import bound_by_upright_solids

    worst, gap = 0.0, 0.0
    worlds = [posts_world(seed) for seed in (2, 3)]
    worlds += [prism_world(kind, 0) for kind in ("boxes", "close pairs", "depths")]
    for problem, mission, scene in worlds:
        found = next(candidate_plans(mission, scene=scene, clock=Clock(20.0), whole_tether=True))
        verified = verify_mission(found.to_mission(), scene=scene, context=found.context)
        best = solve(problem, time_limit=20.0)
        assert best.length is not None
        proven = verified and best.status.value == "optimal"
        worst = max(worst, found.length / best.length - 1.0 if proven else float("inf"))
        places = Places.for_mission(found.mission, found.context.field)
        every = list(range(len(places)))
        bound = (
            bound_by_upright_solids(found.mission, found.context, every, places, Clock(20.0)) or 0.0
        )
        gap = max(gap, 1.0 - bound / found.length)
    good = worst <= 5e-3 and 0.0 <= gap <= 0.015
    return f"{100 * worst:.2f} % longer, gap {100 * gap:.2f} %", good


def no_worse() -> tuple[str, bool]:
    """A mission in its planned order, solved again in two seconds."""
    from sites import shipped

    from netsp.plan.space.judge import verify_mission
    from netsp.plan.space.mission_solver import seconds_until_home, solve_mission
    from netsp.world.simulator.mission_run import simulate

    mission, scene = shipped("basin")
    ordered = solve_mission(mission, scene=scene, time_limit=10.0).mission
    again = ordered.model_copy(update={"tour": None})
    found = solve_mission(again, scene=scene, time_limit=2.0)
    given, flown = (seconds_until_home(simulate(m, scene=scene)) for m in (again, found.mission))
    good = bool(verify_mission(found.mission, scene=scene)) and flown <= 1.001 * given
    return f"{flown:.1f} s home, as given {given:.1f}", good


def solved(name: str, longest: float, saved: float) -> Claim:
    """A mission or a site: metres of its tour, flown as planned, and time saved."""

    def measure() -> tuple[str, bool]:
        from sites import SITES, mission_of, shipped

        from netsp.plan.space.mission_solver import seconds_until_home, solve_mission
        from netsp.world.simulator.mission_run import simulate

        mission, scene = mission_of(name) if name in SITES else shipped(name)
        found = solve_mission(mission, scene=scene)
        run = found.run or simulate(found.mission, scene=scene)
        given = found.given or simulate(mission, scene=scene)
        less = 100.0 * (1.0 - seconds_until_home(run) / seconds_until_home(given))
        s, length = run.summary, found.tour.length
        safe = s["exceedance_s"] == 0.0 and s["visited"] == s["waypoints"]
        good = safe and s["home"]["tether_free"] and length <= longest and less >= saved
        shown = f"{length:.1f} m, {less:.0f} % less, over {s['exceedance_s']:.1f} s"
        return shown, good

    return Claim(f"solve: {name}", f"{longest:g} m; {saved:g} % less; safe, all, free", measure)


def seen(name: str) -> Claim:
    """The fewest waypoints that see a site, flown as they are written."""

    def measure() -> tuple[str, bool]:
        import cover as bench
        from sites import mission_of

        from netsp.plan.cover import cover
        from netsp.world.simulator.mission_run import simulate

        mission, scene = mission_of(name)
        found = cover(
            scene, anchor=mission.anchor, start=mission.start, objective="viewpoints",
            **bench.CAMERA,
        )  # fmt: skip
        s = simulate(found.mission, scene=scene).summary
        share = 100.0 * s["coverage"] / found.visible
        more = 100.0 * (len(found.viewpoints) / found.bound - 1.0)
        safe = s["exceedance_s"] == 0.0 and s["visited"] == s["waypoints"]
        shown = f"{share:.1f} % of the visible, {more:.0f} % above the bound"
        return shown, safe and share >= 99.0 and more <= 15.0

    return Claim(f"cover: {name}", "99 % of the visible; 15 %; safe", measure)


def together(name: str) -> Claim:
    """Seconds that viewpoints chosen with their tour save against the fewest, both flown."""

    def measure() -> tuple[str, bool]:
        import cover as bench
        from sites import mission_of

        from netsp.plan.cover import cover
        from netsp.plan.space.mission_solver import seconds_until_home
        from netsp.world.simulator.mission_run import simulate

        mission, scene = mission_of(name)
        how = {"anchor": mission.anchor, "start": mission.start, "speed": mission.speed}
        how |= bench.CAMERA
        fewest = cover(scene, objective="viewpoints", **how)
        found = cover(scene, tether_length=fewest.mission.tether_length, **how)
        runs = [simulate(chosen.mission, scene=scene) for chosen in (fewest, found)]
        less = 100.0 * (1.0 - seconds_until_home(runs[1]) / seconds_until_home(runs[0]))
        s = runs[1].summary
        share = 100.0 * s["coverage"] / found.visible
        safe = s["exceedance_s"] == 0.0 and s["visited"] == s["waypoints"]
        shown = f"{less:.0f} % less, {share:.1f} % of the visible"
        return shown, safe and s["home"]["tether_free"] and less >= 10.0 and share >= 99.0

    return Claim(f"cover together: {name}", "10 % less time; 99 % of the visible; safe", measure)


def mended() -> tuple[str, bool]:
    """A solid on a leg of the tour, one flight for every second leg."""
    import numpy as np
    from sites import mission_of

    from netsp.base.geometry import polylines
    from netsp.plan.space.space_plan import plan
    from netsp.world.simulator.mission_run import simulate
    from netsp.world.simulator.surprises import SceneSurprises

    mission, scene = mission_of("ring")
    planned = plan(mission, scene=scene).to_mission()
    safe = flights = 0
    for stop in planned.tour.stops[::2]:
        leg = np.array(stop.path)
        if polylines.length(leg) < 1.0:
            continue
        middle = polylines.points_along(leg, 0.5 * polylines.length(leg))[1].tolist()
        solid = {"sphere": {"center": middle, "radius": 0.2}}
        events = [{"time": 1.0, "appear": solid}]
        surprises = SceneSurprises.model_validate({"schema_version": 1, "events": events})
        s = simulate(planned, "repair", scene=scene, surprises=surprises).summary
        flights += 1
        safe += (
            s["visited"] == s["waypoints"] and s["home"]["tether_free"]
            and s["exceedance_s"] == 0.0 and s["contacts"] == 0
            and s["repairs"][0]["response"] != "kept"
        )  # fmt: skip
    return f"{safe} of {flights} safe, all, free", safe == flights > 0


def near_the_bound() -> tuple[str, bool]:
    """A frame of bars with free ends, whose shortest tour leaves the tether on one of them but for
    a detour."""
    from space import random_frame

    from netsp.plan.space.mission_solver import solve_mission

    mission, scene = random_frame(1)
    found = solve_mission(mission, scene=scene)
    assert found.run is not None
    s, gap = found.run.summary, found.tour.gap_to_all
    safe = s["exceedance_s"] == 0.0 and s["visited"] == s["waypoints"]
    good = safe and s["home"]["tether_free"] and gap is not None and gap <= 0.05
    return f"gap {100 * (1.0 if gap is None else gap):.1f} %", good


def bounds() -> tuple[str, bool]:
    """Bounds on all tours beside tours through slots that are known in closed form."""
    import numpy as np
    from slots import bound_only, slot_scene

    rng, above = np.random.default_rng(0), 0
    for _ in range(2):
        mission, scene, exists = slot_scene(rng)
        above += bound_only(mission, scene) > exists * (1.0 + 1e-6)
    return f"{above} of 2 above", above == 0


def law() -> tuple[str, bool]:
    """Bounds beside paths and tours that were found without netsp, in a few random scenes."""
    import tempfile
    from pathlib import Path

    from one_corner_paths import compare

    kinds = (
        "posts", "end near the surface", "uprights and more", "rings", "cube frames", "jackets",
        "pipes", "walls with slots", "combs", "boulders", "tunnels",
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        found = [compare(kind, 11, Path(folder)) for kind in kinds]
    compared = [c for c in found if c is not None]
    above, legs = sum(c.above for c in compared), sum(c.legs for c in compared)
    shown = f"{above} above {legs} paths and {len(compared)} tours"
    return shown, above == 0 and len(compared) >= 9


def under_way() -> tuple[str, bool]:
    """Random runs in which something happens, judged by a string of the benchmark's own."""
    from under_way import fly, judged

    runs = [("anchor", 9), ("sensor", 9), ("surprises", 9), ("repair", 10)]
    verdicts = [judged(fly(*run)) for run in runs]
    faults = [fault for verdict in verdicts for fault in verdict.faults]
    free = sum(verdict.is_free for verdict in verdicts)
    return f"{free} of {len(runs)} home and free, {len(faults)} faults", free == 4 and not faults


def spoiled_meshes() -> tuple[str, bool]:
    """A scan with holes that is inside out, a soup of faces and an open disc, each looked at from
    one place, beside the share of a cap of a ball and one side of two."""
    import tempfile
    from pathlib import Path

    import numpy as np
    import trimesh
    from meshes import spoiled

    from netsp.world import Scene
    from netsp.world.mission.equipment import Camera
    from netsp.world.simulator.coverage import Coverage, surface_patches

    ball = trimesh.creation.icosphere(subdivisions=4, radius=2.0)
    middles = np.asarray(ball.triangles_center)
    behind = np.array([[-2.0, 0, 0], [-1.2, 1.6, 0], [-1.2, 0, 1.6]])
    holes = np.linalg.norm(middles[:, None] - behind, axis=2).min(axis=1) < 0.3
    triangles = np.asarray(ball.triangles)
    disc = trimesh.creation.cylinder(2.0, 1.0, sections=64)
    disc_faces = np.asarray(disc.triangles)[np.asarray(disc.face_normals)[:, 2] > 0.9]
    eye = np.array([5.0, 0.0, 0.0])
    cap = 2.0 * np.pi * 2.0**2 * (1.0 - 2.0 / eye[0])
    cases = [
        (spoiled(triangles[~holes], "inverted"), cap),
        (spoiled(triangles, "soup"), cap),
        (disc_faces[..., [2, 1, 0]], None),
    ]
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.stl"
        for case, seen in cases:
            faces = np.arange(3 * len(case)).reshape(-1, 3)
            trimesh.Trimesh(case.reshape(-1, 3), faces, process=False).export(path)
            scene = Scene.model_validate({"mesh": {"file": str(path), "voxel": 0.05}})
            field, camera = scene.field(), Camera(range=10.0, field_of_view=120.0, patch=0.15)
            patches = surface_patches(scene, field, 0.15, eye[None], clearance=0.3)
            coverage = Coverage(patches, field, camera)
            coverage.look(eye, np.pi)
            u, v = case[:, 1] - case[:, 0], case[:, 2] - case[:, 0]
            area = 0.5 * np.linalg.norm(np.cross(u, v), axis=1).sum()
            expected = 0.5 if seen is None else seen / area
            worst = max(worst, abs(coverage.share - expected))
    return f"{100 * worst:.1f} points", bool(worst <= 0.02)


def hanging() -> tuple[str, bool]:
    """Recorded cables of the physics engine beside the bracket of the tether."""
    import numpy as np
    from cable import SHORT, beyond, bracket_of, recorded_flights

    at_stops, on_legs, count = 0.0, 0.0, 0
    for flight in recorded_flights():
        if flight["scene"] == "hull":
            continue  # cables are known to leave the bracket there (docs/notebook/tether)
        bracket = bracket_of(flight, has_words=False)
        is_stop = np.isin(np.arange(len(bracket.taut)), flight["stops"])
        for cable in flight["cables"].values():
            for places in (is_stop, ~is_stop):
                worst = max(beyond(bracket, np.array(cable), places & (bracket.taut > SHORT)))
                if places is is_stop:
                    at_stops = max(at_stops, worst)
                else:
                    on_legs = max(on_legs, worst)
            count += 1
    shown = f"{100 * at_stops:.1f} % at visits, {100 * on_legs:.1f} % on legs, {count} cables"
    return shown, at_stops <= 0.005 and on_legs <= 0.05 and count > 0


def claims() -> Iterator[Claim]:
    """All of this file."""
    yield Claim("words: groups of seven scenes", "as known", groups)
    yield Claim("words: 900 loops beside a second invariant", "no disagreement", loops)
    yield Claim(
        "tours in space: five worlds of upright solids", "0.5 % longer; gap of 1.5 %", uprights
    )
    yield Claim("solve: a planned order again, in 2 s", "no worse; verified", no_worse)
    yield Claim("bounds in space: walls with slots", "none above a known tour", bounds)
    yield Claim("bounds in space: random scenes of eleven kinds", "none above a path or tour", law)
    yield Claim("meshes: holes, inside out, a soup, a sheet", "2 points", spoiled_meshes)
    yield Claim(
        "hanging tethers: ring, comb, frame", "within 0.5 % at visits, 5 % on legs", hanging
    )
    yield solved("basin", 33.0, 25.0)
    yield solved("ring", 46.0, 15.0)
    yield solved("hull", 80.0, 35.0)
    yield seen("ring")
    yield together("linked rings")
    yield Claim("repair: a solid on every second leg about the ring", "safe, all, free", mended)
    yield Claim(
        "under way: anchor, range sensor, surprises, repair", "home, free, never over", under_way
    )
    yield Claim("solve: a frame of bars", "gap of 5 %; safe, all, free", near_the_bound)
    yield Claim("tours in space: three problems of the plane", "within 0.1 % of it", tours)
