"""Which ticks of a run are recorded, which sampled, and which left alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

from rail_corridor.errors import InputError

Phase = Literal["warm-up", "recorded", "plain", "sampled", "over"]

_WARM_UP: Final = 8
#: Ticks of a stretch, and how many stretches are recorded at most.
_STRETCH: Final = 8
_MOST_RECORDED: Final = 8
#: A stretch of each phase, and a last tick, whose end no further one tells.
LEAST_TICKS: Final = _WARM_UP + 3 * _STRETCH + 1


@dataclass(frozen=True)
class Schedule:
    """Phases of a run, in stretches of some ticks.

    Stretches whose messages and calls are recorded are spread over the run. Between them stretches
    that are left alone and stretches that are sampled come in pairs. Which of a pair is first
    follows the sequence of Thue and Morse: the drift of the machine, and what happens periodically,
    falls on both alike.

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
            reason = f"too few ticks: a profile takes {LEAST_TICKS} or more"
            raise InputError(reason, field="duration_s", value=f"{self.ticks} ticks")

    @cached_property
    def stretches(self) -> tuple[Phase, ...]:
        """Phases of the stretches that follow the warm-up."""
        number = (self.ticks - 1 - _WARM_UP) // _STRETCH
        recorded = min(_MOST_RECORDED, number // 3)
        pairs = (number - recorded) // 2
        phases: list[Phase] = []
        for pair in range(pairs):
            if pair * recorded // pairs > (pair - 1) * recorded // pairs:
                phases.append("recorded")
            sampled_first = pair.bit_count() % 2 == 1
            phases += ("sampled", "plain") if sampled_first else ("plain", "sampled")
        return tuple(phases)

    def phase(self, tick: int) -> Phase:
        """Phase that a tick belongs to."""
        if tick < _WARM_UP:
            return "warm-up"
        stretch = (tick - _WARM_UP) // _STRETCH
        return self.stretches[stretch] if stretch < len(self.stretches) else "over"
