"""A transmitter on the loads of S2, Fig 4, and the check of its pulses (Fig 5)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rail_signals.train_bus.bus_line import Termination
from rail_signals.train_bus.pulse_check import PulseMask, check_pulse
from rail_signals.train_bus.transmitter import LOADS, TestLoads, Transmitter, manchester_bits

BITS = np.random.default_rng(3).integers(0, 2, 48).astype(bool)
LOADS_OF_120 = TestLoads()


def test_the_loads_of_figure_4() -> None:
    assert LOADS_OF_120.load("open") == Termination(120.0)
    assert LOADS_OF_120.load("resistive").resistance_ohm == pytest.approx(50.4)
    external = LOADS_OF_120.external_ohm
    assert external == pytest.approx(86.9, abs=0.05)
    assert 1 / (1 / 120.0 + 1 / external) == pytest.approx(50.4)
    assert LOADS_OF_120.load("idle") == Termination(27.0, 1.3e-9)
    assert LOADS_OF_120.idle_time_constant_s == pytest.approx(35.1e-9)
    assert (LOADS_OF_120.idle_ohm_tolerance, LOADS_OF_120.idle_f_tolerance) == (0.01, 0.10)
    assert LOADS_OF_120.load("short") == Termination(0.0)
    with pytest.raises(ValueError, match=r"test must be one of .*'heavy'"):
        LOADS_OF_120.load("heavy")


def test_the_output_divides_as_resistances_do() -> None:
    transmitter = Transmitter(voltage_v=5.0, source_ohm=30.0)
    for test, share in (("open", 120 / 150), ("resistive", 50.4 / 80.4), ("short", 0.0)):
        time, voltage = transmitter.output_wave(BITS, test)
        assert np.abs(voltage).max() == pytest.approx(5.0 * share)
        assert len(time) == len(voltage)
    assert transmitter.short_circuit_a == pytest.approx(5.0 / 30.0)


def test_the_idle_circuit_charges_through_both_resistances() -> None:
    """After an ideal step: ``V (1 - Rs / (R + Rs) exp(-t / tau))``, with the edge a ramp."""
    transmitter = Transmitter(voltage_v=1.0, source_ohm=30.0, edge_s=1e-12)
    time, voltage = transmitter.output_wave([True], "idle", sample_rate_hz=1e9)
    tau = 57.0 * 1.3e-9
    since = time - 0.5e-6
    first = (since > 5e-9) & (since < 0.4e-6)
    expected = 1 - 30.0 / 57.0 * np.exp(-(since[first] + 0.5e-9) / tau)
    np.testing.assert_allclose(voltage[first], expected, atol=5e-3)


def test_bits_come_back() -> None:
    _, voltage = Transmitter().output_wave(BITS, "resistive")
    assert (manchester_bits(voltage, 200.0, 100.0)[: len(BITS)] == BITS).all()
    with pytest.raises(ValueError, match=r"bits must be one row of bits"):
        Transmitter().source_wave([], 1e8)


@pytest.mark.parametrize("test", LOADS)
def test_a_good_transmitter_passes(test: str) -> None:
    # A short has no voltage: what is looked at is the current of its meter.
    time, wave = Transmitter().output_wave(BITS, "open" if test == "short" else test)
    check = check_pulse(time, wave, test)
    assert check.passed, check.reasons
    if test in ("open", "resistive"):
        assert check.bit_rate_hz == pytest.approx(1e6, rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "test", "reason"),
    [
        ({"source_ohm": 50.0}, "resistive", "amplitude 2.76 V below 3 V"),
        ({"voltage_v": 9.0}, "open", "peak 7.2 V above 7 V"),
        ({"edge_s": 250e-9}, "resistive", "slope 0.0276 V/ns below 0.03 V/ns"),
        ({"bit_rate_hz": 1e6 * 1.00011}, "open", "bit rate off by 0.011 %"),
    ],
)
def test_a_bad_one_fails(changes: dict[str, float], test: str, reason: str) -> None:
    time, wave = replace(Transmitter(), **changes).output_wave(BITS, test)
    assert check_pulse(time, wave, test).reasons == (reason,)


def test_the_bit_rate_may_be_off_by_a_hundredth_of_a_per_cent() -> None:
    time, wave = Transmitter(bit_rate_hz=1e6 * 1.00009).output_wave(BITS, "open")
    check = check_pulse(time, wave, "open")
    assert check.passed
    assert check.bit_rate_hz == pytest.approx(1e6 * 1.00009, rel=1e-7)


def test_a_short_circuit_current_has_a_limit_where_one_is_set() -> None:
    time, wave = Transmitter().output_wave(BITS, "open")
    current = wave / np.abs(wave).max() * Transmitter().short_circuit_a
    assert check_pulse(time, current, "short").passed
    strict = replace(PulseMask(), most_short_a=0.1)
    assert check_pulse(time, current, "short", strict).reasons == ("current 0.183 A above 0.1 A",)


def test_what_is_from_memory_says_so() -> None:
    text = " ".join(PulseMask().unconfirmed)
    for name in ("least_heavy_v", "most_light_v", "least_slew_v_per_ns", "most_short_a"):
        assert name in text


def test_wrong_values_are_quoted() -> None:
    with pytest.raises(ValueError, match=r"edge_s must be shorter than half a bit"):
        Transmitter(edge_s=0.6e-6)
    with pytest.raises(ValueError, match=r"must cross zero 4 times or more, got 0"):
        check_pulse(np.arange(10) * 1e-9, np.ones(10), "open")
    with pytest.raises(ValueError, match=r"terminator_ohm must be above 0, got nan"):
        TestLoads(terminator_ohm=math.nan)
    with pytest.raises(ValueError, match=r"resistive_share must be below 1, got 1"):
        TestLoads(resistive_fraction=1)
