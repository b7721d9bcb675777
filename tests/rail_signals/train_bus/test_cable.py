"""Kinds of cable: skin effect, and the figures known of train bus cable."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.profile import load_bus_profile

WTB = load_bus_profile("wtb").cable


def test_the_skin_effect_has_both_ends() -> None:
    """R at low frequency; S sqrt(f) and as much reactance where the skin is thin."""
    cable = Cable(1e-6, 60e-12, 0.05, 0.0, 3e-4)
    low, high = cable.internal_impedance(2j * math.pi * np.array([1e-3, 1e10]))
    assert low == pytest.approx(0.05, rel=1e-6)
    assert high == pytest.approx(3e-4 * 1e5 * (1 + 1j), rel=1e-4)
    # The internal inductance at low frequency: S^2 / (2 pi R).
    omega = 2 * math.pi * 10.0
    inductance = complex(cable.internal_impedance(1j * omega)).imag / omega
    assert inductance == pytest.approx(3e-4**2 / (2 * math.pi * 0.05), rel=1e-6)


def test_train_bus_cable() -> None:
    """At most 10, 13, 14 and 18 dB/km at 1, 1.5, 2, 3 MHz; a 47 m run loses about 0.47 dB."""
    loss = WTB.attenuation_db_per_m([1e6, 1.5e6, 2e6, 3e6]) * 1e3
    assert (loss <= [10, 13, 14, 18]).all()
    assert (loss > [9, 11, 13, 16]).all()
    assert float(WTB.attenuation_db_per_m(1e6)) * 47 == pytest.approx(0.47, abs=0.02)
    # So the limit of 15 dB for a run of 47 m catches gross faults only.
    assert float(WTB.attenuation_db_per_m(1e6)) * 47 < 15 / 30


def test_from_impedance() -> None:
    cable = Cable.from_impedance(120.0, 0.66)
    assert cable.impedance_ohm == pytest.approx(120.0)
    assert cable.velocity_m_per_s == pytest.approx(0.66 * 299_792_458)
    assert cable.capacitance_f_per_m == pytest.approx(42.1e-12, abs=5e-14)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inductance_h_per_m": 0.0}, "inductance_h_per_m must be .*0.0"),
        ({"capacitance_f_per_m": math.nan}, "capacitance_f_per_m must be .*nan"),
        ({"resistance_ohm_per_m": -1.0}, "resistance_ohm_per_m must be .*-1.0"),
        ({"skin_ohm_per_m_sqrt_hz": math.inf}, "skin_ohm_per_m_sqrt_hz must be .*inf"),
    ],
)
def test_what_a_cable_refuses(changes: dict[str, float], message: str) -> None:
    values = {"inductance_h_per_m": 1e-6, "capacitance_f_per_m": 60e-12}
    with pytest.raises(ValueError, match=message):
        Cable(**(values | changes))


def test_no_constants_without_admittance() -> None:
    with pytest.raises(ValueError, match="s must not be zero"):
        WTB.wave_constants([0.0])
