"""Edited problem in the format of problem files, with every version; independent of the web.

A version may break the format while somebody is at it: it is kept as it is, with what is wrong, and
only versions that are problems are solved.
"""

from __future__ import annotations

import copy
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from netsp.app.app_policy import AppPolicy
from netsp.base.errors import InputError
from netsp.base.files import read_text, write_text
from netsp.base.validated import parse_json_object, read_model, shown
from netsp.model.problem import Problem

EMPTY: dict[str, Any] = {
    "schema_version": 1,
    "name": "new",
    "base": [0.0, 0.0, 0.0],
    "goals": [],
    "obstacles": [],
    "tether_length": 50.0,
    "clearance": 0.3,
    "units": "m",
}
"""A map with nothing on it but the base."""

LISTS = ("goals", "obstacles")

MAPPED = ("base", "bounds", *LISTS)
"""Fields that an import takes from a map; editing one sets `site.edited`."""


class Document:
    """A problem that is being edited.

    Parameters
    ----------
    file : str or Path, optional
        Problem file that it is saved to; what was edited and not saved is kept beside it.
    data : mapping, optional
        Problem, in the format of problem files; default: that of the file, or an empty map.
    policy : AppPolicy
        Number of versions that are kept. They share what did not change.

    Attributes
    ----------
    version : int
        Number of changes so far, undo and redo included.
    """

    def __init__(
        self,
        file: str | Path | None = None,
        data: Mapping[str, Any] | None = None,
        policy: AppPolicy = AppPolicy(),
    ) -> None:
        self._policy = policy
        self.file = None if file is None else Path(file)
        self.version = 0
        if data is None:
            data = EMPTY
            if self.file is not None:
                named = {**EMPTY, "name": self.file.stem}
                data = _read(self.file) if self.file.exists() else named
        self._versions: list[dict[str, Any]] = [dict(data)]
        self._index = 0
        self._merging: str | None = None
        self._saved = self._versions[0]
        if (unsaved := self._unsaved()) is not None:
            self._push(unsaved)

    @property
    def data(self) -> dict[str, Any]:
        """The present version, as a problem file has it; not to be changed."""
        return self._versions[self._index]

    @property
    def saved(self) -> bool:
        """True if the file holds the current version."""
        return self.data == self._saved

    def problem(self) -> Problem:
        """Return the current version as a problem.

        Raises
        ------
        InputError
            The version is not a problem; the message says why.
        """
        if not self.data.get("goals"):
            raise InputError("there is no goal yet")
        return read_model(Problem, json.dumps(self.data), "problem")

    def complaint(self) -> str | None:
        """Return the error of the current version in one line, or None if it is a valid problem."""
        try:
            self.problem()
        except InputError as error:
            return str(error).removeprefix("problem: ")
        return None

    def apply(self, edit: Mapping[str, Any]) -> None:
        """Make a new version.

        Parameters
        ----------
        edit : mapping
            ``{"set": path, "value": v}``, ``{"add": "goals", "value": v}``, ``{"delete": [path]}``,
            or ``{"replace": data}``; a path is a field, or a list's name, an index and perhaps a
            field. With ``"merge": n`` it takes the place of the version before if that came of an
            edit of the same path with the same n, so that one undo reverts a whole drag of a
            slider.

        Raises
        ------
        InputError
            The edit is none of these; nothing is changed.
        """
        if not isinstance(edit, Mapping):
            raise InputError(f"edit: expected an object, got {shown(edit)}")
        try:
            data = self._edited(edit)
            json.dumps(data, allow_nan=False)
            key = json.dumps([edit.get("set"), edit["merge"]]) if edit.get("merge") else None
        except (TypeError, ValueError):
            raise InputError("edit: expected finite numbers") from None
        except RecursionError:  # also from copying, which needs a deeper stack than reading
            raise InputError("edit: nested too deeply") from None
        if key is not None and key == self._merging:
            self._write_unsaved(data)
            self._versions[self._index] = data
            self.version += 1
        else:
            self._push(data)
        self._merging = key

    def _edited(self, edit: Mapping[str, Any]) -> dict[str, Any]:
        """Return the present version with an edit done."""
        data = dict(self.data)  # an edit copies only the parts that it changes
        value = copy.deepcopy(edit.get("value"))
        if "set" in edit:
            _set(data, edit["set"], value)
        elif "add" in edit:
            _list(data, edit["add"]).append(value)
        elif "delete" in edit:
            _delete(data, edit["delete"])
        elif isinstance(edit.get("replace"), dict):
            data = copy.deepcopy(dict(edit["replace"]))
            _check_fields(data)
        else:
            raise InputError(f"edit: expected set, add, delete or replace, got {shown(edit)}")
        _check_lists(data)
        site = data.get("site")
        is_changed = any(data.get(name) != self.data.get(name) for name in MAPPED)
        if "replace" not in edit and isinstance(site, dict) and is_changed:
            data["site"] = {**site, "edited": True}
        return data

    @property
    def can_undo(self) -> bool:
        """True if there is an earlier version."""
        return self._index > 0

    @property
    def can_redo(self) -> bool:
        """True if a version was undone."""
        return self._index + 1 < len(self._versions)

    def undo(self) -> bool:
        """Go back one version; return whether there was one."""
        return self._go(self._index - 1)

    def redo(self) -> bool:
        """Restore the version that was undone last; return whether there was one."""
        return self._go(self._index + 1)

    def save(self, file: str | Path | None = None) -> Path:
        """Write the problem file.

        Parameters
        ----------
        file : str or Path, optional
            Path of the file from now on.

        Raises
        ------
        InputError
            The present version is no problem, no file is named, or it cannot be written.
        """
        target = Path(file) if file is not None else self.file
        if target is None:
            raise InputError("save: expected the name of a file")
        text = self.problem().to_json()
        write_text(target, text)
        self._drop_unsaved()
        self.file, self._saved = target, self.data
        return target

    def _push(self, data: dict[str, Any]) -> None:
        self._write_unsaved(data)
        del self._versions[self._index + 1 :]
        self._versions.append(data)
        del self._versions[: max(0, len(self._versions) - self._policy.max_versions)]
        self._index = len(self._versions) - 1
        self.version += 1

    def _go(self, to: int) -> bool:
        if not 0 <= to < len(self._versions):
            return False
        self._write_unsaved(self._versions[to])
        self._index = to
        self._merging = None
        self.version += 1
        return True

    def _write_unsaved(self, data: dict[str, Any]) -> None:
        """Write a version beside the file before it becomes the present one; raise InputError, and
        change no version, if the disk refuses it."""
        if self._unsaved_file is not None:
            write_text(self._unsaved_file, json.dumps(data, allow_nan=False))

    # unsaved edits

    @property
    def _unsaved_file(self) -> Path | None:
        """Path at which the current version is kept until it is saved, or None."""
        return None if self.file is None else self.file.with_name(f".{self.file.name}.unsaved")

    def _unsaved(self) -> dict[str, Any] | None:
        """Return the unsaved version, unless the file is newer; None if there is none."""
        unsaved_file = self._unsaved_file
        if unsaved_file is None or not unsaved_file.exists():
            return None
        if (
            self.file
            and self.file.exists()
            and os.path.getmtime(unsaved_file) < os.path.getmtime(self.file)
        ):
            return None  # the file was changed by somebody else since
        return parse_json_object(read_text(unsaved_file), str(unsaved_file))

    def _drop_unsaved(self) -> None:
        if self._unsaved_file is not None:
            self._unsaved_file.unlink(missing_ok=True)


def _read(file: Path) -> dict[str, Any]:
    """Read a problem file and write out its short forms."""
    return dict(json.loads(Problem.load(file).to_json()))


def _list(data: dict[str, Any], name: object) -> list[Any]:
    """Return a list of this version that may be changed: a copy, if versions share it."""
    if not isinstance(name, str) or name not in LISTS:
        raise InputError(f"edit: expected one of {', '.join(LISTS)}, got {shown(name)}")
    copied = data[name] = list(data.get(name, []))
    return copied


def _check_fields(data: dict[str, Any]) -> None:
    """Raise InputError if a version has an unknown field."""
    for name in data:
        if name not in Problem.model_fields:
            raise InputError(f"edit: unknown field {shown(name)}")


def _check_lists(data: dict[str, Any]) -> None:
    """Raise InputError unless goals and obstacles are lists of objects or positions, as the page
    draws them; values may be wrong while somebody edits them."""
    for name in LISTS:
        items = data.get(name, [])
        if not isinstance(items, list):
            raise InputError(f"edit: {name}: expected a list, got {shown(items)}")
        for k, item in enumerate(items):
            if not isinstance(item, dict | list):
                raise InputError(
                    f"edit: {name}[{k}]: expected an object or a position, got {shown(item)}"
                )


def _item(data: dict[str, Any], path: object) -> tuple[list[Any], int]:
    if not isinstance(path, list) or len(path) < 2:
        raise InputError(f"edit: expected [list, index], got {shown(path)}")
    items, k = _list(data, path[0]), path[1]
    if not isinstance(k, int) or isinstance(k, bool) or not 0 <= k < len(items):
        raise InputError(f"edit: {path[0]}: no item {shown(k)}")
    return items, k


def _set(data: dict[str, Any], path: object, value: Any) -> None:
    if not isinstance(path, list) or not path or len(path) > 3:
        raise InputError(f"edit: expected a path of a field, got {shown(path)}")
    if len(path) == 1:
        if not isinstance(path[0], str) or path[0] not in Problem.model_fields:
            raise InputError(f"edit: unknown field {shown(path[0])}")
        data[path[0]] = value
        return
    items, k = _item(data, path)
    if len(path) == 2:
        items[k] = value
        return
    if not isinstance(items[k], dict) or not isinstance(path[2], str):
        raise InputError(f"edit: expected the name of a field, got {shown(path[2])}")
    items[k] = {f: v for f, v in items[k].items() if f != path[2]}
    if value is not None:
        items[k][path[2]] = value


def _delete(data: dict[str, Any], paths: object) -> None:
    if not isinstance(paths, list) or not paths:
        raise InputError(f"edit: expected paths to delete, got {shown(paths)}")
    for path in paths:
        _item(data, path)  # nothing is deleted unless all items exist
    deleted = {(str(name), int(k)) for name, k, *_ in paths}
    for name in {name for name, _ in deleted}:
        data[name] = [v for k, v in enumerate(data[name]) if (name, k) not in deleted]
