"""The validated description of threats on the backbone: which, how often, from when to when."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Annotated, Final

from pydantic import AfterValidator, Field

from rail_world.line.description_base import Description, Number

from .frame_threats import Threat, ThreatRates


def _each_once(threats: tuple[Threat, ...]) -> tuple[Threat, ...]:
    twice = next((threat for threat, count in Counter(threats).items() if count > 1), None)
    if twice is not None:
        raise ValueError(f"{twice.value} comes twice")
    return threats


Threats = Annotated[
    tuple[Threat, ...], Field(min_length=1, max_length=100), AfterValidator(_each_once)
]
Rate = Annotated[Number, Field(ge=0.0, le=1.0)]
LongestDelay = Annotated[Number, Field(ge=0.0, le=3600.0)]
LONGEST_DELAY_S: Final = 3.0


class ThreatPeriod(Description):
    """Threats at work from and to a simulated time.

    Each strikes at ``rate`` per frame; a delay is uniform up to ``longest_delay_s``.
    """

    threats: Threats
    rate: Rate
    from_s: Number = Field(default=0.0, ge=0.0, le=1e9)
    to_s: Number = Field(default=1e9, ge=0.0, le=1e9)
    longest_delay_s: LongestDelay = LONGEST_DELAY_S

    def acts(self, time_s: float) -> bool:
        """Whether it is there at a simulated time [s]."""
        return self.from_s <= time_s < self.to_s


class ThreatsDescription(Description):
    """What an intruder does to the frames on the backbone."""

    periods: tuple[ThreatPeriod, ...]


def rates_at(periods: Iterable[ThreatPeriod], time_s: float) -> tuple[ThreatRates, float]:
    """Rates at a simulated time [s], and the longest delay [s].

    Periods that overlap strike independently of each other: a frame escapes a threat only if it
    escapes it in each. The longest of their delays counts.
    """
    rates = dict.fromkeys(Threat, 0.0)
    longest_s = 0.0
    for period in periods:
        if not period.acts(time_s):
            continue
        for threat in period.threats:
            rates[threat] += period.rate * (1.0 - rates[threat])
        if Threat.DELAY in period.threats:
            longest_s = max(longest_s, period.longest_delay_s)
    return ThreatRates(**{threat.value: rate for threat, rate in rates.items()}), longest_s
