"""Phases of a run that is profiled."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import pytest

from rail_corridor.errors import InputError
from rail_corridor.studies.tick_profile.schedule import LEAST_TICKS, Schedule


@pytest.mark.parametrize("ticks", [LEAST_TICKS, 57, 200, 480, 28_800])
def test_as_many_ticks_are_sampled_as_left_alone_and_the_last_is_neither(ticks: int) -> None:
    schedule = Schedule(ticks)
    phases = [schedule.phase(tick) for tick in range(ticks)]
    count = Counter(phases)
    assert count["plain"] == count["sampled"] > 0
    assert 0 < count["recorded"] <= 64
    assert phases[0] == "warm-up"
    assert phases[-1] == "over"


def test_stretches_that_are_recorded_are_spread_over_the_run() -> None:
    stretches = Schedule(480).stretches
    places = [index for index, phase in enumerate(stretches) if phase == "recorded"]
    assert len(places) == 8
    apart = [after - before for before, after in pairwise(places)]
    assert max(apart) - min(apart) <= 2
    assert places[-1] > 0.8 * len(stretches)


@pytest.mark.parametrize("every", [16, 20, 40])
def test_what_happens_periodically_falls_on_both(every: int) -> None:
    schedule = Schedule(4800)
    count = Counter(schedule.phase(tick) for tick in range(8, 4800, every))
    assert count["plain"] == pytest.approx(count["sampled"], rel=0.15)


def test_a_run_that_is_too_short_is_refused() -> None:
    with pytest.raises(InputError, match=f"{LEAST_TICKS - 1} ticks.*{LEAST_TICKS} or more"):
        Schedule(LEAST_TICKS - 1)
