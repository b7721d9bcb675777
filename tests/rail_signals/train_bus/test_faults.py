"""Faults: what each makes of a line, seen in its reflection."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.train_bus.bus_line import BusLine, CableSection, Coupler, Termination
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.cascade import input_impedance, input_reflection
from rail_signals.train_bus.faults import (
    KINDS,
    BadSplice,
    LooseConnector,
    MissingShieldGround,
    OpenCircuit,
    ShortCircuit,
    WaterIngress,
    WrongCable,
    place_of,
    split_at,
)

CABLE = Cable.from_impedance(120.0, 0.66, 0.05, 0.0, 2.7e-4)
COUPLER = Coupler(0.02, 80e-9, 10e-12)
LINE = BusLine((CableSection(CABLE, 20.0), COUPLER, CableSection(CABLE, 30.0)), Termination(120.0))
FREQUENCIES = np.array([1e4, 1e6, 1e7, 5e7])


def test_a_split_changes_nothing() -> None:
    elements, index = split_at(LINE, 33.0)
    assert index == 3
    assert BusLine(elements, LINE.termination).length_m == pytest.approx(50.0)
    np.testing.assert_allclose(
        input_reflection(BusLine(elements, LINE.termination), FREQUENCIES, 120.0),
        input_reflection(LINE, FREQUENCIES, 120.0),
        rtol=1e-10,
    )
    assert split_at(LINE, 20.0)[1] == 2
    assert split_at(LINE, 50.0)[1] == 3
    with pytest.raises(ValueError, match=r"place_m must lie within 0 and 50 m, got 50.1"):
        split_at(LINE, 50.1)


def test_open_and_short_cut_the_line_off() -> None:
    opened = OpenCircuit(33.0).apply(LINE)
    assert opened.length_m == pytest.approx(33.0)
    assert opened.termination == Termination()
    shorted = ShortCircuit(33.0).apply(LINE)
    assert shorted.termination == Termination(0.0)
    direct = abs(complex(input_reflection(opened, [10.0], 120.0)[0]))
    assert direct == pytest.approx(1.0, abs=1e-3)
    # A short with a resistance leaves the rest of the line beside it: 1 ohm and 120 ohm.
    touched = complex(input_impedance(ShortCircuit(0.0, 1.0).apply(LINE), [1.0])[0])
    assert touched.real == pytest.approx(1 / (1 + 1 / (120.0 + 50 * 0.05 + 0.02)), rel=1e-4)


def test_a_splice_adds_its_resistance() -> None:
    extra = input_impedance(BadSplice(10.0, 5.0, 1e-7).apply(LINE), [1.0])
    plain = input_impedance(LINE, [1.0])
    assert complex(extra[0] - plain[0]).real == pytest.approx(5.0, rel=1e-4)


def test_wet_cable_is_slower_and_lower() -> None:
    """Impedance and velocity fall with the root of the capacitance."""
    wet = WaterIngress(25.0, 6.0, 0.44, 2e-6).apply(LINE).elements[3]
    assert isinstance(wet, CableSection)
    assert wet.length_m == pytest.approx(6.0)
    assert wet.impedance_ohm == pytest.approx(120.0 / 1.2)
    assert wet.cable.velocity_m_per_s == pytest.approx(CABLE.velocity_m_per_s / 1.2)
    assert wet.cable.conductance_s_per_m == 2e-6
    with pytest.raises(ValueError, match=r"must lie in one section"):
        WaterIngress(15.0, 10.0, 0.3).apply(LINE)


def test_a_floating_shield_keeps_the_velocity() -> None:
    """All modes of one insulation share one velocity: C falls as L rises."""
    section = MissingShieldGround(1, 0.2, 0.3).apply(LINE).elements[2]
    assert isinstance(section, CableSection)
    assert section.impedance_ohm == pytest.approx(144.0)
    assert section.cable.velocity_m_per_s == pytest.approx(CABLE.velocity_m_per_s)
    assert section.cable.resistance_ohm_per_m == pytest.approx(0.05 * 1.3)


def test_wrong_cable_and_loose_connector() -> None:
    other = Cable.from_impedance(75.0, 0.8)
    section = WrongCable(0, other).apply(LINE).elements[0]
    assert isinstance(section, CableSection)
    assert section.cable == other
    assert section.length_m == 20.0
    loose = LooseConnector(0, 5.0, 1e-8).apply(LINE).elements[1]
    assert loose == Coupler(5.02, 90e-9, 10e-12)


def test_where_faults_are() -> None:
    assert place_of(OpenCircuit(33.0), LINE) == 33.0
    assert place_of(WrongCable(1, CABLE), LINE) == 20.0
    assert place_of(LooseConnector(0, 1.0), LINE) == 20.0
    kinds = {
        fault.kind
        for fault in (
            OpenCircuit(1.0),
            ShortCircuit(1.0),
            WaterIngress(1.0, 1.0, 0.1),
            BadSplice(1.0, 1.0),
            WrongCable(0, CABLE),
            MissingShieldGround(0, 0.1),
            LooseConnector(0, 1.0),
        )
    }
    assert kinds == set(KINDS)
    with pytest.raises(ValueError, match=r"section must be one of 2, got 2"):
        WrongCable(2, CABLE).apply(LINE)
    with pytest.raises(ValueError, match=r"coupler must be one of 1, got -1"):
        LooseConnector(-1, 1.0).apply(LINE)


def test_first_step_of_each_kind_has_its_sign() -> None:
    """At low loss: open +1, short -1, series resistance up, water down."""
    matched = BusLine((CableSection(Cable.from_impedance(120.0, 0.66), 50.0),), Termination(120.0))
    low = [1e3]
    for fault, rho in (
        (OpenCircuit(25.0), 1.0),
        (ShortCircuit(25.0), -1.0),
        (BadSplice(25.0, 24.0), 24 / 264),
    ):
        found = complex(input_reflection(fault.apply(matched), low, 120.0)[0])
        assert found.real == pytest.approx(rho, abs=1e-4)
    wet = WaterIngress(10.0, 20.0, 0.44).apply(matched)
    quarter_hz = CABLE.velocity_m_per_s / 1.2 / (4 * 20.0)
    peak = abs(complex(input_reflection(wet, [quarter_hz], 120.0)[0]))
    step = (100 - 120) / 220
    # A quarter wave: both its steps add up, the second behind the first one's transmission.
    assert peak == pytest.approx(2 * abs(step) / (1 + step**2), rel=1e-6)
    assert math.isclose(step, -0.0909, abs_tol=1e-4)
