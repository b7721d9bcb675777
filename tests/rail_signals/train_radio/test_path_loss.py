"""Radio losses against their closed forms."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rail_signals.train_radio.path_loss import (
    Cutting,
    Tunnel,
    amplitude_gain,
    path_loss_db,
    section_loss_db,
)

TUNNEL = Tunnel(1000.0, 1600.0, entry_loss_db=10.0, loss_db_per_m=0.05)
SMOOTH = Tunnel(1000.0, 1600.0, entry_loss_db=10.0, loss_db_per_m=0.05, edge_m=40.0)
CUTTING = Cutting(-500.0, -100.0, wall_loss_db=8.0)
places = st.floats(-3000, 3000)


def test_free_space() -> None:
    """Friis: 20 log10(4 pi d f / c), 100.05 dB over 1 km at 2.4 GHz."""
    distance = np.array([1.0, 10.0, 1000.0, 20e3])
    expected = 20 * np.log10(4 * math.pi * distance * 2.4e9 / 299_792_458.0)
    np.testing.assert_allclose(path_loss_db(distance, 2.4e9), expected, rtol=1e-13)
    assert path_loss_db(1000.0, 2.4e9) == pytest.approx(100.05, abs=0.005)


@settings(max_examples=30)
@given(st.floats(1.5, 5), st.floats(1, 100), st.floats(1, 1e5))
def test_log_distance(exponent: float, reference_m: float, distance_m: float) -> None:
    loss = float(path_loss_db(distance_m, 2.4e9, exponent=exponent, reference_m=reference_m))
    power = exponent if distance_m > reference_m else 2.0
    free = 20 * math.log10(4 * math.pi * reference_m * 2.4e9 / 299_792_458.0)
    expected = free + 10 * power * math.log10(distance_m / reference_m)
    assert loss == pytest.approx(expected, abs=1e-9)


def test_the_loss_never_is_a_gain() -> None:
    loss = path_loss_db([0.0, 1e-9, 0.005, 0.01], 2.4e9)
    assert loss[:3].tolist() == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert loss[3] > 0


@settings(max_examples=30)
@given(places, places)
def test_a_tunnel(mast_m: float, train_m: float) -> None:
    portals = sum((mast_m < p) != (train_m < p) for p in (1000.0, 1600.0))
    inside = max(0.0, min(max(mast_m, train_m), 1600.0) - max(min(mast_m, train_m), 1000.0))
    expected = 10.0 * portals + 0.05 * inside
    assert float(TUNNEL.loss_db(mast_m, train_m)) == pytest.approx(expected, abs=1e-9)


@settings(max_examples=30)
@given(places, places)
def test_a_cutting(mast_m: float, train_m: float) -> None:
    within = [-500.0 <= x < -100.0 for x in (mast_m, train_m)]
    assert float(CUTTING.loss_db(mast_m, train_m)) == (8.0 if within[0] != within[1] else 0.0)


@settings(max_examples=30)
@given(places, places)
def test_mast_and_train_may_change_places(mast_m: float, train_m: float) -> None:
    sections = [TUNNEL, SMOOTH, CUTTING]
    there = section_loss_db(sections, mast_m, train_m)
    assert there == pytest.approx(section_loss_db(sections, train_m, mast_m), abs=1e-12)
    assert there == pytest.approx(sum(s.loss_db(mast_m, train_m) for s in sections))
    assert section_loss_db(sections, mast_m, mast_m) == 0


def test_smooth_edges_are_raised_cosines() -> None:
    train = np.array([979.0, 980.0, 990.0, 1000.0, 1010.0, 1020.0, 1100.0])
    step = 10.0 * np.array([0, 0, (1 - math.sqrt(0.5)) / 2, 0.5, (1 + math.sqrt(0.5)) / 2, 1, 1])
    inside = 0.05 * np.maximum(train - 1000.0, 0.0)
    np.testing.assert_allclose(SMOOTH.loss_db(0.0, train), step + inside, atol=1e-9)
    fine = SMOOTH.loss_db(0.0, np.arange(900.0, 1700.0, 0.1))
    assert np.abs(np.diff(fine)).max() < 0.1 * (0.05 + 10.0 * math.pi / 2 / 40.0) + 1e-9


def test_shapes_broadcast() -> None:
    loss = section_loss_db([TUNNEL, CUTTING], np.zeros((3, 1)), np.linspace(0, 2000, 5))
    assert loss.shape == (3, 5)
    assert section_loss_db([], np.zeros(4), 0.0).tolist() == [0.0] * 4


@settings(max_examples=30)
@given(st.floats(0, 300))
def test_amplitude_gain_is_the_root_of_the_power(loss_db: float) -> None:
    assert 20 * math.log10(float(amplitude_gain(loss_db))) == pytest.approx(-loss_db, abs=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: path_loss_db(-1.0, 2.4e9), "-1.0"),
        (lambda: path_loss_db(math.nan, 2.4e9), "nan"),
        (lambda: path_loss_db(1.0, 0.0), "0.0"),
        (lambda: path_loss_db(1.0, 2.4e9, exponent=-2.0), "-2.0"),
        (lambda: path_loss_db(1.0, 2.4e9, reference_m=math.inf), "inf"),
        (lambda: Tunnel(5.0, 5.0, 1.0, 0.1), "got 5.0"),
        (lambda: Tunnel(0.0, 5.0, -1.0, 0.1), "-1.0"),
        (lambda: Tunnel(0.0, 5.0, 1.0, math.nan), "nan"),
        (lambda: Cutting(0.0, 5.0, 1.0, edge_m=6.0), "6.0"),
        (lambda: Cutting(0.0, 5.0, math.inf), "inf"),
        (lambda: TUNNEL.loss_db(math.inf, 0.0), "inf"),
    ],
)
def test_bad_values_are_quoted(call: object, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        call()  # type: ignore[operator]
