"""Reflections measured over frequency, as a reflectometer would show them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.train_bus.bus_line import BusLine, CableSection, SeriesElement, Termination
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.cascade import input_reflection
from rail_signals.train_bus.tdr.measured_trace import from_ohms, step_answer, step_edge
from rail_signals.train_bus.tdr.response import TimeGrid, lead_in_s, reflected_wave

CABLE = Cable.from_impedance(110.0, 0.66, 0.05, 1e-9, 5e-5)
LINE = BusLine(
    (CableSection(CABLE, 20.0), SeriesElement(15.0), CableSection(CABLE, 27.0)), Termination(120.0)
)
RISE_S = 20e-9


@pytest.mark.parametrize("first", [0, 1])
def test_an_analyser_and_a_reflectometer_see_the_same(first: int) -> None:
    frequency_hz = 50e3 * np.arange(first, 3000)
    rho = input_reflection(LINE, frequency_hz, 105.0)
    time_s, seen = step_answer(frequency_hz, rho, RISE_S, 5e-9)
    assert time_s[0] <= -lead_in_s(RISE_S)
    assert np.diff(time_s).max() <= 5e-9 * (1 + 1e-9)
    window = time_s < 3e-6
    grid = TimeGrid(int(window.sum()), float(time_s[1] - time_s[0]), float(time_s[0]))
    true = reflected_wave(LINE, grid, 105.0, RISE_S)
    # What the cable does below the first frequency is extrapolated.
    assert np.abs(seen[window] - true).max() < 2e-3


def test_a_resistor_alone_reflects_the_step_itself() -> None:
    frequency_hz = 1e5 * np.arange(2000)
    time_s, seen = step_answer(frequency_hz, np.full(2000, 0.2 + 0j), RISE_S, 5e-9)
    window = time_s < 5e-6
    assert seen[window] == pytest.approx(0.2 * step_edge(time_s[window], RISE_S), abs=2e-5)


def test_the_edge_rises_from_10_to_90_percent_in_its_rise_time() -> None:
    time_s = np.linspace(-50e-9, 50e-9, 100_001)
    edge = step_edge(time_s, RISE_S)
    low, high = np.interp([0.1, 0.9], edge, time_s)
    assert high - low == pytest.approx(RISE_S, rel=1e-6)
    assert float(step_edge(0.0, RISE_S)) == 0.5


def test_ohms_become_reflections() -> None:
    assert from_ohms([105.0, 0.0, 315.0], 105.0).tolist() == [0.0, -1.0, 0.5]
    with pytest.raises(ValueError, match="impedance_ohm must be 0 or more, got -1"):
        from_ohms([105.0, -1.0], 105.0)


@pytest.mark.parametrize(
    ("frequency_hz", "bus_line"),
    [
        (np.concatenate((1e5 * np.arange(999), [3e8])), "must rise evenly"),
        (1e5 * np.arange(1000)[::-1], "must rise evenly"),
        (1e6 + 1e5 * np.arange(1000), "must begin at 0 or at one step, got 1e"),
        (1e5 * np.arange(100), "must reach 7.58e"),
    ],
)
def test_frequencies_that_do_not_do(frequency_hz: np.ndarray, bus_line: str) -> None:
    with pytest.raises(ValueError, match=bus_line):
        step_answer(frequency_hz, np.zeros(len(frequency_hz)), RISE_S, 5e-9)


def test_the_top_frequency_is_where_a_thousandth_of_the_edge_is_left() -> None:
    sigma_s = RISE_S / 2.5631031310892007
    top_hz = math.sqrt(2.0 * math.log(1e3)) / (2.0 * math.pi * sigma_s)
    assert f"{top_hz:.3g}" == "7.58e+07"
