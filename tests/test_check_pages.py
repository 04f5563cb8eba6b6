"""The checks of `make docs` find pages that break them, and let good ones pass."""

import importlib
import inspect
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "docs" / "hooks"))

import check_pages  # noqa: E402
import command_reference  # noqa: E402
import format_reference  # noqa: E402

from benchmarks import page_statistics  # noqa: E402
from netsp.base import errors  # noqa: E402
from netsp.model.bound_scope import Scope  # noqa: E402
from netsp.model.solution import Status  # noqa: E402

GOOD = """# Fly it

This page is for pilots. After it you can fly a tour.

1. Connect the vehicle, see [the list](list.md).

```sh
netsp fly --optimize  # code is no prose
```
"""

NAV = "site_name: x\nnav:\n  - Guide:\n      - {title}: guide/fly-it.md\n"


def found(check, tmp_path, text=GOOD, title="Fly it"):
    """Return what a check finds in a repository with one page of the guide."""
    folder = tmp_path / "docs" / "guide"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "fly-it.md").write_text(text)
    (folder / "list.md").write_text("# List\n\nFor you.\n")
    (tmp_path / "mkdocs.yml").write_text(NAV.format(title=title))
    return [what for _, _, what in check_pages.CHECKS[check](tmp_path)]


@pytest.mark.parametrize("check", check_pages.CHECKS)
def test_a_good_page_passes(check, tmp_path):
    assert found(check, tmp_path) == []


@pytest.mark.parametrize(
    ("check", "before", "after", "complaint"),
    [
        ("links", "(list.md)", "(lost.md)", "no file lost.md"),
        ("spelling", "Connect the", "Optimize the", "American spelling: Optimize"),
        ("headings", "# Fly it", "# Fly It", "not sentence case: Fly It"),
        ("headings", "# Fly it", "# fly it", "not sentence case: fly it"),
        ("language", "Connect the", "At every stop, connect the", "do not say: stop"),
        ("language", "Connect the", "Connect anew the", "do not say: anew"),
        ("guide", "1. Connect", 900 * "very " + "1. Connect", "expected at most 900"),
        ("guide", "This page is for pilots. After it you can fly", "Fly", "for whom"),
        (
            "notebook",
            "1. Connect",
            "<!-- table x -->\n<!-- end -->\n1. Connect",
            "measured table x",
        ),
        ("notebook", "(list.md)", "(../notebook/a.md) [b](../notebook/b.md)", "more than one"),
    ],
)
def test_a_page_that_breaks_a_rule_is_found(check, before, after, complaint, tmp_path):
    assert before in GOOD
    (what,) = found(check, tmp_path, GOOD.replace(before, after))
    assert complaint in what


def test_a_misspelling_that_codespell_knows_is_found(tmp_path):
    pytest.importorskip("codespell_lib")
    (what,) = found("spelling", tmp_path, GOOD.replace("Connect", "Recieve"))
    assert what == "Recieve ==> Receive"


def test_an_entry_of_the_navigation_that_is_not_named_as_its_file_is_found(tmp_path):
    assert found("navigation", tmp_path, title="Flight") == [
        "'Flight' has no word of guide/fly-it.md",
        "'Flight' is headed 'Fly it' in guide/fly-it.md",
    ]


def test_an_option_without_description_is_found(tmp_path, monkeypatch):
    command = command_reference.COMMANDS["plan"]["solve"]
    options = (*command.options, command_reference.Option("--secret"))
    monkeypatch.setattr(command, "options", options)
    assert found("options", tmp_path) == ["no description: solve --secret"]


@pytest.mark.parametrize("check", check_pages.CHECKS)
def test_our_pages_pass(check):
    assert list(check_pages.CHECKS[check](ROOT)) == []


def test_the_reference_has_every_option_of_every_command():
    text = "\n".join(command_reference.sections())
    for group in command_reference.COMMANDS.values():
        for name, command in group.items():
            section = text.split(f"### netsp {name} {{")[1].split("\n### ")[0]
            assert command.example in section
            for each in command_reference.each_option(command.options):
                if each.text != command_reference.argparse.SUPPRESS:
                    assert f"| `{each.usage}` | " in section, f"{name} {each.name}"


def test_the_reference_splits_meaning_and_default():
    option = command_reference.Option
    cases = {
        ("--a N", "goals; default 20, in space 5"): ("goals", "20, in space 5"),
        ("--b S", "file (default: stdout)"): ("file", "stdout"),
        ("--c S", "this one (default) or that"): ("this one (default) or that", ""),
        ("FILE", "what is read"): ("what is read", "required"),
        ("[FILE]", "what is read"): ("what is read", ""),
    }
    for words, split in cases.items():
        assert command_reference.meaning(option(*words)) == split


@pytest.mark.parametrize("name", format_reference.FORMATS)
def test_every_format_has_an_example_that_is_valid(name):
    assert format_reference.example(name)[2].startswith("```")


def test_an_example_that_is_not_valid_is_found(monkeypatch):
    monkeypatch.setitem(format_reference.EXAMPLES, "problem", "scenes/basin.json")
    with pytest.raises(ValueError):
        format_reference.example("problem")


def test_the_reading_ease_of_a_page_leaves_out_code_and_tables():
    words = "The cat sat on the mat. The dog ran to the red house."
    text = (
        f"# Title\n\n{words}\n\n```sh\nnetsp incomprehensibility\n```\n\n| antidisestablishment |\n"
    )
    assert page_statistics.reading_ease(text) == page_statistics.reading_ease(words)
    assert page_statistics.reading_ease(words) > 100
    assert page_statistics.reading_ease("# Only a heading\n") is None
    counts = {"tether": 2, "base": 1, "pulled": 1, "visited": 3, "obstacle": 3, "way": 1}
    assert {word: page_statistics.syllables(word) for word in counts} == counts


def documented():
    """Return the objects on the page of the Python interface, by name."""
    page = (ROOT / "docs/reference/python.md").read_text()
    for name in re.findall(r"^::: (netsp[\w.]*)$", page, re.M):
        module, _, attribute = name.rpartition(".")
        yield name, getattr(importlib.import_module(module), attribute)


@pytest.mark.parametrize(("name", "value"), list(documented()))
def test_every_name_of_the_python_interface_has_an_example(name, value):
    texts = [value.__doc__ or ""]
    if not inspect.isfunction(value):  # a class or a module
        texts += [getattr(m, "__func__", m).__doc__ or "" for m in vars(value).values()]
    assert any(">>>" in text for text in texts)


def test_the_page_of_statuses_has_them_all():
    page = (ROOT / "docs/reference/statuses.md").read_text()
    for value in (*Status, *Scope):
        assert f"`{value.value}`" in page
    codes = {value for name, value in vars(errors).items() if name.startswith("EXIT_")}
    for code in codes:
        assert f"\n| {code} | " in page
    for error in vars(errors).values():
        if isinstance(error, type) and issubclass(error, errors.NetspError):
            name = error.__name__
            assert f"`{name}`" in page or name == "UnansweredError", name
