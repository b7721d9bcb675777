"""Time responses against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import erf, erfc

from rail_signals.train_bus.bus_line import BusLine, CableSection, Termination
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.tdr.response import (
    RISE_PER_SIGMA,
    TimeGrid,
    incident_spectrum,
    lead_in_s,
    reflected_wave,
)

RISE_S = 20e-9
SIGMA_S = RISE_S / RISE_PER_SIGMA
CABLE = Cable.from_impedance(120.0, 0.66)
GRID = TimeGrid(800, RISE_S / 5, -lead_in_s(RISE_S))


def edge(time_s: np.ndarray) -> np.ndarray:
    return 0.5 * (1 + erf(time_s / (SIGMA_S * math.sqrt(2))))


def test_the_edge_rises_in_the_rise_time() -> None:
    assert float(edge(np.array(RISE_S / 2)) - edge(np.array(-RISE_S / 2))) == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("load_ohm", "rho"), [(math.inf, 1), (0.0, -1), (120.0, 0), (60.0, -1 / 3)]
)
def test_an_end_is_seen_after_its_delay(load_ohm: float, rho: float) -> None:
    """A step that never returns to zero, and yet nothing folds back."""
    bus_line = BusLine((CableSection(CABLE, 47.0),), Termination(load_ohm))
    wave = reflected_wave(bus_line, GRID, 120.0, RISE_S)
    delay = 2 * 47.0 / CABLE.velocity_m_per_s
    np.testing.assert_allclose(wave, rho * edge(GRID.time_s - delay), atol=5e-6)


@pytest.mark.parametrize(
    ("length_m", "velocity_factor", "echo_ns"),
    [(47, 0.66, 475.1), (27, 0.66, 272.9), (47, 0.42765, 733.2), (27, 0.42765, 421.2)],
)
def test_echoes_of_the_cars(length_m: float, velocity_factor: float, echo_ns: float) -> None:
    """S2, Fig 6: 47 m and 27 m, in polyethylene and in the example's cable."""
    cable = Cable.from_impedance(120.0, velocity_factor)
    wave = reflected_wave(BusLine((CableSection(cable, length_m),)), GRID, 120.0, RISE_S)
    middle = np.interp(0.5, wave, GRID.time_s)
    assert float(middle) == pytest.approx(echo_ns * 1e-9, abs=0.1e-9)


def test_echoes_between_a_wrong_source_and_an_open_end() -> None:
    """The lattice diagram: each round trip is one edge."""
    wave = reflected_wave(BusLine((CableSection(CABLE, 30.0),)), GRID, 60.0, RISE_S)
    rho, delay = 1 / 3, 2 * 30.0 / CABLE.velocity_m_per_s
    expected = rho * edge(GRID.time_s)
    for k in range(1, 30):
        expected += (1 - rho**2) * (-rho) ** (k - 1) * edge(GRID.time_s - k * delay)
    np.testing.assert_allclose(wave, expected, atol=1e-5)


def test_the_skin_effect_makes_an_erfc() -> None:
    """``exp(-2 a l sqrt(s)) / s`` is ``erfc(a l / sqrt(t))``, whose tail outlasts the window.

    To first order the skin also lifts the impedance, by ``S / (2 L sqrt(pi s))`` of it: the head
    reflects half of that, a root of the time.
    """
    skin, inductance, length = 1e-4, 0.9e-6, 400.0
    cable = Cable(inductance, inductance / 120.0**2, 0.0, 0.0, skin)
    grid = TimeGrid(3000, RISE_S / 5, -lead_in_s(RISE_S))
    wave = reflected_wave(BusLine((CableSection(cable, length),)), grid, 120.0, RISE_S)
    a = skin / (2 * 120.0 * math.sqrt(math.pi))
    late = grid.time_s - 2 * length / cable.velocity_m_per_s
    head = skin * np.sqrt(np.maximum(grid.time_s, 0)) / (2 * math.pi * inductance)
    after, before = late > 1e-7, (late < -1e-7) & (grid.time_s > 1e-7)
    expected = erfc(a * length / np.sqrt(late[after])) + head[after]
    assert expected[0] < 0.75 < 0.9 < expected[-1]
    np.testing.assert_allclose(wave[after], expected, atol=5e-3)
    np.testing.assert_allclose(wave[before], head[before], atol=5e-3)


def test_a_pulse_is_the_derivative_of_the_step() -> None:
    bus_line = BusLine((CableSection(CABLE, 20.0),), Termination(300.0))
    step = reflected_wave(bus_line, GRID, 120.0, RISE_S)
    pulse = reflected_wave(bus_line, GRID, 120.0, RISE_S, "pulse")
    slope = np.gradient(step, GRID.sample_period_s) * SIGMA_S * math.sqrt(2 * math.pi)
    np.testing.assert_allclose(pulse, slope, atol=0.02)
    late = GRID.time_s - 40.0 / CABLE.velocity_m_per_s
    gauss = 180 / 420 * np.exp(-0.5 * (late / SIGMA_S) ** 2)
    np.testing.assert_allclose(pulse, gauss, atol=1e-5)


def test_causal() -> None:
    bus_line = BusLine((CableSection(CABLE, 47.0),))
    wave = reflected_wave(bus_line, GRID, 120.0, RISE_S)
    before = GRID.time_s < 2 * 47.0 / CABLE.velocity_m_per_s - lead_in_s(RISE_S)
    assert before.sum() > 80
    assert np.abs(wave[before]).max() < 1e-5


def test_wrong_values_are_quoted() -> None:
    with pytest.raises(ValueError, match=r"sample_period_s must be at most a quarter"):
        incident_spectrum(TimeGrid(100, RISE_S / 3), RISE_S)
    with pytest.raises(ValueError, match=r"rise_time_s must be above 0, got -1"):
        incident_spectrum(GRID, -1)
    with pytest.raises(ValueError, match=r"excitation must be .*'ramp'"):
        incident_spectrum(GRID, RISE_S, "ramp")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"samples must be 2 or more, got 1"):
        TimeGrid(1, 1e-9)
