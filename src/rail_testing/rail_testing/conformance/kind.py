"""What the tests have to know of a kind of equipment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isnan
from typing import Any, ClassVar

from rail_msgs_py.topics.topic import Topic

#: The bench, which knows kinds: `rail_testing.conformance.bench.Bench`.
Bench = Any


@dataclass(frozen=True)
class ValueRange:
    """What a column of a table may hold.

    Parameters
    ----------
    low, high : float
        Bounds, which belong to it.
    unknown : tuple of float
        What else stands for a value that is not known, such as NaN.
    values : tuple of float, optional
        All that it may be, if they are few.
    """

    low: float = -inf
    high: float = inf
    unknown: tuple[float, ...] = ()
    values: tuple[float, ...] = ()

    def holds(self, value: float) -> bool:
        """Whether a value is in range.

        >>> ValueRange(0.0, 5.0, unknown=(float("nan"),)).holds(float("nan"))
        True
        """
        if isnan(value):
            return any(isnan(each) for each in self.unknown)
        if self.values:
            return value in self.values
        return self.low <= value <= self.high or value in self.unknown

    def __str__(self) -> str:
        said = f"one of {self.values}" if self.values else f"from {self.low:g} to {self.high:g}"
        return f"{said} or {self.unknown}" if self.unknown else said


#: 1 = true, 0 = false.
FLAG = ValueRange(values=(0.0, 1.0))


@dataclass(frozen=True)
class Ports:
    """Topics of one piece of equipment, by their names.

    Parameters
    ----------
    triggers : mapping
        Inputs that begin its tick: they are never missing.
    inputs : mapping
        The others.
    outputs : mapping
    """

    triggers: Mapping[str, Topic]
    inputs: Mapping[str, Topic]
    outputs: Mapping[str, Topic]

    @property
    def heard(self) -> dict[str, Topic]:
        """All inputs."""
        return {**self.triggers, **self.inputs}


class EquipmentKind:
    """One kind of equipment: where it is run, what it says, and what of that can be judged.

    Words that are returned say what is wrong; they are empty if nothing is.
    """

    #: As on the command line.
    name: ClassVar[str]
    #: In a sentence.
    title: ClassVar[str]
    #: Kind of the nodes of a plan.
    node_kind: ClassVar[str]
    #: Scenario in which it is run unless another is given.
    scenario: ClassVar[Mapping[str, Any]]
    #: Ranges of the columns of its tables.
    ranges: ClassVar[Mapping[str, Mapping[str, ValueRange]]] = {}
    #: Simulated time after which it works when it has been started [s].
    starts_within_s: ClassVar[float] = 20.0
    #: Simulated time within which it works again after a fault has gone [s].
    recovers_within_s: ClassVar[float] = 60.0
    #: Simulated time after which it has noticed that what it hears is of no use [s].
    notices_within_s: ClassVar[float] = 5.0

    def ports(self, bench: Bench) -> Ports:
        """Topics of the one under test."""
        raise NotImplementedError

    def peers(self, bench: Bench) -> tuple[str, ...]:
        """Full names of nodes without which it has to do for a while."""
        return ()

    def working(self, bench: Bench) -> bool:
        """Whether it does its work, as it should where nothing is wrong."""
        raise NotImplementedError

    def false_claim(self, bench: Bench) -> str:
        """What it claims in the last tick and is not so."""
        raise NotImplementedError

    def knows_too_much(self, bench: Bench) -> str:
        """What it says in its first tick after a restart and cannot know yet."""
        return ""

    def not_silent(self, bench: Bench) -> str:
        """What it does although it is switched off."""
        raise NotImplementedError

    def believes_garbage(self, bench: Bench) -> str:
        """What it claims although it has heard nothing of use for a while."""
        return ""
