"""Simulated times at which a scenario switches equipment off and on again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

from .parameters import ParameterError, parameter
from .stamps import NANOSECONDS


@dataclass(frozen=True)
class OffTimeParameters:
    """Parameters that every equipment has beside its own."""

    off_from_s: tuple[float, ...] = parameter(
        (), "simulated times at which it is switched off", unit="s", low=0.0
    )
    off_to_s: tuple[float, ...] = parameter(
        (),
        "times at which it is switched on again and knows nothing of before, one for each",
        unit="s",
        low=0.0,
    )


@dataclass(frozen=True)
class OffTime:
    """Time for which equipment is switched off: at all stamps from its start on, before its end."""

    from_s: float
    to_s: float

    @property
    def from_ns(self) -> int:
        """Start [ns]."""
        return round(self.from_s * NANOSECONDS)

    @property
    def to_ns(self) -> int:
        """End [ns]."""
        return round(self.to_s * NANOSECONDS)

    def __str__(self) -> str:
        return f"switched off from {self.from_s:g} s to {self.to_s:g} s"


class OffTimes:
    """When one equipment is switched off.

    Parameters
    ----------
    times : iterable of OffTime
        In their order, apart from each other.
    """

    def __init__(self, times: Iterable[OffTime] = ()) -> None:
        self._times = tuple(times)

    def __bool__(self) -> bool:
        return bool(self._times)

    def at(self, stamp_ns: int) -> OffTime | None:
        """The time that a stamp falls into, None if it is on."""
        return next((t for t in self._times if t.from_ns <= stamp_ns < t.to_ns), None)

    def has_ended(self, after_ns: int, stamp_ns: int) -> bool:
        """Whether one has ended after a stamp, and not after a later one."""
        return any(after_ns < time.to_ns <= stamp_ns for time in self._times)


def off_times_of(p: OffTimeParameters) -> OffTimes:
    """Off times of the parameters.

    Raises
    ------
    ParameterError
        If they do not fit together.
    """
    if len(p.off_to_s) != len(p.off_from_s):
        raise ParameterError(f"off_to_s: {p.off_to_s}: one for each of off_from_s, {p.off_from_s}")
    times = [OffTime(*row) for row in zip(p.off_from_s, p.off_to_s, strict=True)]
    if any(not time.from_ns < time.to_ns for time in times):
        raise ParameterError(f"off_to_s: {p.off_to_s}: each must be after that of off_from_s")
    if any(one.to_ns >= other.from_ns for one, other in pairwise(times)):
        raise ParameterError(f"off_from_s: {p.off_from_s}: must be in order and apart")
    return OffTimes(times)
