"""The validated description of threats on the backbone: which, how often, from when to when."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Annotated

from pydantic import AfterValidator, Field

from rail_msgs_py.quantities import FAULT_BEGIN, FAULT_END
from rail_msgs_py.train_radio import quantities
from rail_world.line.description_base import Description, StrictFloat, range_of

from .frame_threats import Threat, ThreatRates


def _each_once(threats: tuple[Threat, ...]) -> tuple[Threat, ...]:
    twice = next((threat for threat, count in Counter(threats).items() if count > 1), None)
    if twice is not None:
        raise ValueError(f"{twice.value} comes twice")
    return threats


Threats = Annotated[
    tuple[Threat, ...], Field(min_length=1, max_length=100), AfterValidator(_each_once)
]


class ThreatPeriod(Description):
    """Threats at work from and to a simulated time.

    Each strikes at ``rate`` per frame; a delay is uniform up to ``longest_delay_s``.
    """

    threats: Threats
    rate: Annotated[StrictFloat, range_of(quantities.THREAT_RATE)]
    from_s: Annotated[StrictFloat, range_of(FAULT_BEGIN)]
    to_s: Annotated[StrictFloat, range_of(FAULT_END)]
    longest_delay_s: Annotated[StrictFloat, range_of(quantities.LONGEST_DELAY)]

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
