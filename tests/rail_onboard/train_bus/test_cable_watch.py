"""The watch over a bus: interprets what changed, believes what was said twice, follows growth."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest

from rail_onboard.train_bus.cable_watch import BusWatch, Seen
from rail_signals.train_bus.fault_words import SIZES
from rail_signals.train_bus.faults import KINDS
from rail_signals.train_bus.tdr.interpretation import Finding
from rail_signals.train_bus.tdr.reflectometer import Reflectogram

TIME_S = np.arange(600) * 5e-9
SIGMA = 1e-3


def finding(size: float = 10.0, place_m: float = 94.0, kind: str = "bad_splice") -> Finding:
    name = SIZES[kind][0] or "place_m"
    return Finding(kind, 1, place_m, 0.1, {name: size}, 1.0)


@dataclass
class Said:
    finding: Finding | None
    is_explained: bool = True


@dataclass
class Script:
    """An interpretation that says what it is told to say, and counts how often it is asked."""

    says: Iterator[Finding | None]
    asked: list[Reflectogram] = field(default_factory=list)

    def __call__(self, traces: Reflectogram) -> Said:
        self.asked.append(traces)
        return Said(next(self.says))


def measured(rng: np.random.Generator, step: float = 0.0, sigma: float = SIGMA) -> Reflectogram:
    """Eight traces of a line whose reflection is `step` from the middle on."""
    line = np.where(TIME_S > 1.5e-6, step, 0.0)
    return Reflectogram(TIME_S, line + sigma * rng.standard_normal((8, len(TIME_S))))


def watch_of(*says: Finding | None) -> tuple[BusWatch, Script, np.random.Generator]:
    script = Script(iter(says))
    return BusWatch(script), script, np.random.default_rng(11)


def test_the_same_line_is_interpreted_once() -> None:
    watch, script, rng = watch_of(None)
    read = [watch.take(float(k), measured(rng)) for k in range(60)]
    assert read == [True, *([False] * 59)]
    assert (watch.measurements, watch.interpretations, len(script.asked)) == (60, 1, 1)
    assert watch.held is None


def test_a_change_of_a_third_of_the_noise_is_seen_and_slow_growth_adds_up() -> None:
    watch, _, rng = watch_of(None, None)
    watch.take(0.0, measured(rng))
    assert watch.take(1.0, measured(rng, step=SIGMA))
    watch, script, rng = watch_of(*([None] * 40))
    for k in range(40):
        watch.take(float(k), measured(rng, step=5e-5 * k))
    # Nothing of it is seen from one measurement to the next, all of it in the long run.
    assert 2 <= len(script.asked) <= 8


def test_more_noise_and_traces_that_differ_are_changes() -> None:
    watch, _, rng = watch_of(None, None, None)
    watch.take(0.0, measured(rng))
    assert watch.take(1.0, measured(rng, sigma=1.3 * SIGMA))
    loose = np.outer(np.linspace(-1.0, 1.0, 8), np.where(TIME_S > 1.5e-6, 0.01, 0.0))
    rows = loose + SIGMA * rng.standard_normal(loose.shape)
    assert watch.take(2.0, Reflectogram(TIME_S, rows))


def test_a_fault_is_believed_when_it_was_found_twice_in_a_row() -> None:
    watch, _, rng = watch_of(None, finding(), None, finding(), finding())
    watch.take(0.0, measured(rng))
    assert watch.take(1.0, measured(rng, step=0.02))
    assert (watch.is_in_doubt, watch.held) == (True, None)
    assert watch.take(2.0, measured(rng, step=0.02))  # for the doubt, not for a change
    assert (watch.is_in_doubt, watch.held) == (False, None)
    watch.take(3.0, measured(rng, step=0.04))
    watch.take(4.0, measured(rng, step=0.04))
    assert watch.held == Seen(4.0, "bad_splice", 1, 94.0, 0.1, 10.0, True)
    assert not watch.is_in_doubt


def test_and_gone_when_it_was_missed_twice_in_a_row() -> None:
    watch, _, rng = watch_of(finding(), finding(), None, finding(), None, None)
    for k in range(2):
        watch.take(float(k), measured(rng, step=0.02))
    for k, gone in ((2, False), (3, False), (4, False), (5, True)):
        watch.take(float(k), measured(rng, step=0.02 * k))
        assert (watch.held is None) == gone
    assert len(watch.trend) == 2


def test_growth_is_the_slope_of_what_was_found() -> None:
    sizes = [2.0 + 0.5 * k for k in range(12)]
    watch, _, rng = watch_of(finding(2.0), *(finding(size) for size in sizes))
    watch.take(0.0, measured(rng, step=0.01))
    for k in range(12):
        assert math.isnan(watch.growth_per_s()) == (k < 3)
        watch.take(10.0 * (k + 1), measured(rng, step=0.02 * (k + 1)))
    assert watch.growth_per_s() == pytest.approx(0.05)
    assert [seen.size for seen in watch.trend] == sizes


def test_a_fault_in_words() -> None:
    assert set(SIZES) == set(KINDS)
    seen = Seen(0.0, "loose_connector", 1, 94.0, 0.0, 12.34, True)
    assert seen.words() == "loose connector behind car 2 at 94.0 m, 12 ohm"
    worse = Seen(0.0, "bad_splice", 1, 94.0, 0.0, 1234.0, True)
    assert worse.words() == "bad splice in car 2 at 94.0 m, 1200 ohm"
    wet = Seen(0.0, "water_ingress", 2, 100.26, 0.1, 0.151, False)
    assert wet.words() == (
        "water ingress in car 3 at 100.3 m, 15 % more capacitance, or something like it"
    )
    cut = Seen(0.0, "open", 0, 3.0, 0.0, math.nan, True)
    assert cut.words() == "open in car 1 at 3.0 m"
