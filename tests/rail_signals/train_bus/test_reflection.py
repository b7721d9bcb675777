"""Reflections against the figures of the source document (S2, equation 23)."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_signals.train_bus.reflection import (
    load_from_reflection,
    reflection_coefficient,
    return_loss_db,
)


def test_open_short_matched() -> None:
    rho = reflection_coefficient([math.inf, 0.0, 120.0], 120.0)
    assert rho.tolist() == [1.0, -1.0, 0.0]
    assert return_loss_db(rho).tolist() == [0.0, 0.0, math.inf]


@pytest.mark.parametrize(
    ("line_ohm", "load_ohm", "loss_db"),
    [(105, 95, 26.02), (105, 115, 26.85), (120, 95, 18.69), (120, 115, 33.44)],
)
def test_the_limits_of_the_tables(line_ohm: float, load_ohm: float, loss_db: float) -> None:
    loss = float(return_loss_db(reflection_coefficient(load_ohm, line_ohm)))
    assert loss == pytest.approx(loss_db, abs=0.005)


@given(st.floats(0, 1e4), st.floats(-1e4, 1e4), st.floats(1, 1e3))
def test_there_and_back(resistance: float, reactance: float, line_ohm: float) -> None:
    load = complex(resistance, reactance)
    rho = complex(reflection_coefficient(load, line_ohm))
    assert abs(rho) <= 1 + 1e-12
    if abs(1 - rho) > 1e-6:
        assert complex(load_from_reflection(rho, line_ohm)) == pytest.approx(
            load, rel=1e-6, abs=1e-6
        )


def test_a_reflection_of_one_is_open() -> None:
    assert math.isinf(complex(load_from_reflection(1.0, 120.0)).real)
    with pytest.raises(ValueError, match=r"impedance_ohm must be .*0"):
        reflection_coefficient(1.0, 0)
    with pytest.raises(ValueError, match=r"load_ohm must not be below 0, got -1"):
        reflection_coefficient(-1, 120.0)
