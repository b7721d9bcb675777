"""Symbols of a burst behind a known channel: where the constellation's points are."""

from __future__ import annotations

import json

import numpy as np
import pytest

from rail_corridor.equipment.train_radio.symbols import BurstReader
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.announcement import announcement
from rail_corridor.view.scope import scope
from rail_msgs_py.waveform import Waveform
from rail_signals.train_radio.slots import RadioSlots


@pytest.fixture(scope="module")
def reader() -> BurstReader:
    return BurstReader(json.loads(announcement(load_scenario("moving_block")))["bursts"])


def block(reader: BurstReader, noise: float, gain: complex = 1e-3j) -> Waveform:
    """One burst in slot 2 of 3, received by two antennas over a channel of rank two."""
    rng = np.random.default_rng(5)
    burst = reader._burst
    sent = RadioSlots(burst, 2).block({2: rng.bytes(64)})
    channel = gain * np.array([[1.0, 0.3], [-0.5j, 0.8]])
    received = channel @ sent
    size = received.shape
    level = abs(gain) * noise
    received = received + level * (rng.standard_normal(size) + 1j * rng.standard_normal(size))
    return Waveform(0, burst.sample_rate_hz, 2.4e9, 1, received)


def test_without_noise_every_symbol_lies_on_its_point(reader: BurstReader) -> None:
    shown = scope(block(reader, 1e-6), readers=(reader,))["plane"]
    assert (shown["kind"], shown["constellation"], shown["slot"]) == ("symbols", "qpsk", 2)
    symbols = np.array(shown["i"]) + 1j * np.array(shown["q"])
    points = np.array(shown["points"]) @ (1, 1j)
    assert len(points) == 4
    assert np.abs(symbols[:, None] - points).min(axis=1).max() < 0.01
    assert shown["snr_db"] > 40.0


def test_noise_spreads_the_symbols_and_shows_in_the_ratio(reader: BurstReader) -> None:
    shown = scope(block(reader, 0.1), readers=(reader,))["plane"]
    symbols = np.array(shown["i"]) + 1j * np.array(shown["q"])
    points = np.array(shown["points"]) @ (1, 1j)
    spread = np.mean(np.abs(symbols[:, None] - points).min(axis=1) ** 2)
    assert shown["snr_db"] == pytest.approx(-10.0 * np.log10(spread), abs=2.0)


def test_blocks_of_other_signals_hold_no_bursts(reader: BurstReader) -> None:
    other = Waveform(0, 4e6, 2.4e9, 1, np.ones((1, 960), complex))
    assert reader.symbols(other, 0) is None
    short = Waveform(0, reader._burst.sample_rate_hz, 2.4e9, 1, np.ones((2, 100), complex))
    assert reader.symbols(short, 0) is None


def test_one_antenna_of_two_is_shown_behind_its_matched_filter(reader: BurstReader) -> None:
    both = block(reader, 0.0)
    one = Waveform(0, both.sample_rate_hz, both.carrier_hz, 1, both.samples[:1])
    shown = reader.symbols(one, 0)
    assert shown is not None
    assert shown["kind"] == "matched"
    assert np.mean(np.square(shown["i"]) + np.square(shown["q"])) == pytest.approx(1.0, abs=1e-2)
