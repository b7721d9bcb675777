"""Constants of a line against closed forms and the figures of the source document (S2)."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rail_signals.train_bus import cable_constants as cc

OMEGA = 2 * math.pi * 1e6


def test_the_worked_example() -> None:
    """S2 equations 19-22: 120 ohm and 65 pF/m; 13 ns."""
    velocity = float(cc.velocity_from_impedance(120.0, 65e-12))
    assert velocity == pytest.approx(1.282e8, abs=5e4)
    assert velocity / 299_792_458 == pytest.approx(0.428, abs=5e-4)
    inductance = float(cc.inductance_from_impedance(120.0, 65e-12))
    assert inductance == pytest.approx(0.936e-6, rel=1e-12)
    assert 1e3 / velocity == pytest.approx(7.8e-6, rel=1e-12)
    assert float(cc.lossless_impedance(inductance, 65e-12)) == pytest.approx(120.0)
    assert float(cc.lossless_velocity(inductance, 65e-12)) == pytest.approx(velocity)
    stub = float(cc.longest_stub_m(13e-9, velocity))
    assert stub == pytest.approx(0.1667, abs=5e-5)
    # With the velocity rounded to 128e6 m/s it is 166.4 mm; the document cuts it to 166.
    assert float(cc.longest_stub_m(13e-9, 128e6)) == pytest.approx(0.1664, abs=1e-9)
    assert float(cc.shortest_transition_s(1.0, velocity)) == pytest.approx(78e-9)


def test_one_velocity_factor_does_not_do_for_both() -> None:
    """0.66 at 120 ohm needs 42.1 pF/m; the example's 65 pF/m is 0.428."""
    assert float(cc.capacitance_from_velocity(120.0, 0.66)) == pytest.approx(42.1e-12, abs=5e-14)
    assert cc.VELOCITY_FACTORS["polyethylene"] == 0.66


def test_a_neper() -> None:
    assert float(cc.neper_to_db(1.0)) == pytest.approx(8.68589, abs=5e-6)
    assert float(cc.db_to_neper(cc.neper_to_db(0.37))) == pytest.approx(0.37)


@settings(max_examples=60)
@given(
    st.floats(1e2, 1e9),
    st.floats(1e-3, 10),
    st.floats(1e-8, 1e-5),
    st.floats(0, 1e-3),
    st.floats(1e-12, 1e-9),
)
def test_equation_9(
    frequency_hz: float, r: float, inductance: float, g: float, capacitance: float
) -> None:
    """``gamma^2 = (RG - w^2 LC) + j w (LG + RC)``, decaying forwards; (14) times it is Z."""
    series = cc.series_impedance(frequency_hz, r, inductance)
    shunt = cc.shunt_admittance(frequency_hz, g, capacitance)
    gamma = complex(cc.propagation_constant(series, shunt))
    impedance = complex(cc.characteristic_impedance(series, shunt))
    omega = 2 * math.pi * frequency_hz
    square = complex(
        r * g - omega**2 * inductance * capacitance, omega * (inductance * g + r * capacitance)
    )
    assert gamma**2 == pytest.approx(square, rel=1e-12)
    assert gamma.real > 0 and gamma.imag > 0 and impedance.real > 0
    assert gamma * impedance == pytest.approx(complex(series), rel=1e-12)
    # 2 alpha beta is the imaginary part of the square: no digit of the loss is lost.
    assert 2 * gamma.real * gamma.imag == pytest.approx(square.imag, rel=1e-13)


def test_little_loss_and_none() -> None:
    series = cc.series_impedance(1e6, 0.05, 0.936e-6)
    shunt = cc.shunt_admittance(1e6, 1e-7, 65e-12)
    gamma = complex(cc.propagation_constant(series, shunt))
    assert gamma.real == pytest.approx(float(cc.low_loss_attenuation(0.05, 1e-7, 120.0)), rel=1e-4)
    forward, backward = cc.phase_velocities(1e6, gamma.imag)
    assert float(forward) == pytest.approx(1.282e8, rel=1e-3)
    assert float(backward) == -float(forward)
    lossless = complex(
        cc.propagation_constant(
            cc.series_impedance(1e6, 0.0, 0.936e-6), cc.shunt_admittance(1e6, 0.0, 65e-12)
        )
    )
    assert lossless == pytest.approx(1j * OMEGA * math.sqrt(0.936e-6 * 65e-12))


@settings(max_examples=80)
@given(st.sampled_from([-1, 0, 1]), st.floats(-6, 6), st.sampled_from([-1, 0, 1]), st.floats(-6, 6))
def test_the_root(re: int, re_log: float, im: int, im_log: float) -> None:
    z = complex(re * 10**re_log, im * 10**im_log)
    root = complex(cc.complex_root(z))
    assert root.real >= 0
    assert root * root == pytest.approx(z, rel=1e-14, abs=1e-300)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: cc.velocity_from_impedance(0.0, 65e-12), "impedance_ohm must be .*0.0"),
        (lambda: cc.longest_stub_m(-1e-9, 1e8), "transition_time_s must be .*-1e-09"),
        (lambda: cc.capacitance_from_velocity(120.0, 1.1), "velocity_factor must not be above"),
        (lambda: cc.series_impedance(-1.0, 0.0, 0.0), "frequency_hz must be .*-1.0"),
        (lambda: cc.propagation_constant(-1.0, 1j), "series must be finite .*-1.0"),
        (lambda: cc.characteristic_impedance(1j, 0.0), "shunt must not be zero"),
        (lambda: cc.phase_velocities(1e6, math.nan), "phase_rad_per_m must be .*nan"),
    ],
)
def test_wrong_values_are_quoted(call: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()  # type: ignore[operator]


def test_arrays_broadcast() -> None:
    series = cc.series_impedance([1e5, 1e6], 0.05, 0.9e-6)
    assert series.shape == (2,)
    assert cc.propagation_constant(series, [1e-6j, 1e-5j]).shape == (2,)
