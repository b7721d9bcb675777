"""Conditions of a test: what they say of themselves when they do not hold."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
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
    """
    try:
        source = " ".join(inspect.getsource(condition).split())
    except (OSError, TypeError):
        return getattr(condition, "__name__", repr(condition))
    if "lambda" not in source:
        return condition.__name__
    text = source[source.index("lambda") :]
    # Up to the bracket or comma that is not the lambda's own.
    depth = 0
    for place, sign in enumerate(text):
        if sign in "([{":
            depth += 1
        elif sign in ")]}":
            depth -= 1
        if depth < 0 or (sign == "," and depth == 0):
            return text[:place]
    return text
