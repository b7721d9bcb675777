"""The cost of a place, its step and its minimum."""

from __future__ import annotations

import numpy as np
import pytest

from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.doppler.shift_cost import ShiftCost
from rail_signals.doppler.shift_kernel import Unknowns, inverse
from rail_signals.doppler.surveyed_line import SurveyedLine
from rail_signals.doppler.tone_plan import TonePlan

PLAN = TonePlan()
TRUTH = (230.0, 41.0, 300.0)
STATIONS = np.array([[-500.0, 20.0, 6.0], [100.0, -20.0, 6.0], [700.0, 20.0, 6.0], [1300, -20, 6]])


def cost_of(noise_hz: np.ndarray) -> ShiftCost:
    s = np.arange(-1000.0, 2001.0, 5.0)
    line = SurveyedLine(s, s, 1e-4 * s**2, 0.0 * s, np.arctan(2e-4 * s))
    per_mps = -PLAN.carrier_hz / SPEED_OF_LIGHT_M_PER_S
    at, v, delta = TRUTH
    way = v * PLAN.averaging_time_s
    rate = line.rates(STATIONS, [at - way, at + way]).mean(axis=0)
    shift = per_mps * v * rate + delta + noise_hz
    rows = [[*station, z, 4.0, per_mps, 1.0] for station, z in zip(STATIONS, shift, strict=True)]
    return ShiftCost(line, np.array(rows), PLAN.averaging_time_s, (40.0, 1e-4, 0.0, 1e-6))


def test_the_truth_costs_what_the_priors_do() -> None:
    cost = cost_of(np.zeros(4))
    assert cost(TRUTH) == pytest.approx(1e-4 * 1.0**2 + 1e-6 * 300.0**2)
    assert cost((TRUTH[0] + 20.0, *TRUTH[1:])) > cost(TRUTH) + 1.0


def test_a_step_is_that_of_the_derivatives() -> None:
    """The normal matrix and the force against central differences of the cost."""
    cost = cost_of(np.array([0.3, -0.2, 0.1, 0.4]))
    at = (228.0, 41.3, 298.0)
    step, predicted, normal = cost.step(at)
    full = np.array(
        [
            [normal[0], normal[1], normal[2]],
            [normal[1], normal[3], normal[4]],
            [normal[2], normal[4], normal[5]],
        ]
    )
    size = (1e-3, 1e-4, 1e-3)
    for axis in range(3):
        sides: list[Unknowns] = []
        for sign in (1.0, -1.0):
            moved = list(at)
            moved[axis] += sign * size[axis]
            sides.append((moved[0], moved[1], moved[2]))
        slope = (cost(sides[0]) - cost(sides[1])) / (2.0 * size[axis])
        assert -2.0 * (full @ step)[axis] == pytest.approx(slope, rel=1e-3)
    assert predicted == pytest.approx(cost(at) - np.array(step) @ full @ np.array(step))


def test_the_minimum_is_found_from_afar_and_only_in_the_window() -> None:
    cost = cost_of(np.zeros(4))
    found = cost.minimum((260.0, 35.0, 0.0), (0.0, 500.0), np.inf)
    assert found is not None
    assert found.at[0] == pytest.approx(TRUTH[0], abs=0.02)
    assert found.cost <= cost(TRUTH) + 1e-6
    assert cost.minimum((260.0, 35.0, 0.0), (250.0, 500.0), np.inf) is None
    # What costs more than another place does is not followed to its end.
    assert cost.minimum((260.0, 35.0, 0.0), (0.0, 500.0), 0.0) is None


def test_an_inverse_is_one_and_of_a_singular_matrix_infinite() -> None:
    rows = np.random.default_rng(3).standard_normal((5, 3)) * np.array([1e-3, 1.0, 1e3])
    a = rows.T @ rows
    found = inverse((a[0, 0], a[0, 1], a[0, 2], a[1, 1], a[1, 2], a[2, 2]))
    wanted = np.linalg.inv(a)[np.triu_indices(3)]
    np.testing.assert_allclose(found, wanted, rtol=1e-9)
    assert np.isinf(inverse((1.0, 1.0, 0.0, 1.0, 0.0, 1.0))).all()
    assert np.isinf(inverse((0.0, 0.0, 0.0, 1.0, 0.0, 1.0))).all()
