"""Which ticks of a run are recorded, which sampled, and which left alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from rail_corridor.errors import InputError

Phase = Literal["warm-up", "recorded", "plain", "sampled", "over"]

_WARM_UP: Final = 8
_RECORDED: Final = 8
_STRETCH: Final = 8
LEAST_TICKS: Final = _WARM_UP + _RECORDED + 2 * _STRETCH + 1


@dataclass(frozen=True)
class Schedule:
    """Phases of a run.

    After a warm-up and some ticks whose messages and calls are recorded, stretches take turns that
    are left alone and that are sampled: the machine's drift falls on both.

    Parameters
    ----------
    ticks : int
        Of the run.

    Raises
    ------
    InputError
        If the run is too short.
    """

    ticks: int

    def __post_init__(self) -> None:
        if self.ticks < LEAST_TICKS:
            reason = f"too short: {self.ticks} ticks, a profile takes {LEAST_TICKS} or more"
            raise InputError(reason, field="duration_s")

    def phase(self, tick: int) -> Phase:
        """Phase that a tick belongs to."""
        if tick < _WARM_UP:
            return "warm-up"
        tick -= _WARM_UP
        if tick < _RECORDED:
            return "recorded"
        pair, within = divmod(tick - _RECORDED, 2 * _STRETCH)
        # The last tick is not followed by another that would tell when it ended.
        pairs = (self.ticks - 1 - _WARM_UP - _RECORDED) // (2 * _STRETCH)
        if pair >= pairs:
            return "over"
        return "plain" if within < _STRETCH else "sampled"
