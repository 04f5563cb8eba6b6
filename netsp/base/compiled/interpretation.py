"""Kernels as plain Python functions.

An interpreted and a compiled kernel return the same result to the last bit (tests/test_tiers.py,
benchmarks/kernels_alike.py). Python rounds two operations differently from compiled code, so
interpreted kernels compute these as compiled code does: powers with a constant integer exponent as
products, and hypotenuses with the C library.
"""

from __future__ import annotations

import ast
import inspect
import linecache
import math
import textwrap
from collections.abc import Callable, Iterator
from functools import cache
from types import CodeType, FunctionType, SimpleNamespace
from typing import Any, TypeVar

import numpy as np

F = TypeVar("F", bound=Callable[..., Any])

_POWER = "_netsp_power"

_in_numpy: dict[Any, Callable[..., Any]] = {}

_time_s: dict[Any, float] = {}
"""CPU seconds that the code of each kernel ran interpreted, by its function."""


def interprets(kernel: Any) -> Callable[[F], F]:
    """Register the vectorised form of a kernel, which runs where the kernel is interpreted.

    The vectorised form must return the same result as the kernel to the last bit, and write the
    same values to the same arrays.
    """

    def register(function: F) -> F:
        # the key is the function, because a kernel and its dispatcher are two objects
        _in_numpy[getattr(kernel, "py_func", kernel)] = function
        return function

    return register


def is_in_numpy(kernel: Any) -> bool:
    """Return whether a kernel has a vectorised form."""
    return getattr(kernel, "py_func", kernel) in _in_numpy


def interpreted(kernel: Any) -> Callable[..., Any]:
    """Return a kernel as a plain Python function that calls other kernels as plain Python too."""
    return _interpreted(getattr(kernel, "py_func", kernel))


@cache
def _interpreted(function: Any) -> Callable[..., Any]:
    if function in _in_numpy:
        return _in_numpy[function]
    code = _code_with_products(function)
    known = function.__globals__
    names = {name: known[name] for name in names_used(code) if name in known}
    used = {n: interpreted(v) if hasattr(v, "py_func") else v for n, v in names.items()}
    if used.get("math") is math:
        used["math"] = _c_math()
    scope = {**known, **used, _POWER: _power}
    return FunctionType(code, scope, function.__name__, function.__defaults__)


def names_used(code: CodeType) -> Iterator[str]:
    """Yield the global names in a function's code, including those in comprehensions."""
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from names_used(inner)


@cache
def called_kernels(kernel: Any) -> frozenset[Any]:
    """Return a kernel and all kernels that it calls, directly or indirectly."""
    found = {kernel}
    for name in names_used(kernel.py_func.__code__):
        other = kernel.py_func.__globals__.get(name)
        if hasattr(other, "py_func") and other.py_func is not kernel.py_func:
            found |= called_kernels(other)
    return frozenset(found)


def add_interpreted_time(kernel: Any, cpu_s: float) -> None:
    """Add the CPU seconds of an interpreted call to the kernel and the kernels that it calls, in
    proportion to their bytecode."""
    sizes = {k.py_func: len(k.py_func.__code__.co_code) for k in called_kernels(kernel)}
    per_byte = cpu_s / sum(sizes.values())
    for function, size in sizes.items():
        _time_s[function] = _time_s.get(function, 0.0) + per_byte * size


def interpreted_time_s(kernel: Any) -> float:
    """Return the CPU seconds added for the code of a kernel and of the kernels that it calls."""
    return sum(_time_s.get(k.py_func, 0.0) for k in called_kernels(kernel))


class _Products(ast.NodeTransformer):
    """Transformer that replaces powers with a constant integer exponent by calls of `_power`."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        exponent = node.right.value if isinstance(node.right, ast.Constant) else None
        if not isinstance(node.op, ast.Pow) or not isinstance(exponent, int) or exponent < 1:
            return node
        return ast.Call(ast.Name(_POWER, ast.Load()), [node.left, node.right], [])


def _code_with_products(function: Callable[..., Any]) -> CodeType:
    """Return the code of a function in which powers are products."""
    original = function.__code__
    last = max(line for _, _, line in original.co_lines() if line is not None)
    if not any(
        "**" in line
        for line in linecache.getlines(original.co_filename)[original.co_firstlineno - 1 : last]
    ):
        return original
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    (definition,) = tree.body
    assert isinstance(definition, ast.FunctionDef)
    definition.decorator_list, definition.returns = [], None
    for argument in ast.walk(definition.args):
        if isinstance(argument, ast.arg):
            argument.annotation = None
    tree = ast.fix_missing_locations(_Products().visit(tree))
    ast.increment_lineno(tree, original.co_firstlineno - 1)
    whole = compile(tree, original.co_filename, "exec")
    (code,) = (c for c in whole.co_consts if isinstance(c, CodeType))
    return code


def _power(x: Any, exponent: int) -> Any:
    """Return a power as Numba computes it: by squaring, lowest bit of the exponent first."""
    out = None
    while exponent:
        if exponent & 1:
            out = x if out is None else out * x
        exponent >>= 1
        if exponent:
            x = x * x
    return out


@cache
def _c_math() -> SimpleNamespace:
    """Return `math` with the `hypot` of the C library, as compiled code has it; Python's is more
    accurate."""
    return SimpleNamespace(**{**vars(math), "hypot": np.hypot})
