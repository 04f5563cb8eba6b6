"""A document, its solver, and the pages that show it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from netsp.app.app_policy import AppPolicy
from netsp.app.dragged_tethers import Cursor
from netsp.app.drawn_path import drawn_figures, drawn_points, end_tether, worth_of_order
from netsp.app.facts import facts
from netsp.app.served_files import bare_name, import_warnings
from netsp.app.shown import Shown
from netsp.app.solving import Worker
from netsp.app.state import Document
from netsp.base.errors import InputError, NetspError
from netsp.base.field_types import checked_argument, is_index
from netsp.base.validated import shown
from netsp.model.problem import Problem

MAX_MESSAGE_ID = 2**53 - 1
"""Format: largest id of a message, the largest whole number that JavaScript holds exactly."""


class Session:
    """A document, its solver, and the pages that show it.

    Parameters
    ----------
    document : Document
        Document that is edited.
    time_limit : float
        Seconds of solving for one version.
    shown : Shown, optional
        Read-only contents; nothing is edited or solved then.
    notes : sequence of str
        Notes of the import, if the document comes from a map: assumptions, changes, omissions.
    policy : AppPolicy
        Limits of what the pages send, and how much they show.
    """

    def __init__(
        self,
        document: Document,
        time_limit: float = 60.0,
        shown: Shown | None = None,
        notes: Sequence[str] = (),
        policy: AppPolicy = AppPolicy(),
    ) -> None:
        self.document, self.shown, self.policy = document, shown, policy
        self._notes = {_source(document.data): list(notes)}
        self.pages: set[asyncio.Queue[str]] = set()
        self.answer: dict[str, Any] | None = None
        self.solution: str | None = None
        self.facts: dict[str, Any] | None = None
        self.drawn: list[list[float]] = []
        self._cursor: Cursor | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._worker = (
            Worker(self._on_solver_message, time_limit, policy) if shown is None else None
        )

    def begin(self) -> None:
        """Start the session; call it within the running event loop."""
        self._loop = asyncio.get_running_loop()
        if self.shown is None:
            self._changed()
            return
        self.answer = self.shown.answer
        if self.shown.solution is not None:
            problem = self.shown.problem()
            self.solution = self.shown.solution.to_json()
            self._cursor = Cursor(problem, self.shown.solution.path, self.policy)
            if not self.shown.frames:
                self.facts = facts(problem, self.shown.solution, policy=self.policy)
        if self.shown.frames:
            self.facts = self.shown.facts()

    def close(self) -> None:
        """End the solver."""
        if self._worker is not None:
            self._worker.close()

    def everything(self) -> list[dict[str, Any]]:
        """Return the messages that a newly opened page needs."""
        messages = [self._state()]
        if self.answer is not None:
            messages.append({"tour": self.answer})
        if self.facts is not None:
            messages.append({"facts": self.facts})
        if self.drawn:
            messages.append({"drawn_points": self.drawn})
        return messages

    def tell(self, message: Mapping[str, Any]) -> None:
        """Send a message to all pages."""
        text = json.dumps(message, allow_nan=False)
        for page in self.pages:
            page.put_nowait(text)

    def answer_to(self, message: Mapping[str, Any]) -> dict[str, Any] | None:
        """Carry out a message, and return the answer to its page alone, or None."""
        number = message.get("id")
        if number is not None and not is_index(number, MAX_MESSAGE_ID + 1):
            return {"id": None, "error": f"id: expected a whole number, got {shown(number)}"}
        try:
            answer = self.do(message)
        except NetspError as error:
            return {"id": number, "error": str(error).removeprefix("problem: ")}
        return None if answer is None and number is None else {"id": number, **(answer or {})}

    def do(self, message: Mapping[str, Any]) -> dict[str, Any] | None:
        """Carry out a message.

        Parameters
        ----------
        message : mapping
            One of ``edit``, ``undo``, ``redo``, ``save``, ``hover``, ``along``, ``classes``,
            ``space``, ``drawn`` and ``order`` with its value.

        Returns
        -------
        dict or None
            Answer to the sender; None if all pages get the result instead.

        Raises
        ------
        InputError
            Unknown message or wrong value; nothing is changed.
        """
        document = self.document
        if self.shown is not None and any(k in message for k in ("edit", "undo", "redo", "save")):
            raise InputError("this page is read-only")
        if "edit" in message:
            document.apply(message["edit"])
            self._changed()
        elif "undo" in message:
            if document.undo():
                self._changed()
        elif "redo" in message:
            if document.redo():
                self._changed()
        elif "save" in message:
            document.save(self._target(message["save"]))
            self.tell(self._state())
        elif "hover" in message:
            x, y = _numbers(message["hover"], 2)
            return {"hover": self._cursor.hover(x, y) if self._cursor else None}
        elif "along" in message:
            (share,) = _numbers([message["along"]], 1)
            return {"along": self._along(share)}
        elif "classes" in message:
            return self._classes(message["classes"])
        elif "space" in message:
            (share,) = _numbers([message["space"]], 1)
            return {"space": self._space(share)}
        elif "drawn" in message:
            return {"drawn": self._figures_of_drawn(message)}
        elif "order" in message:
            return {"worth": worth_of_order(self._problem(), message["order"], self.policy)}
        else:
            raise InputError(
                "message: expected edit, undo, redo, save, hover, along, classes, space, drawn or "
                "order"
            )
        return None

    def take_in(self, data: Mapping[str, Any], notes: Sequence[str]) -> list[str]:
        """Replace the document by an imported problem, as a new version.

        Parameters
        ----------
        data : mapping
            Problem, in the format of problem files.
        notes : sequence of str
            Notes of the import; shown while this problem is on the map.

        Returns
        -------
        list of str
            Warnings about the problem, one line each.
        """
        self._notes[_source(data)] = list(notes)
        self.do({"edit": {"replace": data}})
        return import_warnings(self.document.problem())

    def _problem(self) -> Problem:
        return self.document.problem() if self.shown is None else self.shown.problem()

    def _figures_of_drawn(self, message: Mapping[str, Any]) -> dict[str, Any] | None:
        """Keep the drawn path and measure it; with a cursor, measure the path up to the cursor and
        keep the path before."""
        points = drawn_points(message["drawn"], self.policy)
        if message.get("cursor") is not None:
            points = [*points, _numbers(message["cursor"], 2)]
        else:
            self.drawn = points
            # a page ignores the echo of its own drawing, which may be older than its present state
            author = str(message.get("by"))[: self.policy.max_page_name]
            self.tell({"drawn_points": points, "by": author})
        figures = drawn_figures(self._problem(), points)
        if figures is not None and self._cursor is not None:
            figures["tether"] = end_tether(self._cursor.tethers, points, figures)
        return figures

    def _target(self, name: object) -> Path | None:
        """Return the path to save to: in the opened folder, and over no other file."""
        if name is True:
            return None
        if not isinstance(name, str):
            raise InputError(f"save: expected the name of a file, got {shown(name)}")
        name = bare_name(name, self.policy)
        opened = self.document.file
        target = (opened.parent if opened is not None else Path()) / (
            name if name.endswith(".json") else f"{name}.json"
        )
        if target.exists() and (
            opened is None or not opened.exists() or not os.path.samefile(target, opened)
        ):
            raise InputError(f"save: {target.name} exists already; expected another name")
        return target

    def _along(self, share: float) -> dict[str, Any] | None:
        if self.shown is not None and self.shown.frames:
            return self.shown.along(share)
        return self._cursor.along(share) if self._cursor else None

    def _space(self, share: float) -> dict[str, Any]:
        """Return solids, path and tether in space, as a plotly figure."""
        from netsp.app.space_preview import figure

        answer = self._along(share) or {}
        if self.shown is not None:
            nodes = answer.get("path") or []
            return figure(
                self.shown.scene,
                self.shown.data,
                self.shown.answer["path"],
                nodes if self.shown.frames else _in_space(answer),
            )
        from netsp.world.scene.scene import scene_of

        path = (self.answer or {}).get("path", [])
        problem = self.document.problem()
        data = json.loads(problem.to_json())
        return figure(scene_of(problem), data, path, _in_space(answer))

    def _classes(self, goal: object) -> dict[str, Any]:
        if self._cursor is None:
            return {"classes": [], "count": 0}
        if not is_index(goal, len(self._cursor.problem.goals)):
            raise InputError("classes: expected the number of a goal")
        return self._cursor.classes(goal)

    def _state(self) -> dict[str, Any]:
        document = self.document
        complaint = document.complaint() if self.shown is None else None
        notes = list(self._notes.get(_source(document.data), []))
        if self.shown is None and complaint is None:
            notes += import_warnings(document.problem())
        return {
            "state": {
                "version": document.version,
                "data": document.data,
                "error": complaint,
                "undo": document.can_undo,
                "redo": document.can_redo,
                "notes": notes,
                "saved": document.saved,
                "file": document.file.name if document.file else None,
                "shown": self.shown is not None,
                "events": self.shown.events if self.shown is not None else [],
                "run": self.shown is not None and bool(self.shown.frames),
                "plan": self.shown is None or self.shown.solution is not None,
            }
        }

    def _changed(self) -> None:
        """Send the edited document to all pages, and start the solver again."""
        self.tell(self._state())
        self._cursor = self.facts = None
        try:
            problem = self.document.problem()
        except InputError:
            return
        self._cursor = Cursor(problem, policy=self.policy)
        assert self._worker is not None
        self._worker.solve(self.document.version, problem.to_json())

    def _on_solver_message(self, answer_message: dict[str, Any]) -> None:
        """Pass on a message that the thread of the solver has received."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the server is going down
                self._loop.call_soon_threadsafe(self._apply_solver_message, answer_message)

    def _apply_solver_message(self, answer_message: dict[str, Any]) -> None:
        if answer_message["version"] != self.document.version:
            return
        if "facts" in answer_message:
            self.facts = answer_message["facts"]
            self.tell({"facts": self.facts})
            return
        self.solution = answer_message.pop("solution", None)
        self.answer = answer_message
        if self._cursor is not None and "path" in answer_message:
            self._cursor.follow(answer_message["path"])
        self.tell({"tour": answer_message})


def _in_space(answer: Mapping[str, Any]) -> list[list[float]]:
    """Return the taut tether of an answer in the plane, with heights in proportion to its
    length."""
    import numpy as np

    from netsp.base.geometry import polylines

    flat = np.array(answer.get("path") or [], dtype=float).reshape(-1, 2)
    if len(flat) < 2:
        return []
    s = polylines.along(flat)
    low, high = answer.get("base_z", 0.0), answer.get("z", 0.0)
    rise = low + (high - low) * (s / s[-1] if s[-1] else s)
    return np.column_stack([flat, rise]).round(4).tolist()  # type: ignore[no-any-return]


def _numbers(values: object, count: int) -> list[float]:
    """Return a number of finite numbers of a message."""
    if not isinstance(values, list) or len(values) != count:
        raise InputError(f"message: expected {count} numbers, got {shown(values)}")
    return [checked_argument("message", v, -1e12) for v in values]


def _source(data: Mapping[str, Any]) -> str:
    """Return the import record of a document as text, which identifies the import."""
    site = data.get("site")
    same_site = {k: v for k, v in site.items() if k != "edited"} if isinstance(site, dict) else None
    return json.dumps(same_site, sort_keys=True)
