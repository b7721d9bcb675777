"""Compiled sums of the solver: beside their plain form and beside NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from rail_signals.doppler.shift_kernel import Known, cost_profile, deepest_minima

KNOWN: Known = (3.0, 1e-4, 40.0, 0.5)


def profile_by_lstsq(
    rates: np.ndarray, received: np.ndarray, known: Known
) -> tuple[np.ndarray, np.ndarray]:
    """Cost and speed at each place from the whole least-squares problem."""
    mean_v, weight_v, mean_d, weight_d = known
    root = np.sqrt(np.append(received[:, 4], [weight_v, weight_d]))
    right = root * np.append(received[:, 3], [mean_v, mean_d])
    cost, speed = [], []
    for rate in rates.T:
        rows = np.column_stack([received[:, 5] * rate, received[:, 6]])
        matrix = root[:, None] * np.vstack([rows, np.eye(2)])
        best = np.linalg.lstsq(matrix, right)[0]
        cost.append(np.sum((right - matrix @ best) ** 2))
        speed.append(best[0])
    return np.array(cost), np.array(speed)


def drawn() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    rates = rng.uniform(-1.0, 1.0, (7, 40))
    stations = np.array([5, 0, 3])
    received = np.zeros((3, 7))
    received[:, 3] = rng.normal(scale=300.0, size=3)
    received[:, 4] = rng.uniform(0.5, 4.0, 3)
    received[:, 5:] = [[-8.7, 1.0], [-8.6, 0.99], [-8.8, 1.01]]
    return rates, stations, received


def test_a_profile_is_that_of_least_squares_at_each_place() -> None:
    rates, stations, received = drawn()
    standing, cost, speed = cost_profile(rates, stations, 4, 33, received, KNOWN, 0)
    wanted, speeds = profile_by_lstsq(rates[stations, 4:33], received, KNOWN)
    np.testing.assert_allclose(cost, wanted, rtol=1e-9, atol=1e-9 * standing)
    np.testing.assert_allclose(speed, speeds, rtol=1e-9)
    (still,), _ = profile_by_lstsq(np.zeros((3, 1)), received, (0.0, 1e30, *KNOWN[2:]))
    assert standing == pytest.approx(still + KNOWN[1] * KNOWN[0] ** 2)


def test_the_other_way_costs_what_standing_does() -> None:
    rates, stations, received = drawn()
    standing, both, speed = cost_profile(rates, stations, 0, 40, received, KNOWN, 0)
    _, forwards, _ = cost_profile(rates, stations, 0, 40, received, KNOWN, 1)
    assert 0 < np.sum(speed < 0) < 40
    np.testing.assert_array_equal(forwards, np.where(speed < 0, standing, both))


def test_compiled_is_the_plain_form() -> None:
    rates, stations, received = drawn()
    mine = cost_profile(rates, stations, 0, 40, received, KNOWN, 0)
    plain = cost_profile.py_func(rates, stations, 0, 40, received, KNOWN, 0)  # type: ignore[attr-defined]
    for a, b in zip(mine, plain, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * plain[0])


@pytest.mark.parametrize("most", [1, 2, 4])
def test_the_deepest_minima_come_first(most: int) -> None:
    rng = np.random.default_rng(6)
    for _ in range(50):
        cost = rng.integers(0, 12, 30).astype(np.float64)
        inner = np.flatnonzero((cost[1:-1] <= cost[:-2]) & (cost[1:-1] < cost[2:])) + 1
        wanted = inner[np.argsort(cost[inner], kind="stable")][:most]
        least, where = deepest_minima(cost, most)
        assert least == cost.min()
        assert where.tolist() == wanted.tolist()
