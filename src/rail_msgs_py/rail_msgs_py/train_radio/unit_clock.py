"""The clock of a unit: it is wrong by an offset, drifts, and may jump."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.stamps import NANOSECONDS

#: What clocks show at the begin of a run but for their offsets [ns]: one that is late shows no
#: negative time.
EPOCH_NS: Final = 86_400 * NANOSECONDS
MOST_OFFSET_S: Final = 3600.0
MOST_DRIFT_PPM: Final = 1000.0


@dataclass(frozen=True)
class ClockParameters:
    """Parameters of the clock of a unit that has one of its own."""

    clock_from_s: tuple[float, ...] = parameter(
        (), "simulated times from which its clock is wrong", unit="s", low=0.0
    )
    clock_offset_s: tuple[float, ...] = parameter(
        (),
        "by how much it is ahead at each of these times",
        unit="s",
        low=-MOST_OFFSET_S,
        high=MOST_OFFSET_S,
    )
    clock_drift_ppm: tuple[float, ...] = parameter(
        (),
        "how much it gains from each of these times on",
        unit="ppm",
        low=-MOST_DRIFT_PPM,
        high=MOST_DRIFT_PPM,
    )


@dataclass(frozen=True)
class ClockFault:
    """From when a clock is wrong [s], by how much then [s], and how much it gains from then on."""

    from_s: float
    offset_s: float
    drift_ppm: float


class UnitClock:
    """What the clock of a unit shows.

    Parameters
    ----------
    faults : sequence of ClockFault
        In the order of their times; each holds until the next. Without any the clock is right.

    Examples
    --------
    >>> clock = UnitClock([ClockFault(0.0, 2.0, 100.0)])
    >>> (clock.read_ns(10_000_000_000) - EPOCH_NS) / 1e9
    12.001
    """

    def __init__(self, faults: Sequence[ClockFault] = ()) -> None:
        if any(one.from_s >= other.from_s for one, other in pairwise(faults)):
            raise ValueError("clock_from_s: must be in order")
        self._faults = [
            (round(f.from_s * NANOSECONDS), round(f.offset_s * NANOSECONDS), f.drift_ppm * 1e-6)
            for f in faults
        ]

    def read_ns(self, stamp_ns: int) -> int:
        """What it shows at a simulated time [ns]."""
        shown_ns = EPOCH_NS + stamp_ns
        for from_ns, offset_ns, drift in reversed(self._faults):
            if stamp_ns >= from_ns:
                return shown_ns + offset_ns + round(drift * (stamp_ns - from_ns))
        return shown_ns


def unit_clock_of(p: ClockParameters) -> UnitClock:
    """Clock of the parameters.

    Raises
    ------
    ParameterError
        If they do not fit together.
    """
    rows = (p.clock_from_s, p.clock_offset_s, p.clock_drift_ppm)
    if len({len(row) for row in rows}) > 1:
        raise ParameterError(f"clock_offset_s: {p.clock_offset_s}: one for each of clock_from_s")
    try:
        return UnitClock([ClockFault(*row) for row in zip(*rows, strict=True)])
    except ValueError as error:
        raise ParameterError(str(error)) from None
