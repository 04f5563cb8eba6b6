"""Modules that have moved: their old names work for one release, with a DeprecationWarning."""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import sys
import warnings
from collections.abc import Sequence
from types import ModuleType

MOVED = {
    "anneal.rss2016": "plan.rss2016",
    "app.files": "app.served_files",
    "app.frame": "app.view_box",
    "app.space": "app.space_preview",
    "app.tethers": "app.dragged_tethers",
    "arrangement": "model.arrangement",
    "arrays": "base.arrays",
    "axes": "base.axes",
    "clock": "base.clock",
    "command.clearance_flags": "command.clearance_warning",
    "command.progress": "command.progress_table",
    "command.told": "command.json_output",
    "compare": "study.compare",
    "compare.run": "study.compare.study_run",
    "compiled": "base.compiled",
    "compiled.chance": "base.compiled.rng",
    "compiled.growing": "base.compiled.dynamic_array",
    "compiled.slots": "base.compiled.hash_map",
    "cover": "plan.cover",
    "cover.alternatives": "plan.cover.viewpoint_swaps",
    "cover.plan": "plan.cover.cover_plan",
    "dp": "gtsp.dp",
    "dp.labels": "gtsp.dp.label_kernels",
    "dp.memory": "gtsp.dp.ng_sets",
    "dp.solve": "gtsp.dp.dp_solver",
    "drawn": "base.reprs",
    "errors": "base.errors",
    "execute": "online.execute",
    "execute.aside": "online.execute.detour_around",
    "execute.log": "online.execute.execution_log",
    "execute.passing": "online.execute.temporary_obstacles",
    "execute.plan": "plan.tour_plan",
    "execute.ready": "online.execute.repair_warm_up",
    "execute.repair": "online.execute.tour_repair",
    "execute.run": "online.execute.tour_execution",
    "execute.write": "online.execute.execution_files",
    "export": "exchange.missions",
    "export.margins": "exchange.missions.export_margins",
    "export.mission": "exchange.missions.mission_export",
    "export.write": "exchange.missions.mission_files",
    "fields": "base.field_types",
    "files": "base.files",
    "fly": "online.fly",
    "fly.checks": "online.fly.preflight_checks",
    "fly.flight": "online.fly.tour_flight",
    "fly.rehearsal": "online.fly.flight_rehearsal",
    "frames": "base.data_frames",
    "geometry": "base.geometry",
    "greedy": "gtsp.greedy",
    "gtsplib": "gtsp.gtsplib",
    "gtsplib.read": "gtsp.gtsplib.gtsp_file",
    "gtsplib.tour": "gtsp.gtsplib.tour_file",
    "greedy.blind": "plan.greedy_blind",
    "gtsp.greedy.blind": "plan.greedy_blind",
    "gtsp.travel.choices": "roadmap.goal_choices",
    "gtsp.travel.graph": "roadmap.travel_graph",
    "gtsp.travel.leg_provider": "roadmap.leg_provider",
    "gtsp.travel.tether_blind_legs": "roadmap.tether_blind_legs",
    "guard": "online.guard",
    "guard.ahead": "online.guard.lookahead",
    "guard.fix": "online.guard.telemetry",
    "guard.gaps": "online.guard.dropout",
    "guard.guard": "online.guard.tether_guard",
    "guard.leaps": "online.guard.skip_free_water",
    "guard.memory": "online.guard.state_file",
    "guard.page": "online.guard.guard_page",
    "guard.rehearsal": "online.guard.guard_rehearsal",
    "guard.report": "online.guard.guard_report",
    "guard.sites": "online.guard.site_files",
    "guard.space": "online.guard.space_site",
    "guard.tethers": "online.guard.tether_belief",
    "guard.track": "online.guard.position_track",
    "hsignature.measures": "hsignature.signature_measures",
    "hsignature.signature": "hsignature.signature_protocol",
    "import_record": "model.import_record",
    "judge.checks": "judge.tour_checks",
    "judge.solids": "judge.solid_distances",
    "library": "study.library",
    "link": "online.link",
    "link.frame": "online.link.geo_frame",
    "link.messages": "online.link.mavlink_messages",
    "lns": "gtsp.search",
    "lns.search": "gtsp.search.local_search",
    "lns.solve": "gtsp.search.lns_solver",
    "lower_bound": "model.bound_scope",
    "memory": "base.ram",
    "mip.bound": "mip.lagrangian_bound",
    "mip.overcells": "mip.cover_bounds",
    "mip.overgoals": "mip.goal_relaxation",
    "mip.pace": "mip.pricing_schedule",
    "mip.parities": "mip.parity_cuts",
    "mip.quiet": "mip.highs_runner",
    "mip.solve": "mip.mip_solver",
    "mip.splits": "mip.cover_refinement",
    "mip.survivors": "mip.cost_fixing",
    "mip.towers": "mip.cover_costs",
    "mip.warm": "mip.lp_warm_start",
    "mip.ways": "mip.parity_paths",
    "models": "base.validated",
    "number_ranges": "base.number_ranges",
    "online.coverage": "world.simulator.coverage",
    "online.equipment": "world.mission.equipment",
    "online.laid": "world.simulator.laid_tether",
    "online.limits": "world.mission.mission_limits",
    "online.log": "world.mission.run_log",
    "online.mission": "world.mission.mission",
    "online.paths": "world.paths",
    "online.paths.beside": "world.paths.standoff",
    "online.planner": "world.planner",
    "online.planner.ahead": "world.planner.preview",
    "online.planner.base": "world.planner.planner",
    "online.planner.react": "world.planner.react_planner",
    "online.ranging": "world.simulator.ranging",
    "online.scene": "world.scene",
    "online.sensing": "world.simulator.sensing",
    "online.simulate": "world.simulator.mission_run",
    "online.simulation": "world.simulator.simulation",
    "online.stalls": "world.simulator.stalls",
    "online.summary": "world.simulator.summary",
    "online.surprises": "world.simulator.surprises",
    "online.surroundings": "world.simulator.surroundings",
    "online.tether": "world.tether",
    "online.tether.react": "world.tether.react_tether",
    "online.tether.tether": "world.tether.taut_tether",
    "online.tour": "world.mission.planned_tour",
    "online.track": "world.mission.anchor_track",
    "online.vehicle": "world.vehicle",
    "online.water": "world.simulator.current",
    "pathmeasures": "study.paths",
    "pictures": "view.pictures",
    "pictures.cover": "view.pictures.cover_picture",
    "pictures.graph": "view.pictures.graph_picture",
    "pictures.gtsp": "view.pictures.gtsp_picture",
    "pictures.mission": "view.pictures.mission_picture",
    "pictures.problem": "view.pictures.problem_picture",
    "pictures.scene": "view.pictures.scene_picture",
    "problem": "model.problem",
    "registry": "base.registry",
    "report": "view.report",
    "report.beside": "view.report.side_by_side_page",
    "report.log": "view.report.run_page",
    "report.mission": "view.report.mission_page",
    "report.tour": "view.report.tour_page",
    "report.wording": "world.side_names",
    "roadmap.alternatives": "roadmap.class_alternatives",
    "roadmap.detours": "roadmap.any_class_paths",
    "roadmap.legs": "roadmap.taut_legs",
    "roadmap.pulled": "roadmap.taut_by_word",
    "roadmap.reach": "roadmap.explain_unreachable",
    "roadmap.tethers": "roadmap.tether_classes",
    "roadmap.ways": "roadmap.reach_bounds",
    "roadmap.within_reach": "roadmap.reachable_goals",
    "shorthand": "model.shorthand",
    "site": "exchange.maps",
    "site.read": "exchange.maps.site_import",
    "site.shapes": "exchange.maps.drawn_shapes",
    "site.table": "exchange.maps.csv_table",
    "sizing": "plan.sizing",
    "sizing.base": "plan.sizing.base_placement",
    "sizing.margins": "plan.sizing.tether_margins",
    "sizing.tether": "plan.sizing.tether_sizing",
    "solution": "model.solution",
    "solvers": "plan",
    "solvers.carried": "plan.tether_carry_columns",
    "solvers.solve": "plan.solve_problem",
    "solvers.table": "plan.solver_table",
    "solvers.warm": "plan.warm_start",
    "solving": "gtsp",
    "solving.beside": "gtsp.neighbourhood",
    "solving.legcosts": "gtsp.cost_matrix",
    "solving.legrows": "gtsp.sparse_costs",
    "solving.nearrows": "gtsp.nearest_index",
    "solving.run": "gtsp.solver_run",
    "space": "plan.space",
    "space.beside": "plan.space.detour_variants",
    "space.bound": "plan.space.path_bound",
    "space.detours": "plan.space.non_taut_moves",
    "space.labels": "plan.space.triangle_labels",
    "space.legs": "plan.space.space_legs",
    "space.measures": "plan.space.mission_measures",
    "space.order": "plan.space.visit_order",
    "space.plan": "plan.space.space_plan",
    "space.repair": "online.execute.mission_repair",
    "space.search": "plan.space.word_search",
    "space.signature": "plan.space.space_signature",
    "space.solve": "plan.space.mission_solver",
    "space.water": "plan.space.planning_context",
    "steps": "base.progress",
    "travel": "gtsp.travel",
    "travel.choices": "roadmap.goal_choices",
    "travel.detours": "roadmap.tether_blind_legs",
    "travel.graph": "roadmap.travel_graph",
    "travel.legs": "roadmap.leg_provider",
    "travel.ways": "gtsp.travel.parity_distances",
    "worlds": "plan.random_worlds",
}
"""Old and new names of modules and packages below `netsp`; the longest name decides."""


def new_name(module: str) -> str | None:
    """Return the new name of a module that has moved, or None if it has not.

    Examples
    --------
    >>> new_name("netsp.site.contract")
    'netsp.exchange.maps.contract'
    """
    parts = module.split(".")
    for k in range(len(parts), 1, -1):
        new = MOVED.get(".".join(parts[1:k]))
        if parts[0] == "netsp" and new is not None:
            return ".".join(["netsp", new, *parts[k:]])
    return None


class MovedModules(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finder that imports a moved module under its new name and binds it under the old one."""

    def __init__(self) -> None:
        self._specs: dict[str, importlib.machinery.ModuleSpec | None] = {}

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return a spec for a module that has moved."""
        if not fullname.startswith("netsp.") or new_name(fullname) is None:
            return None
        return importlib.machinery.ModuleSpec(fullname, self)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType:
        """Return the module in its new place."""
        new = new_name(spec.name)
        assert new is not None
        warnings.warn(f"{spec.name} is now {new}", DeprecationWarning, stacklevel=2)
        module = importlib.import_module(new)
        self._specs[spec.name] = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Give the module its own spec again, which the import system has replaced."""
        assert module.__spec__ is not None
        module.__spec__ = self._specs.pop(module.__spec__.name)


def install() -> None:
    """Let the import system find moved modules before it searches in their new packages."""
    if not any(isinstance(finder, MovedModules) for finder in sys.meta_path):
        sys.meta_path.insert(0, MovedModules())
