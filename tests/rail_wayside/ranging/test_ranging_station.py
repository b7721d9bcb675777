"""The ranging station: ranges at the bound, calibrated delay, and what must not be a range."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rail_signals.delay import fractional_delay
from rail_signals.phasors import cis
from rail_signals.ranging.bounds import two_way_range_variance_bound
from rail_signals.ranging.phase_range import range_to_phase_rad, unambiguous_range_m
from rail_signals.ranging.receiver import FmToneReceiver
from rail_signals.ranging.signal import RangingSignal, modulate
from rail_signals.ranging.transponder import transpond
from rail_wayside.ranging.ranging_station import BurstReading, RangingStation

Burst = NDArray[np.complex128]
C_MPS = 299_792_458.0
SIGNAL = RangingSignal()
TWO_TONES = RangingSignal((375e3, 37.5e3), (375e3, 37.5e3))
DELAY_S = 1e-6
NOISE_MW = 1e-10


def turning(cycles_per_sample: float, samples: int) -> Burst:
    """Return a frequency shift that leaves the phase at mid-burst alone."""
    return cis(2.0 * math.pi * cycles_per_sample * (np.arange(samples) - 0.5 * (samples - 1)))


def noise(
    rng: np.random.Generator, power_mw: float = NOISE_MW, samples: int = SIGNAL.samples
) -> Burst:
    parts = rng.standard_normal((samples, 2)) * math.sqrt(power_mw / 2.0)
    return np.asarray(parts.view(np.complex128)[:, 0])


def returned(range_m: float, signal: RangingSignal = SIGNAL, delay_s: float = DELAY_S) -> Burst:
    """Return the burst of a train that far away, without noise, of -60 dBm."""
    lags = [float(range_to_phase_rad(range_m, f, delay_s=delay_s)) for f in signal.tones_hz]
    return 1e-3 * modulate(signal, lags)


def station(comparator: str = "quadrature", signal: RangingSignal = SIGNAL) -> RangingStation:
    return RangingStation(signal, comparator, DELAY_S, noise_mw=NOISE_MW)  # type: ignore[arg-type]


class Chain:
    """Station, air, transponder, air: what the station receives of a train."""

    def __init__(self, signal: RangingSignal = SIGNAL, seed: int = 1) -> None:
        self._signal = signal
        self._rng = np.random.default_rng(seed)
        self._receiver = FmToneReceiver(signal)
        self._sent = modulate(signal, np.zeros(len(signal.tones_hz)))

    def burst(self, range_m: float, snr_down: float, snr_up: float) -> Burst:
        heard = self._receiver.estimate(self._air(self._sent, range_m, snr_down))
        return self._air(transpond(heard, self._signal, DELAY_S), range_m, snr_up)

    def _air(self, sent: Burst, range_m: float, snr: float) -> Burst:
        arrived = fractional_delay(sent, range_m / C_MPS, self._signal.sample_rate_hz)
        # Any carrier phase and an offset of Doppler and oscillators.
        turn = np.exp(2j * math.pi * self._rng.random())
        shift_hz = self._rng.uniform(-1e3, 1e3)
        arrived = arrived * turning(shift_hz / self._signal.sample_rate_hz, arrived.size) * turn
        amplitude = math.sqrt(snr * NOISE_MW)
        return np.asarray(amplitude * arrived + noise(self._rng, samples=arrived.size))


# Ranges -----------------------------------------------------------------------------------


@pytest.mark.parametrize("range_m", [-15.0, 0.0, 5.8, 50.0, 199.0, 250.0, 379.0])
def test_quadrature_reads_the_range_and_takes_the_delay_off(range_m: float) -> None:
    reading = station().read(returned(range_m))
    assert reading.range_m == pytest.approx(range_m, abs=1e-6)
    assert reading.disturbance == ""


@pytest.mark.parametrize("range_m", [0.0, 5.8, 50.0, 149.0, 199.0])
def test_and_reads_up_to_half_a_turn(range_m: float) -> None:
    # The AND gate's width is read from 64 interpolated samples of a period.
    assert station("and").read(returned(range_m)).range_m == pytest.approx(range_m, abs=0.05)


@pytest.mark.parametrize("past_m", [1.0, 50.0, 149.0])
def test_and_folds_what_lies_past_half_a_turn(past_m: float) -> None:
    # Jeong et al., Figs 5 and 6: 315 degrees reads as 45.
    limit_m = unambiguous_range_m(SIGNAL.tones_hz[0], "and")
    reading = station("and").read(returned(limit_m + past_m))
    assert reading.range_m == pytest.approx(limit_m - past_m, abs=0.05)


def test_one_nanosecond_of_delay_is_fifteen_centimetres() -> None:
    late = station().read(returned(100.0, delay_s=DELAY_S + 1e-9))
    assert late.range_m - 100.0 == pytest.approx(0.5 * C_MPS * 1e-9, abs=1e-6)


@pytest.mark.parametrize("range_m", [-50.0, 0.0, 390.0, 799.0, 1234.5, 2000.0])
def test_two_tones_reach_two_kilometres(range_m: float) -> None:
    unit = station("two_tone", TWO_TONES)
    low_m, high_m = unit.interval_m
    assert low_m < range_m < high_m
    assert unit.read(returned(range_m, TWO_TONES)).range_m == pytest.approx(range_m, abs=1e-6)
    noisy = Chain(TWO_TONES).burst(abs(range_m), 1e3, 1e3)
    assert unit.read(noisy).range_m == pytest.approx(abs(range_m), abs=2.0)


def test_two_tones_that_cannot_tell_the_cycle_give_no_range() -> None:
    unit, chain = station("two_tone", TWO_TONES), Chain(TWO_TONES)
    # 637 m per radian of the low tone: at -4 dB the cycle of 400 m is uncertain.
    readings = [unit.read(chain.burst(1500.0, 0.4, 0.4)) for _ in range(40)]
    finite = [reading for reading in readings if math.isfinite(reading.range_m)]
    assert len(finite) < len(readings)
    assert all(abs(reading.range_m - 1500.0) < 200.0 for reading in finite)
    refused = [reading for reading in readings if math.isnan(reading.range_m)]
    assert {reading.disturbance for reading in refused} == {
        "too weak to tell the cycle of the tone"
    }


def test_intervals_are_the_unambiguous_ones() -> None:
    assert station("and").interval_m == (0.0, pytest.approx(199.861639, abs=1e-6))
    low_m, high_m = station().interval_m
    assert high_m - low_m == pytest.approx(399.723277, abs=1e-6)
    assert low_m == pytest.approx(-0.05 * 399.723277, abs=1e-6)
    low_m, high_m = station("two_tone", TWO_TONES).interval_m
    assert high_m - low_m == pytest.approx(0.5 * C_MPS / 37.5e3)


# The bound --------------------------------------------------------------------------------


@pytest.mark.parametrize("snr_db", [0.0, 10.0, 30.0])
def test_the_two_way_range_is_at_its_bound_and_says_so(snr_db: float) -> None:
    snr = 10.0 ** (snr_db / 10.0)
    bound_m2 = float(two_way_range_variance_bound(snr, snr, SIGNAL.samples, 1.0, 375e3))
    unit, chain = station(), Chain(seed=int(snr_db))
    readings = [unit.read(chain.burst(123.4, snr, snr)) for _ in range(400)]
    errors_m = np.array([reading.range_m for reading in readings]) - 123.4
    # 400 bursts give a variance to 7 %; four sigma of it.
    assert np.mean(errors_m**2) / bound_m2 == pytest.approx(1.0, abs=0.28)
    assert abs(np.mean(errors_m)) < 4.0 * math.sqrt(bound_m2 / 400)
    stated_m2 = np.array([reading.variance_m2 for reading in readings])
    assert np.mean(stated_m2) / bound_m2 == pytest.approx(1.0, abs=0.1)


def test_the_variance_counts_both_ways() -> None:
    chain = Chain()
    burst = chain.burst(80.0, 100.0, 100.0)
    alone = RangingStation(SIGNAL, "quadrature", DELAY_S, downlink_noise=0.0)
    noisier = RangingStation(SIGNAL, "quadrature", DELAY_S, downlink_noise=3.0)
    assert station().read(burst).variance_m2 == pytest.approx(2 * alone.read(burst).variance_m2)
    assert noisier.read(burst).variance_m2 == pytest.approx(4 * alone.read(burst).variance_m2)


# What is not a range ----------------------------------------------------------------------


@pytest.mark.parametrize("comparator", ["quadrature", "and"])
def test_noise_is_nothing_heard(comparator: str) -> None:
    unit, rng = station(comparator), np.random.default_rng(3)
    for power_mw in (0.0, NOISE_MW, 2.0 * NOISE_MW):
        for _ in range(50):
            assert unit.read(noise(rng, power_mw)) == BurstReading(math.inf, math.inf)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, complex(0.0, math.nan)])
@pytest.mark.parametrize("comparator", ["quadrature", "and", "two_tone"])
def test_samples_that_are_no_numbers_never_make_a_range(comparator: str, value: complex) -> None:
    signal = TWO_TONES if comparator == "two_tone" else SIGNAL
    burst = returned(100.0, signal)
    for broken in (burst * value, np.where(np.arange(burst.size) == 17, value, burst)):
        reading = station(comparator, signal).read(broken)
        assert not math.isfinite(reading.range_m)
        assert not math.isfinite(reading.variance_m2)


def test_a_jammer_without_a_train_is_told_and_gives_no_range() -> None:
    rng = np.random.default_rng(4)
    reading = station().read(noise(rng, 100.0 * NOISE_MW))
    assert math.isnan(reading.range_m)
    assert reading.disturbance == "channel jammed: noise of -80 dBm"


def test_a_jammer_over_a_train_is_told_and_its_cost_is_in_the_variance() -> None:
    rng = np.random.default_rng(5)
    train = returned(100.0)
    clear = station().read(train + noise(rng))
    jammed = station().read(train + noise(rng, 1000.0 * NOISE_MW))
    assert jammed.disturbance.startswith("channel jammed")
    assert clear.disturbance == ""
    assert jammed.variance_m2 / clear.variance_m2 == pytest.approx(1000.0, rel=0.3)
    assert abs(jammed.range_m - 100.0) < 5.0 * math.sqrt(jammed.variance_m2)


def two_trains(
    rng: np.random.Generator, first_m: float, second_m: float, second_db: float
) -> Burst:
    """Return the signals of two trains, the second one weaker or equal, and noise."""
    total = noise(rng)
    for range_m, level_db in ((first_m, 0.0), (second_m, second_db)):
        turn = 10.0 ** (level_db / 20.0) * np.exp(2j * math.pi * rng.random())
        train = turn * returned(range_m)
        total += train * turning(rng.uniform(-1e3, 1e3) / SIGNAL.sample_rate_hz, train.size)
    return total


@pytest.mark.parametrize("second_db", [0.0, -3.0, -10.0, -20.0])
def test_two_trains_are_told_and_give_no_range(second_db: float) -> None:
    rng, unit = np.random.default_rng(6), station()
    for _ in range(100):
        first_m = rng.uniform(0.0, 200.0)
        second_m = first_m + rng.uniform(40.0, 150.0)
        reading = unit.read(two_trains(rng, first_m, second_m, second_db))
        assert math.isnan(reading.range_m)
        assert reading.variance_m2 == math.inf
        assert reading.disturbance == "more than one signal in the zone"


@pytest.mark.parametrize("second_db", [-25.0, -30.0, -40.0, -60.0])
def test_a_second_train_that_is_not_told_moves_the_range_by_its_share(second_db: float) -> None:
    rng, unit = np.random.default_rng(7), station()
    amplitude = 10.0 ** (second_db / 20.0)
    most_m = amplitude * C_MPS / (4.0 * math.pi * SIGNAL.tones_hz[0])
    for _ in range(100):
        first_m, second_m = rng.uniform(0.0, 350.0, 2)
        reading = unit.read(two_trains(rng, first_m, second_m, second_db))
        if math.isfinite(reading.range_m):
            assert abs(reading.range_m - first_m) < most_m + 5.0 * math.sqrt(reading.variance_m2)
