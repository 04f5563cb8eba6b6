"""What the site has that no page of `docs/` holds: the file formats, from their JSON Schemas, the
pages beside the shipped problems and scenes, and the notebooks, run while the site is built."""

from __future__ import annotations

import importlib
import posixpath
import re
import runpy
from pathlib import Path
from typing import Any

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from nbconvert import MarkdownExporter
from nbconvert.preprocessors import ExecutePreprocessor

ROOT = Path(__file__).parents[2]
BESIDE = {"reference/problems.md": "problems/README.md", "reference/scenes.md": "scenes/README.md"}
EXAMPLES = ROOT / "examples"
FORMATS, LICENCES = "<!-- formats -->", "<!-- licences -->"
MODULES, TOLERANCES = "<!-- modules -->", "<!-- tolerances -->"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Pages that lie beside what they are about."""
    for name, source in BESIDE.items():
        text = linked_from(name, (ROOT / source).read_text(), Path(source).parent)
        files.append(File.generated(config, name, content=text))
    for notebook in sorted(EXAMPLES.glob("*.ipynb")):
        for name, content in run(notebook).items():
            files.append(File.generated(config, name, content=content))
    return files


def run(notebook: Path) -> dict[str, str | bytes]:
    """A notebook as a page with what its cells print, and its pictures."""
    book = nbformat.read(notebook, as_version=4)
    ExecutePreprocessor(timeout=120, extra_arguments=["--log-level=40"]).preprocess(
        book, {"metadata": {"path": str(EXAMPLES)}}
    )
    exporter = MarkdownExporter()
    text, resources = exporter.from_notebook_node(
        book, resources={"unique_key": f"{notebook.stem}-pictures"}
    )
    text = linked_from(f"tutorials/{notebook.stem}.md", text, Path("examples"))
    pictures = {f"tutorials/{name}": data for name, data in resources["outputs"].items()}
    return {f"tutorials/{notebook.stem}.md": text, **pictures}


def linked_from(page: str, markdown: str, folder: Path) -> str:
    """Return the text with its links as seen from a page of the site.

    Parameters
    ----------
    page : str
        File of the site that holds the text.
    markdown : str
        Text whose links start from `folder` of the repository.
    folder : Path
        Folder of the repository, relative to its root.
    """

    def link(match: re.Match[str]) -> str:
        path, mark, anchor = match[1].partition("#")
        target = posixpath.normpath(posixpath.join(folder.as_posix(), path))
        shown = {source: name for name, source in BESIDE.items()}.get(target, target)
        if "://" in path or not path:
            return match[0]
        if re.fullmatch(r"examples/[\w-]+\.ipynb", target):
            shown = f"tutorials/{Path(target).stem}.md"
        shown = shown.removeprefix("docs/")
        return f"]({posixpath.relpath(shown, posixpath.dirname(page) or '.')}{mark}{anchor})"

    return re.sub(r"\]\(([^)\s]+)\)", link, markdown)


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links to those pages, and the formats where they belong."""
    if page.file.generated_by is None:
        here = page.file.src_uri
        markdown = linked_from(here, markdown, Path("docs") / posixpath.dirname(here))
    if FORMATS in markdown:
        markdown = markdown.replace(FORMATS, "\n".join(formats()))
    if LICENCES in markdown:
        hook = runpy.run_path(str(Path(__file__).with_name("licences.py")))
        markdown = markdown.replace(LICENCES, "\n".join(hook["table"]()))
    if MODULES in markdown:
        hook = runpy.run_path(str(Path(__file__).with_name("modules.py")))
        markdown = markdown.replace(MODULES, "\n".join(hook["module_list"]()))
        markdown = markdown.replace(TOLERANCES, "\n".join(hook["tolerances"]()))
    return markdown


def formats() -> list[str]:
    """A section for every format, and in it a table for every kind of object."""
    from netsp.command.schema import FORMATS as MODELS

    out = []
    for name, place in MODELS.items():
        module, model = place.split(":")
        schema = getattr(importlib.import_module(module), model).model_json_schema()
        out += [f"## {name.capitalize().replace('-', ' ')}", "", told(schema), ""]
        out += table(name, schema)
        for part, fields in schema.get("$defs", {}).items():
            if fields.get("properties"):
                out += [f"### {part} {{ #{name}-{part.lower()} }}", "", told(fields), ""]
                out += table(name, fields)
    return out


def told(schema: dict[str, Any]) -> str:
    """The first paragraph of a description."""
    return schema.get("description", "").split("\n\n")[0].replace("\n", " ")


def table(name: str, schema: dict[str, Any]) -> list[str]:
    """A row for each field."""
    required = set(schema.get("required", ()))
    out = ["| field | type | meaning | default |", "|---|---|---|---|"]
    for field, what in schema["properties"].items():
        # a model in Python has it by itself, a file must say it
        in_file = field in required or field == "schema_version"
        default = "required" if in_file else f"`{what.get('default', 'none')}`"
        if what.get("default", "") is None:
            default = ""
        meaning = what.get("description", "").replace("\n", " ").replace("|", "\\|")
        out.append(f"| `{field}` | {kind(name, what)} | {meaning} | {default} |")
    return [*out, ""]


def kind(name: str, what: dict[str, Any]) -> str:
    """A field's type in a few words."""
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
    """A number with the limits that it has."""
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    signs |= {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
    told = [f"{sign} {what[key]:g}" for key, sign in signs.items() if key in what]
    return " ".join([type_, ", ".join(told)]).strip()
