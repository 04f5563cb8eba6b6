"""Pages of the site that are made while it is built: generated references, pages that lie beside
shipped problems and scenes, and notebooks, which are run."""

from __future__ import annotations

import posixpath
import re
import sys
from collections.abc import Callable, Collection
from pathlib import Path

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from nbconvert import MarkdownExporter
from nbconvert.preprocessors import ExecutePreprocessor

ROOT = Path(__file__).parents[2]
BESIDE = {"reference/problems.md": "problems/README.md", "reference/scenes.md": "scenes/README.md"}
EXAMPLES = ROOT / "examples"
sys.path.insert(0, str(Path(__file__).parent))  # hooks are loaded as single files

import command_reference  # noqa: E402
import format_reference  # noqa: E402
import licences  # noqa: E402
import mavlink  # noqa: E402
import modules  # noqa: E402
import policies  # noqa: E402
import solver_options  # noqa: E402

GENERATED: dict[str, Callable[[], list[str]]] = {
    "<!-- alarms -->": policies.alarms,
    "<!-- commands -->": command_reference.sections,
    "<!-- commands contents -->": command_reference.contents,
    "<!-- flight policies -->": policies.flight,
    "<!-- formats -->": format_reference.sections,
    "<!-- guard policies -->": policies.guard,
    "<!-- licences -->": licences.table,
    "<!-- mavlink -->": mavlink.table,
    "<!-- modules -->": modules.module_list,
    "<!-- solver options -->": solver_options.options,
    "<!-- solver policies -->": solver_options.policy_options,
    "<!-- tolerances -->": modules.tolerances,
}
"""Markers in pages, and the functions whose lines replace them."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that lie beside their subjects, and the notebooks."""
    for name, source in BESIDE.items():
        text = linked_from(name, (ROOT / source).read_text(), Path(source).parent)
        files.append(File.generated(config, name, content=text))
    for notebook in sorted(EXAMPLES.glob("*.ipynb")):
        for name, content in run(notebook).items():
            files.append(File.generated(config, name, content=content))
    return files


def run(notebook: Path) -> dict[str, str | bytes]:
    """Return a notebook as a page with the output of its cells, and its pictures."""
    book = nbformat.read(notebook, as_version=4)
    ExecutePreprocessor(
        timeout=120, extra_arguments=["--log-level=40"], coalesce_streams=True
    ).preprocess(book, {"metadata": {"path": str(EXAMPLES)}})
    exporter = MarkdownExporter()
    text, resources = exporter.from_notebook_node(
        book, resources={"unique_key": f"{notebook.stem}-pictures"}
    )
    pictures = resources["outputs"]
    text = linked_from(f"tutorials/{notebook.stem}.md", text, Path("examples"), kept=pictures)
    text = text.replace("![png](", "![Picture that the cell above draws](")
    beside = {f"tutorials/{name}": data for name, data in pictures.items()}
    return {f"tutorials/{notebook.stem}.md": text, **beside}


def linked_from(page: str, markdown: str, folder: Path, kept: Collection[str] = ()) -> str:
    """Return the text with its links as seen from a page of the site.

    Parameters
    ----------
    page : str
        File of the site that holds the text.
    markdown : str
        Text whose links start from `folder` of the repository.
    folder : Path
        Folder of the repository, relative to its root.
    kept : collection of str
        Links to files beside the page, which stay as they are.
    """

    def link(match: re.Match[str]) -> str:
        path, mark, anchor = match[1].partition("#")
        target = posixpath.normpath(posixpath.join(folder.as_posix(), path))
        shown = {source: name for name, source in BESIDE.items()}.get(target, target)
        if "://" in path or not path or path in kept:
            return match[0]
        if re.fullmatch(r"examples/[\w-]+\.ipynb", target):
            shown = f"tutorials/{Path(target).stem}.md"
        shown = shown.removeprefix("docs/")
        return f"]({posixpath.relpath(shown, posixpath.dirname(page) or '.')}{mark}{anchor})"

    return re.sub(r"\]\(([^)\s]+)\)", link, markdown)


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return the text of a page with its links mended and its markers replaced."""
    if page.file.generated_by is None:
        here = page.file.src_uri
        markdown = linked_from(here, markdown, Path("docs") / posixpath.dirname(here))
    for marker, lines in GENERATED.items():
        if marker in markdown:
            markdown = markdown.replace(marker, "\n".join(lines()))
    return markdown
