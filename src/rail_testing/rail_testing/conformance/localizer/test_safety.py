"""Safety of a localizer: its interval holds the front, also at the edge of what sensors claim."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, nan
from typing import Any

import pytest

from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import RELAYED_RANGE
from rail_msgs_py.topics.world import ODOMETER
from rail_testing.conformance.bench import Bench
from rail_testing.conformance.localizer.kind import KIND

REQUIREMENT = pytest.mark.requirement
#: Half-width over standard deviation of a normal error at a risk of 1e-4.
_LEAST_SIGMAS = 3.9
#: Part of its own claim by which a sensor errs: within it, so that the claim holds.
_EDGE = 0.9


def shift(bench: Bench, name: str, function: Callable[[Any], None]) -> None:
    """Change the first values of a table, behind its stamp."""

    def altered(message: Any) -> Any:
        data = message.data
        function(data)
        message.data = data
        return message

    bench.corridor.intercept(name, altered)


@REQUIREMENT("DESIGN, What a claim is: a stated integrity risk")
@REQUIREMENT("EN 50126, stated risk of a wrong position [M]")
def test_its_interval_is_as_wide_as_its_deviation_demands(bench: Bench) -> None:
    """Between both ends there are at least 3.9 of its own standard deviations on either side."""
    bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")

    def narrow() -> str:
        state = KIND.state(bench)
        if not KIND.working(bench):
            return ""
        half_m = 0.5 * float(state.high_m - state.low_m)
        if half_m >= _LEAST_SIGMAS * state.sigma_m:
            return ""
        return (
            f"its interval is ± {half_m:.2f} m, but its standard deviation {state.sigma_m:.2f} m "
            f"alone demands ± {_LEAST_SIGMAS * state.sigma_m:.2f} m"
        )

    bench.run(60.0, narrow)


@REQUIREMENT("DESIGN, What a claim is: withheld where it cannot be kept")
@pytest.mark.parametrize("side", [1.0, -1.0], ids=["ahead", "behind"])
def test_ranges_at_the_edge_of_their_claim(bench: Bench, side: float) -> None:
    """Every range errs by nine tenths of what is claimed for it: the interval holds the front."""
    bench.start()
    position, half = RELAYED_RANGE.index["position_m"], RELAYED_RANGE.index["half_m"]

    def err(data: Any) -> None:
        if isfinite(data[1 + position]) and isfinite(data[1 + half]):
            data[1 + position] += side * _EDGE * data[1 + half]

    names = [name for name, topic in bench.ports.inputs.items() if topic is RELAYED_RANGE]
    if not names:
        pytest.skip("is told no ranges")
    shift(bench, names[0], err)
    for name, topic in bench.ports.inputs.items():
        if topic is DOPPLER_FIX:
            shift(bench, name, _no_fix)
    bench.run(60.0)


def _no_fix(data: Any) -> None:
    data[1 + DOPPLER_FIX.index["reason"]] = 1.0


@REQUIREMENT("DESIGN, the claims of a train whose wheels slide")
@pytest.mark.parametrize("ratio", [0.5, 1.5], ids=["slide", "spin"])
def test_wheels_that_slide_or_spin(bench: Bench, ratio: float) -> None:
    """The wheels turn too slowly, or too fast, for six seconds: the interval holds the front."""
    bench.start()
    bench.run(25.0)
    distance, speed = ODOMETER.index["distance_m"], ODOMETER.index["speed_mps"]
    lost_m, last_m, sliding = 0.0, nan, True

    def slip(data: Any) -> None:
        nonlocal lost_m, last_m
        now_m = data[1 + distance]
        if sliding and isfinite(last_m):
            lost_m += (ratio - 1.0) * (now_m - last_m)
        last_m = now_m
        data[1 + distance] += lost_m
        if sliding:
            data[1 + speed] *= ratio

    shift(bench, ODOMETER.name(train=bench.place), slip)
    bench.run(6.0)
    sliding = False
    bench.run(20.0)


@REQUIREMENT("DESIGN, What a claim is: withheld where it cannot be kept")
def test_without_ranges_and_fixes_it_is_soon_unsure(bench: Bench) -> None:
    """On wheels alone its interval grows with the way, or it withdraws; it does not stay."""
    c = bench.start()
    bench.run(25.0)
    before = KIND.state(bench)
    width_m = float(before.high_m - before.low_m)
    for name, topic in bench.ports.inputs.items():
        if topic is RELAYED_RANGE:
            shift(bench, name, _no_range)
        else:
            shift(bench, name, _no_fix)
    begun_m = c.truth(bench.place).front_m
    bench.run(20.0)
    state, run_m = KIND.state(bench), c.truth(bench.place).front_m - begun_m
    if KIND.working(bench) and float(state.high_m - state.low_m) <= width_m:
        bench.refuse(
            f"its interval has not grown over {run_m:.0f} m without a range or a fix: "
            f"{state.high_m - state.low_m:.2f} m"
        )


def _no_range(data: Any) -> None:
    data[1], data[2], data[3] = float("nan"), float("nan"), float("inf")
