"""Timing: ticks of any length, inputs that are late."""

from __future__ import annotations

import pytest

from rail_testing import Late
from rail_testing.conformance.bench import Bench

REQUIREMENT = pytest.mark.requirement


@REQUIREMENT("node contract 2, One output per tick")
@REQUIREMENT("IEEE 1474.1 table 1, cycle times [M]")
@pytest.mark.parametrize("tick_s", [0.1, 0.25, 0.5, 1.0])
def test_ticks_may_be_of_any_length(bench: Bench, tick_s: float) -> None:
    """It works at ticks from 0.1 to 1 s."""
    bench.start(tick_s=tick_s)
    bench.run_until_working(bench.kind.starts_within_s, f"at ticks of {tick_s:g} s")
    bench.run(10.0)


@REQUIREMENT("node contract 2, One output per tick")
@REQUIREMENT("EN 50159 7.3.3, time-out [M]")
def test_an_input_that_is_late_costs_no_tick(bench: Bench) -> None:
    """An input comes a tick late, once: every tick is answered, and no claim is false."""
    bench.start(timeout_s=2.0)
    late = [name for name in bench.ports.inputs]
    if not late:
        pytest.skip("has no input but those that begin its tick")
    bench.run_until_working(bench.kind.starts_within_s, "after the start")
    count = iter(range(1000))
    bench.corridor.intercept(late[0], lambda m: Late(m) if next(count) == 0 else m)
    bench.run(2 * bench.tick_s, claims=False)
    bench.corridor.intercept(late[0], None)
    bench.run_until_working(bench.kind.recovers_within_s, "after a late input")
    bench.run(5.0)
