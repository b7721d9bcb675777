"""Figures, intervals and rules: against closed forms and by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, poisson

from rail_corridor.errors import InputError
from rail_corridor.study.figures import Figure, OverRuns, figure_of, places_of
from rail_corridor.study.intervals import estimate
from rail_corridor.study.model import Events, HalfWidth, Stop
from rail_corridor.study.stopping import Stopping

REPORT = {
    "ticks": 10,
    "complete": True,
    "digest": "abc",
    "failures": [{"node": "/a"}, {"node": "/b"}],
    "trains": {"a": {"gap_m": 3.0, "atp": None}, "b": {"gap_m": None, "atp": {"trips": 2}}},
}


@pytest.mark.parametrize(
    ("place", "take", "value"),
    [
        ("ticks", "value", 10.0),
        ("complete", "value", 1.0),
        ("failures.*.node", "count", 2.0),
        ("trains.*.gap_m", "min", 3.0),
        ("trains.*.gap_m", "sum", 3.0),
        ("trains.*.atp.trips", "max", 2.0),
        ("trains.a.atp.trips", "value", None),
    ],
)
def test_a_figure_is_found_by_its_place(place: str, take: str, value: float | None) -> None:
    assert figure_of("x", Figure(of=place, take=take), REPORT) == value  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("tick", "the report has no tick there, did you mean ticks"),
        ("trains.*.gap", "has no gap there, did you mean gap_m"),
        ("trains.*.gap_m", "is many values"),
        ("digest", "is no number"),
    ],
)
def test_a_place_that_there_is_not_is_one_line(place: str, said: str) -> None:
    with pytest.raises(InputError, match=rf"^figures\.x: '{place.replace('*', '.')}': .*{said}"):
        figure_of("x", Figure(of=place), REPORT)


@pytest.mark.parametrize("figure", [Figure(must_be=0), Figure(at_most=0), Figure(at_least=1)])
def test_what_must_hold_is_violated_by_what_is_not_known(figure: Figure) -> None:
    assert figure.violated_by(None) and figure.violated_by(math.nan)
    assert figure.violated_by(0.5)
    assert not figure.violated_by(1.0 if figure.at_least else 0.0)


def test_a_proportion_is_of_what_is_0_or_1() -> None:
    figure = Figure(of="trains.*.gap_m", take="max", over_runs="proportion")
    with pytest.raises(
        InputError, match=r"figures\.x: .*is 3 in a run: a proportion is of what is 0"
    ):
        figure_of("x", figure, REPORT)
    assert figure_of("complete", Figure(over_runs="proportion"), REPORT) == 1.0


def test_every_place_of_a_report_is_listed_and_can_be_read() -> None:
    places = places_of(REPORT)
    assert places == {
        "ticks": 10,
        "complete": True,
        "trains.*.gap_m": 3.0,
        "trains.*.atp": None,
        "trains.*.atp.trips": 2,
    }
    for place in places:
        figure_of("x", Figure(of=place, take="count"), REPORT)


def test_the_interval_of_a_proportion_is_exact() -> None:
    values = [1.0] * 3 + [0.0] * 17
    found = estimate(values, "proportion")
    assert found.value == 0.15
    # Clopper and Pearson: the probability of as many or more at the low end is 2.5 %.
    assert binom.sf(2, 20, found.low) == pytest.approx(0.025)
    assert binom.cdf(3, 20, found.high) == pytest.approx(0.025)
    assert estimate([0.0] * 9, "proportion").low == 0.0
    assert estimate([1.0] * 9, "proportion").high == 1.0


def test_the_interval_of_a_mean_holds_it_in_19_of_20() -> None:
    rng = np.random.default_rng(3)
    draws = rng.normal(5.0, 2.0, (2000, 8))
    hits = sum((e := estimate(row.tolist(), "mean")).low <= 5.0 <= e.high for row in draws)
    assert hits / 2000 == pytest.approx(0.95, abs=4 * math.sqrt(0.95 * 0.05 / 2000))


def test_a_proportion_of_sums_is_that_of_all_trials() -> None:
    found = estimate([1.0, 0.0, 2.0], "proportion", per=[10.0, 5.0, 5.0])
    assert found == replace(estimate([1.0] * 3 + [0.0] * 17, "proportion"), runs=3)
    assert math.isnan(estimate([3.0], "proportion", per=[2.0]).value)


def test_the_interval_of_a_rate_is_exact() -> None:
    found = estimate([4.0, 6.0], "rate", per=[1.0, 1.0])
    assert found.value == 5.0
    # Garwood: a count as large or larger has 2.5 % at the low end, as small or smaller at the high.
    assert poisson.sf(9, 2.0 * found.low) == pytest.approx(0.025)
    assert poisson.cdf(10, 2.0 * found.high) == pytest.approx(0.025)
    assert estimate([0.0], "rate", per=[2.0]).high == pytest.approx(3.689 / 2.0, rel=1e-3)


@pytest.mark.parametrize(("how", "share"), [("median", 0.5), ("p90", 0.9)])
def test_the_interval_of_a_quantile_holds_it_in_19_of_20(how: OverRuns, share: float) -> None:
    rng = np.random.default_rng(5)
    true = -math.log(1.0 - share)
    draws = rng.exponential(size=(2000, 60))
    hits = sum((e := estimate(row.tolist(), how)).low <= true <= e.high for row in draws)
    assert 0.94 < hits / 2000 <= 0.985
    assert math.isnan(estimate([1.0, 2.0, 3.0], how).low)


def test_what_is_not_known_counts_for_nothing() -> None:
    assert estimate([1.0, math.nan, 3.0], "mean").value == 2.0
    assert estimate([math.nan], "sum").runs == 0


def test_a_cell_ends_with_the_same_run_however_they_come_in() -> None:
    figures = {"errors": Figure(over_runs="sum")}
    rule = Stop(events=Events(figure="errors", count=5))
    for order in ([0, 1, 2, 3, 4, 5], [5, 3, 1, 4, 2, 0], [2, 0, 5, 1, 4, 3]):
        stopping = Stopping(rule, figures, runs=100)
        for run in order:
            stopping.add(run, {"errors": 2.0})
        assert stopping.ended == 3


def test_a_narrow_interval_ends_a_cell_and_failures_do_not_count() -> None:
    figures = {"x": Figure(), "p": Figure(over_runs="proportion")}
    stopping = Stopping(Stop(half_width=HalfWidth(figure="x", below=0.5)), figures, runs=1000)
    rng = np.random.default_rng(4)
    run, known = 0, []
    while stopping.ended is None:
        value = float(rng.normal())
        known += [value] if run % 3 else []
        stopping.add(run, {"x": value} if run % 3 else None)
        run += 1
    # As soon as it is narrow: 1.96 / sqrt(n) is 0.5 for n = 16, and two of three runs count.
    assert estimate(known, "mean").half_width <= 0.5 < estimate(known[:-1], "mean").half_width
    assert 15 < stopping.ended < 40
    most = Stopping(Stop(), figures, runs=7)
    for run in range(7):
        assert most.ended is None
        most.add(run, {"x": 0.0})
    assert most.ended == 7


def test_the_interval_of_a_rate_holds_it_also_where_events_come_in_clusters() -> None:
    rng = np.random.default_rng(8)
    held = plain = 0
    for _ in range(400):
        # Each event of a run brings three more: four times Poisson's variance.
        counts = 4.0 * rng.poisson(3.0, 24)
        found = estimate(counts, "rate", np.full(24, 0.16))
        held += found.low <= 12.0 / 0.16 <= found.high
        reach = 1.96 * math.sqrt(counts.sum()) / (24 * 0.16)
        plain += abs(found.value - 12.0 / 0.16) <= reach
    assert held >= 0.91 * 400 > plain
    # Where they come evenly, it is Poisson's.
    even = estimate([3.0] * 24, "rate", [0.16] * 24)
    assert even.low == pytest.approx(estimate([72.0], "rate", [3.84]).low)
