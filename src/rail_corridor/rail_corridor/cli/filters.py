"""Conditions on the fields of a message, as ``speed_mps > 3 and not valid``.

The text is Python's syntax of comparisons, and nothing else of it: it is parsed, checked node by
node and interpreted here, never evaluated.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from typing import Any, Final

from .usage import UsageError

_COMPARISONS: Final[dict[type[ast.cmpop], Callable[[Any, Any], bool]]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
#: Values that have a name; a field of the same name would be hidden.
_NAMED: Final = {"inf": math.inf, "nan": math.nan}
_LONGEST: Final = 1000


class Filter:
    """A condition that is true or false of values by name.

    Parameters
    ----------
    text : str
        Comparisons of fields, numbers and strings, joined by ``and``, ``or`` and ``not``.

    Raises
    ------
    UsageError
        If it is anything else.

    Examples
    --------
    >>> Filter("channel == 2 and not silent")({"channel": 2, "silent": False})
    True
    >>> Filter("1 < train_a.speed_mps <= 3").fields
    ('train_a.speed_mps',)
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._names: dict[str, None] = {}
        try:
            if len(text) > _LONGEST:
                raise SyntaxError
            self._condition = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise UsageError(f"--where: {text[:80]!r}: is no condition") from None
        self._check(self._condition)

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields in it, in their order."""
        return tuple(self._names)

    def __call__(self, values: Any) -> bool:
        """Whether it holds for a mapping of values; UsageError where they cannot be compared."""
        try:
            return bool(self._value(self._condition, values))
        except ValueError:  # of an array
            raise UsageError(f"--where: {self._text[:80]!r}: is of more than one value") from None

    def _check(self, node: ast.expr) -> None:
        name = _dotted(node)
        if name is not None:
            if name not in _NAMED:
                self._names[name] = None
            return
        if isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float | str):
            return
        parts: list[ast.expr]
        if isinstance(node, ast.BoolOp):
            parts = node.values
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub | ast.UAdd):
            parts = [node.operand]
        elif isinstance(node, ast.Compare) and all(type(op) in _COMPARISONS for op in node.ops):
            parts = [node.left, *node.comparators]
        else:
            raise UsageError(
                f"--where: {ast.unparse(node)!r}: must be comparisons of fields, numbers and "
                "strings, with and, or, not"
            )
        for part in parts:
            self._check(part)

    def _value(self, node: ast.expr, values: Any) -> Any:
        name = _dotted(node)
        if name is not None:
            return _NAMED[name] if name in _NAMED else values[name]
        if isinstance(node, ast.BoolOp):
            either = any if isinstance(node.op, ast.Or) else all
            return either(self._value(part, values) for part in node.values)
        if isinstance(node, ast.UnaryOp):
            return self._unary(node, values)
        if isinstance(node, ast.Compare):
            return self._compare(node, values)
        assert isinstance(node, ast.Constant)
        return node.value

    def _unary(self, node: ast.UnaryOp, values: Any) -> Any:
        value = self._value(node.operand, values)
        if isinstance(node.op, ast.Not):
            return not value
        if not isinstance(value, int | float):
            raise UsageError(f"--where: {ast.unparse(node)!r}: {value!r} is no number")
        return -value if isinstance(node.op, ast.USub) else value

    def _compare(self, node: ast.Compare, values: Any) -> bool:
        left = self._value(node.left, values)
        for op, comparator in zip(node.ops, node.comparators, strict=True):
            right = self._value(comparator, values)
            try:
                if not _COMPARISONS[type(op)](left, right):
                    return False
            except (TypeError, ValueError):
                reason = f"{left!r} and {right!r} cannot be compared"
                raise UsageError(f"--where: {ast.unparse(node)!r}: {reason}") from None
            left = right
        return True


def _dotted(node: ast.expr) -> str | None:
    """A field's name: ``a``, ``a.b`` or ``a[0].b``; None if it is no name."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        owner = _dotted(node.value)
        return None if owner is None else f"{owner}.{node.attr}"
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
        owner, index = _dotted(node.value), node.slice.value
        return f"{owner}[{index}]" if owner is not None and type(index) is int else None
    return None
