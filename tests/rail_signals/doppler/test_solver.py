"""Positions by Doppler shifts against the truth and the bound."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.doppler.bound import (
    position_bound_m,
    shift_information,
    shift_variance_hz2,
    tracked_bound_m,
)
from rail_signals.doppler.shift_kernel import line_frame
from rail_signals.doppler.solver import Answer, DopplerSolver, NoFixReason, Prior, speed_from_shift
from rail_signals.doppler.surveyed_line import SurveyedLine
from rail_signals.doppler.tone_plan import TonePlan
from rail_world.line.alignment import Alignment, Element

PLAN = TonePlan()
#: Standard deviation of the stations' oscillators.
STATION_HZ = 0.02
SPACING_M, ASIDE_M, REACH_M = 600.0, 20.0, 1500.0
ALIGNMENTS = {
    "straight": [Element.from_radii(4000.0, None, None)],
    "arc": [Element.from_radii(2400.0, 800.0, 800.0)],
    "mixed": [
        Element.from_radii(1500.0, None, None),
        Element.from_radii(200.0, None, 600.0),
        Element.from_radii(900.0, 600.0, 600.0),
        Element.from_radii(200.0, 600.0, None),
        Element.from_radii(1500.0, None, None),
    ],
}


def line_of(alignment: Alignment, step_m: float = 5.0) -> SurveyedLine:
    count = int(np.ceil(alignment.length_m / step_m)) + 1
    s = np.linspace(0.0, alignment.length_m, count)
    x, y, heading = alignment.pose(s)
    return SurveyedLine(s, x, y, np.zeros_like(s), heading)


class Setting:
    """A line with stations on both sides in turn, and the shifts that a train would measure."""

    def __init__(self, kind: str) -> None:
        self.line = line_of(Alignment(ALIGNMENTS[kind]))
        feet = np.arange(0.0, self.line.end_m + SPACING_M, SPACING_M)
        places, slopes, _ = self.line.at(np.minimum(feet, self.line.end_m))
        side = np.where(np.arange(feet.size) % 2, ASIDE_M, -ASIDE_M)
        self.stations = places + np.column_stack(
            [-side * slopes[:, 1], side * slopes[:, 0], np.full(feet.size, 6.0)]
        )
        self.slots = np.arange(feet.size) % PLAN.slots
        self.solver = DopplerSolver(PLAN, self.line, self.stations, self.slots)

    def shifts(
        self, s: float, v: float, offset_hz: float, snr: float, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stations, shifts and variances; `snr` per sample at the spacing."""
        distance = self.line.distances(self.stations, s)
        near = np.flatnonzero(distance < REACH_M)
        variance = shift_variance_hz2(PLAN, snr * (SPACING_M / distance[near]) ** 2) + STATION_HZ**2
        # The momentary shift, weighted as the block's is.
        t = np.linspace(-0.5, 0.5, 401)
        weight = 1.0 - (2.0 * t) ** 2
        rates = self.line.rates(self.stations[near], s + v * t * PLAN.duration_s)
        rate = weight @ rates / weight.sum()
        tone = np.array([PLAN.tone_hz(int(slot)) for slot in self.slots[near]])
        shift = -tone / SPEED_OF_LIGHT_M_PER_S * v * rate + tone / PLAN.carrier_hz * offset_hz
        return near, shift + rng.normal(size=near.size) * np.sqrt(variance), variance

    def bound(self, s: float, v: float, snr: float) -> float:
        distance = self.line.distances(self.stations, s)
        variance = shift_variance_hz2(PLAN, snr * (SPACING_M / distance) ** 2) + STATION_HZ**2
        found = position_bound_m(
            PLAN,
            self.line,
            self.stations,
            np.array([s]),
            v,
            variance[None],
            coverage_range_m=REACH_M,
            offset_sigma_hz=1e-6 * PLAN.max_offset_ppm * PLAN.carrier_hz,
            speed_sigma_mps=2.0 * PLAN.max_speed_mps,
        )
        return float(found[0])


@pytest.mark.parametrize("kind", ALIGNMENTS)
@pytest.mark.parametrize("speed_kmh", [20.0, 500.0])
@pytest.mark.parametrize("snr_db", [5.0, 25.0])
def test_errors_are_at_the_bound_wherever_a_position_is_given(
    kind: str, speed_kmh: float, snr_db: float
) -> None:
    setting, rng = Setting(kind), np.random.default_rng(5)
    v, snr = speed_kmh / 3.6, 10.0 ** (snr_db / 10.0)
    normalised, over_bound = [], []
    for _ in range(100):
        s = rng.uniform(30.0, setting.line.end_m - 30.0)
        offset_hz = rng.uniform(-1300.0, 1300.0)
        answer = setting.solver.solve(
            *setting.shifts(s, v, offset_hz, snr, rng), window_m=(s - 800.0, s + 900.0), direction=1
        )
        if answer.fix is None:
            continue
        fix = answer.fix
        error = np.array([fix.chainage_m - s, fix.speed_mps - v, fix.offset_hz - offset_hz])
        normalised.append(error @ np.linalg.solve(fix.covariance, error))
        over_bound.append((error[0] / setting.bound(s, v, snr)) ** 2)
        assert setting.line.start_m <= fix.chainage_m <= setting.line.end_m
    count = len(normalised)
    assert count > 8
    # Within 1.1 of the bound, as far as so many draws can tell.
    least, most = chi2.ppf([1e-4, 1.0 - 1e-4], count) / count
    assert least / 1.21 < np.mean(over_bound) < 1.21 * most
    # And the covariance is that of the errors.
    assert np.sum(normalised) < chi2.ppf(1.0 - 1e-5, 3 * count)


def solved(setting: Setting, s: float, v: float, **known: object) -> Answer:
    shifts = setting.shifts(s, v, 400.0, 1e3, np.random.default_rng(3))
    return setting.solver.solve(*shifts, **known)


def test_either_direction_is_found_where_the_offset_is_known() -> None:
    setting = Setting("mixed")
    for v in (30.0, -30.0):
        answer = solved(setting, 1700.0, v, offset=Prior(400.0, 0.5))
        assert answer.fix is not None
        assert answer.fix.chainage_m == pytest.approx(1700.0, abs=0.5)
        assert answer.fix.speed_mps == pytest.approx(v, abs=0.05)


def test_why_there_is_no_position() -> None:
    setting = Setting("straight")
    rng = np.random.default_rng(1)
    stations, shift, variance = setting.shifts(1700.0, 30.0, 0.0, 1e3, rng)
    one = setting.solver.solve(stations[:1], shift[:1], variance[:1])
    assert one == Answer(NoFixReason.TOO_FEW_STATIONS)
    assert solved(setting, 1700.0, 0.0).reason is NoFixReason.STANDSTILL
    broken = shift + np.where(np.arange(shift.size) == 2, 300.0, 0.0)
    window = (1300.0, 2100.0)
    wrong = setting.solver.solve(stations, broken, variance, window_m=window, direction=1)
    assert wrong.fix is None
    assert wrong.reason in (NoFixReason.INCONSISTENT, NoFixReason.OFF_TRACK, NoFixReason.GEOMETRY)
    outside = solved(setting, 1700.0, 30.0, window_m=(2000.0, 2300.0), direction=1)
    assert outside.fix is None
    few = setting.solver.solve(stations[:2], shift[:2], variance[:2], direction=1)
    assert few.fix is None


def test_noise_is_no_position() -> None:
    setting, rng = Setting("mixed"), np.random.default_rng(8)
    for _ in range(200):
        count = int(rng.integers(5, 8))
        shift = rng.uniform(-2500.0, 2500.0, count)
        answer = setting.solver.solve(np.arange(count), shift, np.full(count, 0.01), direction=1)
        assert answer.fix is None


def test_bad_input_is_refused() -> None:
    solver = Setting("straight").solver
    with pytest.raises(ValueError, match="must be finite"):
        solver.solve([0, 1], [np.nan, 1.0], [1.0, 1.0])
    with pytest.raises(ValueError, match="variances above zero"):
        solver.solve([0, 1], [1.0, 1.0], [1.0, 0.0])
    with pytest.raises(ValueError, match="numbers below"):
        solver.solve([0, 99], [1.0, 1.0], [1.0, 1.0])
    with pytest.raises(ValueError, match="shapes differ"):
        solver.solve([0, 1], [1.0], [1.0, 1.0])


def test_the_bound_is_that_of_the_documents_example() -> None:
    """FACTS: metres per hertz at 2.6 GHz and 300 km/h, speed unknown, stations at ±500 m."""
    s = np.arange(-1000.0, 1001.0, 5.0)
    line = SurveyedLine(s, s, 0.0 * s, 0.0 * s, 0.0 * s)
    wanted = {50.0: (49.7, 12.4, 1.04), 100.0: (13.0, 3.55, 0.48), 10.0: (1224.0, 295.0, 19.8)}
    for aside_m, values in wanted.items():
        stations = [[-500.0, aside_m, 0.0], [500.0, aside_m, 0.0]]
        bound = position_bound_m(
            PLAN, line, stations, [0.0, 250.0, 400.0], 300.0 / 3.6, 1.0, offset_sigma_hz=0.0
        )
        np.testing.assert_allclose(bound, values, rtol=5e-3)


def test_two_stations_and_an_unknown_offset_bound_nothing() -> None:
    s = np.arange(-1000.0, 1001.0, 5.0)
    line = SurveyedLine(s, s, 0.0 * s, 0.0 * s, 0.0 * s)
    stations = [[-500.0, 50.0, 0.0], [500.0, 50.0, 0.0]]
    assert np.isinf(position_bound_m(PLAN, line, stations, [100.0], 30.0, 1.0)).all()


def test_the_bound_of_a_run_lies_between_an_unknown_and_a_known_offset() -> None:
    """A walk without bound leaves every block alone; without walk the offset gets known."""
    s = np.arange(-1000.0, 1001.0, 5.0)
    line = SurveyedLine(s, s, 0.0 * s, 0.0 * s, 0.0 * s)
    stations = [[-500.0, 50.0, 0.0], [100.0, -50.0, 0.0], [500.0, 50.0, 0.0]]
    places = np.full(4000, 260.0)
    information = shift_information(PLAN, line, stations, places, 83.0, 1.0)
    given, alone = np.ones(places.size, bool), {"offset_sigma_hz": 1300.0, "speed_sigma_mps": 277.0}

    def tracked(walk_hz: float, given: np.ndarray = given) -> np.ndarray:
        return tracked_bound_m(information, given, walk_hz=walk_hz, **alone)

    def single(offset_sigma_hz: float) -> float:
        known = {"offset_sigma_hz": offset_sigma_hz, "speed_sigma_mps": 277.0}
        return float(position_bound_m(PLAN, line, stations, places[:1], 83.0, 1.0, **known).item())

    assert tracked(0.0)[0] == pytest.approx(single(1300.0), rel=1e-9)
    np.testing.assert_allclose(tracked(1e6), single(1300.0), rtol=1e-4)
    np.testing.assert_allclose(tracked(0.0, ~given), single(1300.0), rtol=1e-9)
    assert tracked(0.0)[-1] == pytest.approx(single(0.0), rel=2e-3)
    assert (np.diff(tracked(0.0)) < 0.0).all()
    # At rest: the variance that a walk of q feeds and a block of information J takes away.
    walk_hz = 0.5
    posterior = np.linalg.inv(information[0] + np.diag([0.0, 277.0**-2, 0.0]))[2, 2]
    prior = 0.5 * (walk_hz**2 + np.sqrt(walk_hz**4 + 4.0 * walk_hz**2 * posterior))
    assert tracked(walk_hz)[-1] == pytest.approx(single(float(np.sqrt(prior))), rel=1e-6)


def test_speed_from_position_and_shift() -> None:
    """Claim 7: 722.7 Hz at 300 km/h straight ahead."""
    assert speed_from_shift(PLAN, 5, 722.7, -1.0) * 3.6 == pytest.approx(300.0, rel=1e-4)
    assert speed_from_shift(PLAN, 5, 1022.7, -1.0, offset_hz=300.0) * 3.6 == pytest.approx(
        300.0, rel=1e-3
    )


def test_a_line_between_its_points_is_the_curve() -> None:
    alignment = Alignment(ALIGNMENTS["mixed"])
    line = line_of(alignment)
    s = np.linspace(0.0, alignment.length_m, 997)
    x, y, heading = alignment.pose(s)
    place, slope, _ = line.at(s)
    assert np.hypot(place[:, 0] - x, place[:, 1] - y).max() < 1e-4
    np.testing.assert_allclose(slope[:, 0], np.cos(heading), atol=1e-4)
    # One point at a time it is the same, past its ends too.
    for at_m in (-10.0, 0.0, 1499.3, 1623.7, line.end_m, line.end_m + 10.0):
        frame = line_frame(line.cubics, line.start_m, 1.0 / line.step_m, at_m)
        np.testing.assert_allclose(frame, np.ravel(line.at(at_m)), atol=1e-12)
    # Past its ends it goes on straight.
    beyond, _, _ = line.at([-10.0])
    np.testing.assert_allclose(beyond, [[-10.0, 0.0, 0.0]], atol=1e-9)
