"""Conditions of a test: what they say of themselves when they do not hold."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from types import CodeType
from typing import Any

from rail_corridor.stepped.topics import TopicHistory


class Watched:
    """The topics that a condition has looked at, for those who read of its failure."""

    def __init__(self, topics: Mapping[str, TopicHistory]) -> None:
        self._topics = topics

    def __str__(self) -> str:
        if not self._topics:
            return ""
        return "; last seen: " + ", ".join(map(repr, self._topics.values()))

    __repr__ = __str__


class Always:
    """A condition that is checked after every tick.

    While it compares a value that is not known (`NotKnown`) it is not decided.
    """

    def __init__(self, condition: Callable[[], Any]) -> None:
        self._condition = condition
        #: Whether it has been decided in any tick.
        self.decided = False

    def check(self, watch: Callable[[Callable[[], Any]], tuple[Any, Watched]], where: str) -> None:
        """Raise AssertionError if it does not hold."""
        __tracebackhide__ = True
        holds, seen = watch(self._condition)
        if holds is None:
            return
        self.decided = True
        if not holds:
            raise AssertionError(f"{where}: does not hold: {said_of(self._condition)}{seen}")

    def conclude(self) -> None:
        """Raise AssertionError if the run has ended and it was never decided."""
        if not self.decided:
            said = said_of(self._condition)
            raise AssertionError(f"never decided, a value in it was never known: {said}")


def said_of(condition: Callable[[], Any]) -> str:
    """A condition as its source has it.

    >>> said_of(lambda: 1 + 1 == 3)
    'lambda: 1 + 1 == 3'
    >>> [said_of(each) for each in (lambda: 1 < 0, lambda: max(2, 3) < 0)]
    ['lambda: 1 < 0', 'lambda: max(2, 3) < 0']
    """
    try:
        source = " ".join(inspect.getsource(condition).split())
    except (OSError, TypeError):
        return getattr(condition, "__name__", repr(condition))
    lambdas = list(_lambdas_in(source))
    if not lambdas:
        return condition.__name__
    meant = condition.__code__
    return next((said for said in lambdas if _means(said, meant)), lambdas[0])


def _lambdas_in(source: str) -> Iterator[str]:
    """Every lambda of a source, up to the bracket or comma that is not its own."""
    for found in re.finditer(r"\blambda\b", source):
        text, depth = source[found.start() :], 0
        arguments = True
        for place, sign in enumerate(text):
            depth += (sign in "([{") - (sign in ")]}")
            arguments = arguments and sign != ":"
            if depth < 0 or (sign == "," and depth == 0 and not arguments):
                text = text[:place]
                break
        yield text.rstrip()


def _means(said: str, code: CodeType) -> bool:
    """Whether a lambda may be that of a code: the same names and constants in it."""
    try:
        (own,) = (
            each for each in compile(said, "", "eval").co_consts if isinstance(each, CodeType)
        )
    except (SyntaxError, ValueError):
        return False
    return _content(own) == _content(code)


def _content(code: CodeType) -> tuple[set[str], list[str]]:
    inner = [each for each in code.co_consts if isinstance(each, CodeType)]
    names = {*code.co_names, *code.co_freevars}.union(*(_content(each)[0] for each in inner))
    plain = [repr(each) for each in code.co_consts if not isinstance(each, CodeType | str)]
    words = [each for each in code.co_consts if isinstance(each, str) and "<" not in each]
    return names, sorted({*plain, *words} - {"None"})
