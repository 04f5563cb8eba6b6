"""The reference of the command line, from the declarations that the parsers are made of."""

from __future__ import annotations

import argparse
import posixpath
import re

from netsp.command.command_options import Group, OneOf, Option, each_option
from netsp.command.command_table import COMMANDS, Command

DEFAULT = re.compile(r"^(.*?)[;,]? ?\(?\bdefault(?: is)?:? (?!\))([^()]*)\)?$")
"""Help that ends with its default."""

DOC = re.compile(r"docs/([\w/-]+)\.md")
"""A page named in a help text."""


def sections() -> list[str]:
    """Return Markdown: a section for each command, under a heading for what commands are for."""
    out = []
    for purpose, group in COMMANDS.items():
        out += [f"## {purpose.capitalize()}", ""]
        for name, command in group.items():
            out += section(name, command)
    return out


def contents() -> list[str]:
    """Return Markdown: a row for each command, with what it is for."""
    out = ["| command | purpose |", "|---|---|"]
    for group in COMMANDS.values():
        out += [f"| [`{name}`](#{name}) | {c.text} |" for name, c in group.items()]
    return out


def section(name: str, command: Command) -> list[str]:
    """Return Markdown: purpose, usage, options and example of a command."""
    text = f"{command.text[0].upper()}{command.text[1:]}."
    out = [f"### netsp {name} {{ #{name} }}", "", text, ""]
    out += ["```text", usage(name, command), "```", ""]
    own = [each for each in command.options if not isinstance(each, Group)]
    out += table(own)
    for each in command.options:
        if isinstance(each, Group):
            out += [f"**{each.title[0].upper()}{each.title[1:]}**", "", *table(list(each.options))]
    return [*out, "Example:", "", "```sh", command.example, "```", ""]


def usage(name: str, command: Command) -> str:
    """Return the usage of a command: what must be given, and `[options]` for the rest."""
    words, has_more = ["netsp", name], False
    for each in command.options:
        if isinstance(each, Option) and (not each.flags or each.required):
            words.append(each.usage.replace(", ", "|") if each.flags else each.usage)
        elif isinstance(each, OneOf) and each.required:
            words.append(f"({' | '.join(option.usage for option in each.options)})")
        else:
            has_more = True
    return " ".join([*words, *(["[options]"] if has_more else [])])


def table(options: list[Option | OneOf]) -> list[str]:
    """Return Markdown: a row for each option with meaning and default."""
    rows = []
    for each in options:
        if isinstance(each, OneOf):
            for option in each.options:
                others = ", ".join(f"`{o.name}`" for o in each.options if o is not option)
                needed = f"one of these is required: this, {others}" if each.required else ""
                rows.append(row(option, needed or f"not together with {others}"))
        elif each.text != argparse.SUPPRESS:
            rows.append(row(each))
    return ["| option | meaning | default |", "|---|---|---|", *rows, ""]


def row(option: Option, note: str = "") -> str:
    """Return the row of an option."""
    text, default = meaning(option)
    text = "; ".join(filter(None, (text, note, "may be repeated" * is_silent(option, text))))
    return f"| `{option.usage}` | {escaped(text)} | {escaped(default)} |".replace("|  |", "| |")


def is_silent(option: Option, text: str) -> bool:
    """Return whether an option may be repeated and its help does not say so."""
    return option.repeats and "repeat" not in text


def meaning(option: Option) -> tuple[str, str]:
    """Return what an option means, and its default in words."""
    text = (option.text or "").replace("%%", "%")
    found = DEFAULT.match(text)
    if option.required or (not option.flags and not option.usage.startswith("[")):
        return text, "required"
    if found:
        return found[1], found[2]
    if isinstance(option.default, int | float):
        return text, f"{option.default:g}"
    return text, f"`{option.default}`" if isinstance(option.default, str) else ""


def escaped(text: str) -> str:
    """Return the text for a cell, with links to the pages that it names."""

    def link(match: re.Match[str]) -> str:
        target = posixpath.relpath(f"{match[1]}.md", "reference")
        return f"[{posixpath.basename(match[1]).replace('-', ' ')}]({target})"

    # < and * would be read as markup
    text = re.sub(r"([|<*])", r"\\\1", text)
    return DOC.sub(link, text)


def undocumented() -> list[str]:
    """Return the options of commands that say nothing about themselves, as `command option`."""
    return [
        f"{name} {option.name}"
        for group in COMMANDS.values()
        for name, command in group.items()
        for option in each_option(command.options)
        if not (option.text or "").strip()
    ]


if __name__ == "__main__":
    print("\n".join([*contents(), "", *sections()]))
