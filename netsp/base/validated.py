"""Models from JSON text; an invalid text raises one line that names the field and its value."""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from netsp.base.errors import InputError

SCHEMA_VERSION = 1
"""Format version of all files."""


MARKER_FIELDS = {
    "problem": {"base", "tether_length"},
    "solution": {"tour", "lower_bound"},
    "mission": {"anchor", "waypoints"},
    "surprise file": {"events"},
    "scene": {"solids"},
}
"""Fields that only files of one kind have, by kind."""


class Model(BaseModel):
    """Base of all models: frozen, without unknown fields.

    A call with wrong values raises `InputError` in one line, as a file with wrong values does.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __init__(self, /, *values: Any, **data: Any) -> None:
        if values:
            name, fields = type(self).__name__, ", ".join(f"{k}=…" for k in type(self).model_fields)
            raise TypeError(f"{name}: expected fields by name: {name}({fields})")
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise InputError(f"{type(self).__name__}: {explain(error)}") from None

    # pydantic validates nested models without calling this `__init__`, so that a complaint names
    # the
    # whole path of a field
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Give the class a signature with plain types, without the checks of its fields."""
        super().__pydantic_init_subclass__(**kwargs)
        cls.__signature__ = _signature(cls)

    def __eq__(self, other: object) -> bool:
        """Compare fields, not cached properties: those may be arrays, whose comparison is no
        bool."""
        if not isinstance(other, Model) or type(self) is not type(other):
            return NotImplemented
        return all(getattr(self, name) == getattr(other, name) for name in type(self).model_fields)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy without cached properties, which may be wrong for the updated fields."""
        copy = super().model_copy(update=update, deep=deep)
        for name in copy.__dict__.keys() - type(self).model_fields.keys():
            del copy.__dict__[name]
        return copy


def _signature(model: type[BaseModel]) -> inspect.Signature:
    """Return the signature of a model's constructor for `inspect.signature` and help."""
    types = get_type_hints(model)  # plain types: the checks of fields are in `Annotated`
    parameters = []
    for name, field in model.model_fields.items():
        default = inspect.Parameter.empty
        if not field.is_required():
            default = field.get_default(call_default_factory=True, validated_data={})
        annotation = types.get(name, field.annotation)
        parameters.append(
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default
            )
        )
    return inspect.Signature(parameters)


M = TypeVar("M", bound=BaseModel)


def read_model(
    model: type[M], text: str | bytes, source: str, context: Mapping[str, Any] | None = None
) -> M:
    """Return a model of format version 1 from JSON; raise InputError in one line if it is invalid.

    Pydantic passes the context to the validators of the model.
    """
    data = parse_json_object(text, source)
    _check_kind(model, data, source)
    if data.get("type") in ("FeatureCollection", "Feature"):
        raise InputError(
            f"{source}: this is a map (GeoJSON); expected what `netsp import` makes of it"
        )
    version = data.get("schema_version", None)
    if version != SCHEMA_VERSION or isinstance(version, bool):
        raise InputError(f"{source}: schema_version: expected {SCHEMA_VERSION}, got {version!r}")
    try:
        return model.model_validate(data, context=context)
    except ValidationError as error:
        raise InputError(f"{source}: {explain(error)}") from None


def kind_of(data: Mapping[str, Any]) -> str | None:
    """Return the kind of a file by the fields that only this kind has, or None."""
    return next((k for k, marks in MARKER_FIELDS.items() if marks <= data.keys()), None)


def _check_kind(model: type[BaseModel], data: dict[str, Any], source: str) -> None:
    """Raise InputError if a file is clearly of another kind than that of the model."""
    kind = kind_of(data)
    expected_kind = next(
        (k for k, marks in MARKER_FIELDS.items() if marks <= model.model_fields.keys()), None
    )
    if kind and expected_kind and kind != expected_kind:
        raise InputError(f"{source}: this is a {kind}; expected a {expected_kind}")


def parse_json(text: str | bytes, source: str) -> Any:
    """Return the value of a JSON text, as `json.loads` does, but refuse repeated keys.

    Parameters
    ----------
    text : str or bytes
        Text; bytes are UTF-8.
    source : str
        Name of the text in messages, such as its file.

    Raises
    ------
    InputError
        Not JSON, a key is repeated, a number has too many digits, or lists are nested too deeply.

    Examples
    --------
    >>> parse_json("[1, 2.5]", "path.json")
    [1, 2.5]
    """

    def unique(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for key, value in pairs:
            if key in out:
                raise InputError(f"{source}: field {key!r} is given twice")
            out[key] = value
        return out

    try:
        return json.loads(text, object_pairs_hook=unique)
    except json.JSONDecodeError as error:
        known = "NODE_COORD_SECTION" in error.doc or "GTSP_SET_SECTION" in error.doc
        is_cut_off = error.msg.startswith("Unterminated") or not error.doc[error.pos :].strip()
        hint = "; the text ends too early: save or copy the file again" if is_cut_off else ""
        hint = "; `netsp gtsp` reads this format" if known else hint
        fault = f"{error.msg.removesuffix(' at')} at line {error.lineno}, column {error.colno}"
        raise InputError(f"{source}: not JSON: {fault}{hint}") from None
    except UnicodeDecodeError:
        raise InputError(f"{source}: not text in UTF-8") from None
    except ValueError:
        raise InputError(
            f"{source}: not JSON that netsp reads: a number has too many digits"
        ) from None
    except RecursionError:
        raise InputError(f"{source}: not JSON that netsp reads: nested too deeply") from None


def parse_json_object(text: str | bytes, source: str) -> dict[str, Any]:
    """Return the object of a JSON text, as `parse_json` does; raise InputError for other values."""
    data = parse_json(text, source)
    if not isinstance(data, dict):
        raise InputError(f"{source}: expected a JSON object, got {type(data).__name__}")
    return data


def explain(error: ValidationError) -> str:
    """Return the first complaint of a validation error in one line: field, complaint, value."""
    errors = error.errors(include_url=False)
    first = errors[0]
    where = ""
    for k, part in enumerate(first["loc"]):
        if isinstance(part, int):
            where += f"[{part}]"
        elif not (k == 2 and first["loc"][0] == "obstacles"):  # there pydantic inserts the kind
            where += f".{part}" if where else part
    kind, context = first["type"], first.get("ctx", {})
    got = f"got {shown(first['input'])}"
    if kind == "extra_forbidden":
        message = "unknown field"
    elif kind == "missing":
        message = "missing"
    elif kind in ("value_error", "obstacle"):
        message = first["msg"].removeprefix("Value error, ")
    elif kind == "too_short":
        message = f"expected at least {context['min_length']}, got {context['actual_length']}"
    elif kind == "greater_than":
        message = f"expected a number > {context['gt']:g}, {got}"
    elif kind == "greater_than_equal":
        message = f"expected a number >= {context['ge']:g}, {got}"
    elif kind == "less_than_equal":
        message = f"expected a number <= {context['le']:g}, {got}"
    elif kind in ("model_type", "model_attributes_type", "dict_type"):
        message = f"expected an object, {got}"
    else:
        message = f"{_decapitalise(first['msg'])}, {got}"
    # pydantic leaves wrong items out of a list, and then also reports that the list is too short
    short = {e["loc"] for e in errors if e["type"] == "too_short"}
    counted = [e for e in errors if e["loc"] not in short or not _has_wrong_item(e, errors)]
    extra = [e["loc"][-1] for e in errors if e["type"] == "extra_forbidden"]
    others = len(counted) - 1
    if kind == "missing" and extra:  # probably the same field, misspelt
        message, others = f"{message}; unknown field {shown(extra[0])}", others - 1
    more = f" (and {others} more)" if others else ""
    return f"{where}: {message}{more}" if where else f"{message}{more}"


def _has_wrong_item(error: ErrorDetails, errors: Sequence[ErrorDetails]) -> bool:
    """Return whether another error concerns an item of the list that this error concerns."""
    place = error["loc"]
    return any(other["loc"][: len(place)] == place != other["loc"] for other in errors)


def _decapitalise(text: str) -> str:
    return text[:1].lower() + text[1:]


def shown_names(names: Iterable[str | None], max_count: int = 8) -> str:
    """Return names for messages, each once; ``none with a name`` if there is none.

    Parameters
    ----------
    names : iterable of str or None
        Names of things; None for those without a name.
    max_count : int
        Maximum number of names that are listed; the others are counted.

    Examples
    --------
    >>> shown_names(["pile", None, "hull", "pile"])
    "'pile', 'hull'"
    """
    known = [shown(name) for name in dict.fromkeys(names) if name]
    more = f" and {len(known) - max_count} more" if len(known) > max_count else ""
    return (", ".join(known[:max_count]) or "none with a name") + more


def shown(value: Any) -> str:
    """Return the `repr` of a value for messages, of at most 60 characters."""
    try:
        text = repr(value)
    except Exception:  # a foreign class, or a number with too many digits for Python
        text = f"a {type(value).__name__} that cannot be shown"
    return text if len(text) <= 60 else text[:57] + "…"
