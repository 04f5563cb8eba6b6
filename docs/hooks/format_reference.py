"""The reference of the file formats, from their JSON Schemas, with an example file each."""

from __future__ import annotations

import importlib
import json
import tomllib
from pathlib import Path
from typing import Any

from netsp.command.schema import FORMATS, schema_of

ROOT = Path(__file__).parents[2]

EXAMPLES = {
    "problem": "problems/pool.json",
    "solution": "examples/pool-solution.json",
    "scene": "scenes/basin.json",
    "mission": "missions/ship.json",
    "surprises": "examples/surprises.json",
    "run-state": "examples/pool-run-state.json",
    "scene-surprises": "examples/jetty-surprises.json",
    "study": "examples/study.toml",
}
"""A shipped file of each format. It is validated, and shown with long lists cut."""

MAX_SHOWN = 3  # items of a list of lists or objects that an example shows


def sections() -> list[str]:
    """Return Markdown: a section for every format, and in it a table for every kind of object."""
    out = []
    for name in FORMATS:
        schema = schema_of(name)
        out += [f"## {name.capitalize().replace('-', ' ')}", "", described(schema), ""]
        out += [*example(name), *table(name, schema)]
        for part, fields in schema.get("$defs", {}).items():
            if fields.get("properties"):
                out += [f"### {part} {{ #{name}-{part.lower()} }}", "", described(fields), ""]
                out += table(name, fields)
    return out


def model(name: str) -> Any:
    """Return the model of a format."""
    module, class_name = FORMATS[name].split(":")
    return getattr(importlib.import_module(module), class_name)


def example(name: str) -> list[str]:
    """Return Markdown: an example file, after checking that it is valid."""
    path = EXAMPLES[name]
    text = (ROOT / path).read_text(encoding="utf-8")
    is_toml = path.endswith(".toml")
    model(name).model_validate(tomllib.loads(text) if is_toml else json.loads(text))
    shown, is_cut = (text.strip(), False) if is_toml else shortened(json.loads(text))
    note = ", with long lists cut" if is_cut else ""
    return [f"Example, `{path}`{note}:", "", f"```{path.split('.')[-1]}", shown, "```", ""]


def shortened(data: Any) -> tuple[str, bool]:
    """Return a JSON text whose long lists of lists or objects are cut, and whether one is."""
    is_cut = False

    def text(value: Any, indent: int) -> str:
        nonlocal is_cut
        line = json.dumps(value, ensure_ascii=False)
        if len(line) + indent <= 90 or not isinstance(value, list | dict):
            return line
        pad = " " * (indent + 2)
        if isinstance(value, dict):
            rows = [f'{pad}"{key}": {text(v, indent + 2)}' for key, v in value.items()]
            return "{\n" + ",\n".join(rows) + "\n" + " " * indent + "}"
        kept = value[:MAX_SHOWN]
        rows = [pad + text(v, indent + 2) for v in kept]
        if len(kept) < len(value):
            is_cut = True
            rows.append(f"{pad}…")
        return "[\n" + ",\n".join(rows) + "\n" + " " * indent + "]"

    return text(data, 0), is_cut


def described(schema: dict[str, Any]) -> str:
    """Return the first paragraph of a description in one line."""
    return str(schema.get("description", "")).split("\n\n")[0].replace("\n", " ")


def table(name: str, schema: dict[str, Any]) -> list[str]:
    """Return Markdown: a row for each field of an object."""
    required = set(schema.get("required", ()))
    out = ["| field | type | meaning | default |", "|---|---|---|---|"]
    for field, what in schema["properties"].items():
        # a model in Python has it by itself, a file must say it
        in_file = field in required or field == "schema_version"
        default = "required" if in_file else shown_default(what.get("default"))
        meaning = what.get("description", "").replace("\n", " ").replace("|", "\\|")
        out.append(f"| `{field}` | {kind(name, what)} | {meaning} | {default} |")
    return [*out, ""]


def shown_default(value: Any) -> str:
    """Return a default as a file has it; nothing for null, and no long objects."""
    if value is None:
        return ""
    if isinstance(value, dict) and len(value) > 2:
        return "its own defaults"
    text = value if isinstance(value, str) and value else json.dumps(value, ensure_ascii=False)
    return f"`{text}`"


def kind(name: str, what: dict[str, Any]) -> str:
    """Return the type of a field in a few words."""
    if "$ref" in what:
        part = what["$ref"].rsplit("/", 1)[-1]
        return f"[{part}](#{name}-{part.lower()})"
    for several in ("anyOf", "oneOf"):
        if several in what:
            kinds = [kind(name, w) for w in what[several] if w.get("type") != "null"]
            return " or ".join(dict.fromkeys(kinds))
    if "enum" in what:
        return ", ".join(f"`{v}`" for v in what["enum"])
    if "const" in what:
        return f"`{what['const']}`"
    if what.get("type") == "array":
        if "prefixItems" in what:
            return f"({', '.join(kind(name, w) for w in what['prefixItems'])})"
        size = what.get("maxItems")
        count = f"{size} " if size is not None and size == what.get("minItems") else ""
        return f"list of {count}{kind(name, what.get('items', {}))}"
    return limits(what, what.get("type", "any"))


def limits(what: dict[str, Any], type_: str) -> str:
    """Return the type of a number with its limits."""
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    signs |= {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
    shown = [f"{sign} {what[key]:g}" for key, sign in signs.items() if key in what]
    return " ".join([type_, ", ".join(shown)]).strip()


if __name__ == "__main__":
    print("\n".join(sections()))
