"""The watch over a train's bus: interprets what has changed, confirms it, follows its growth.

To interpret a reflectogram takes a tenth of a second, to see that it is the same as the last one
interpreted takes next to nothing. With d the difference of two means of n traces of N samples
each and noise sigma, a line that has not changed has

    sum d^2 / (2 sigma^2 / n)  ~  chi-square(N),

so what lies within 5 standard deviations of N is taken for the same. The reference is always what
was interpreted last: slow growth adds up until it is seen.

A fault is held to be there when two measurements in a row have found one, and to be gone when two
in a row have not; the second is taken at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from rail_signals.train_bus.fault_words import fault_words, size_of
from rail_signals.train_bus.tdr.interpretation import Finding
from rail_signals.train_bus.tdr.reflectometer import Reflectogram
from rail_signals.train_bus.tdr.traces import TraceSummary, summarise

_SAME_SIGMAS: Final = 5.0
#: Noise that has risen by this fraction makes an interpretation worth while.
_NOISIER: Final = 0.15
_MOST_KEPT: Final = 64
_GROWTH_POINTS: Final = 8


class TraceReading(Protocol):
    """What an interpretation says, as far as it matters here."""

    @property
    def finding(self) -> Finding | None:
        """The most probable fault."""

    @property
    def is_explained(self) -> bool:
        """Whether that explains the traces."""


@dataclass(frozen=True)
class Seen:
    """A fault as one measurement found it.

    Parameters
    ----------
    time_s
        When.
    kind, car, place_m, place_std_m
        As of `Finding`.
    size
        As of `rail_signals.train_bus.fault_words.size_of`; NaN where there is none.
    is_explained
        Whether it explains the traces.
    """

    time_s: float
    kind: str
    car: int
    place_m: float
    place_std_m: float
    size: float
    is_explained: bool

    def words(self) -> str:
        """The fault in words: what, where, how large."""
        doubt = "" if self.is_explained else ", or something like it"
        return fault_words(self.kind, self.car, self.place_m, self.size) + doubt


class BusWatch:
    """Follows one bus from measurement to measurement.

    Parameters
    ----------
    interpret
        Makes out what a reflectogram says.
    """

    def __init__(self, interpret: Callable[[Reflectogram], TraceReading]) -> None:
        self._interpret = interpret
        self._reference: TraceSummary | None = None
        self.measurements = self.interpretations = 0
        self.held: Seen | None = None
        self.reading: TraceReading | None = None
        self.trend: list[Seen] = []
        #: Whether the last measurement contradicted what is held: another should follow at once.
        self.is_in_doubt = False

    def take(self, time_s: float, traces: Reflectogram) -> bool:
        """Take a measurement; return whether it was interpreted."""
        self.measurements += 1
        summary = summarise(traces)
        if not (self.is_in_doubt or self._has_changed(summary)):
            return False
        self.interpretations += 1
        self._reference = summary
        self.reading = self._interpret(traces)
        self._judge(_seen(time_s, self.reading))
        return True

    def growth_per_s(self) -> float:
        """Growth of the fault that is held [its unit per second], NaN if it cannot be told yet.

        Least squares over the last measurements of its kind.
        """
        if self.held is None:
            return math.nan
        same = [seen for seen in self.trend if seen.kind == self.held.kind][-_GROWTH_POINTS:]
        times = np.array([seen.time_s for seen in same])
        sizes = np.array([seen.size for seen in same])
        if len(same) < 3 or not np.isfinite(sizes).all() or np.ptp(times) <= 0.0:
            return math.nan
        apart = times - times.mean()
        return float(apart @ sizes / (apart @ apart))

    def _has_changed(self, now: TraceSummary) -> bool:
        before = self._reference
        if before is None or now.change is not None or before.change is not None:
            return True
        if len(now.mean) != len(before.mean):
            return True
        if abs(now.noise_rms / before.noise_rms - 1.0) > _NOISIER:
            return True
        variance = before.noise_rms**2 * (1.0 / now.traces + 1.0 / before.traces)
        chi_square = float(np.sum(np.square(now.mean - before.mean))) / variance
        samples = len(now.mean)
        return chi_square > samples + _SAME_SIGMAS * math.sqrt(2.0 * samples)

    def _judge(self, seen: Seen | None) -> None:
        """Believe what has been said twice in a row."""
        contradicts = (seen is None) != (self.held is None)
        if contradicts and not self.is_in_doubt:
            self.is_in_doubt = True
            return
        self.is_in_doubt = False
        self.held = seen
        if seen is not None:
            self.trend.append(seen)
            del self.trend[:-_MOST_KEPT]


def _seen(time_s: float, reading: TraceReading) -> Seen | None:
    """What a reading has found."""
    finding = reading.finding
    if finding is None:
        return None
    return Seen(
        time_s,
        finding.kind,
        finding.car,
        finding.place_m,
        finding.place_std_m,
        size_of(finding),
        reading.is_explained,
    )
