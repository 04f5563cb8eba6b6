"""Tables of the options of every solver, from the dataclasses of their parameters."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any

from policies import attributes

HEAD = ["| option | default | meaning |", "|---|---|---|"]


def options() -> list[str]:
    """Return Markdown: a table of the options of each solver, without those of its policy."""
    from netsp.plan.solver_table import SOLVERS

    out: list[str] = []
    for name in SOLVERS:
        params = _parameters(SOLVERS[name].params)
        rows = [] if params is None else list(_rows("", params))
        out += [f"**`{name}`**" + ("" if rows else " has no options."), ""]
        if rows:
            out += [*HEAD, *rows, ""]
    return out


def policy_options() -> list[str]:
    """Return Markdown: a table for each policy of `auto`, with the full names of its options."""
    params = _parameters("netsp.plan.auto:Params")
    out: list[str] = []
    for path, policy in _policies("policy", params.policy):
        rows = list(_rows(f"{path}.", policy))
        if rows:
            subject = " ".join((inspect.getdoc(policy) or "").split("\n\n")[0].split())
            out += [f"**`{path}`.** {subject}", "", *HEAD, *rows, ""]
    return out


def _parameters(reference: str | None) -> Any:
    """Return the default parameters of a solver; None if it has none."""
    if reference is None:
        return None
    module, _, name = reference.partition(":")
    return getattr(import_module(module), name)()


def _policies(path: str, policy: Any) -> Iterator[tuple[str, Any]]:
    """Yield a policy and all policies within it, with the names that lead to them."""
    yield path, policy
    for field in fields(policy):
        value = getattr(policy, field.name)
        if is_dataclass(value):
            yield from _policies(f"{path}.{field.name}", value)


def _rows(prefix: str, params: Any) -> Iterator[str]:
    """Yield the rows of the options that are no policies."""
    meanings: dict[str, str] = {}
    for kind in reversed(type(params).__mro__):
        text = (inspect.getdoc(kind) or "").replace("Parameters\n---", "Attributes\n---")
        for names, meaning in attributes(text).items():
            meanings |= dict.fromkeys(names.split(", "), meaning)
    for field in fields(params):
        value = getattr(params, field.name)
        if not is_dataclass(value):
            shown = repr(value).replace("|", "\\|")
            meaning = meanings.get(field.name, "").replace("``", "`")
            yield f"| `{prefix}{field.name}` | {shown} | {meaning} |"


if __name__ == "__main__":
    print("\n".join([*options(), *policy_options()]))
