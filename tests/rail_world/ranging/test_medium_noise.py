"""Noise, interference and jamming in the radio medium; the same bits whatever else happens."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rail_signals.arrays import ComplexArray
from rail_signals.ranging.signal import RangingSignal, modulate
from rail_world.ranging.description import (
    AntennaPattern,
    RadioDescription,
    RadioFault,
    StationAntenna,
)
from rail_world.ranging.medium import RadioMedium, Reception, TrainAntennas

C_MPS = 299_792_458.0
BOLTZMANN_J_PER_K = 1.380649e-23
SIGNAL = RangingSignal()
BURST = modulate(SIGNAL, [0.7])
LOBE = {"beamwidth_deg": 60.0, "front_to_back_db": 30.0}
Heard = dict[tuple[int, int], Reception]


def antenna(x_m: float, site: str, channels: tuple[int, int] = (1, 2)) -> StationAntenna:
    return StationAntenna(
        site=site,
        zone=f"zone_of_{site}",
        position_m=(x_m, 0.0, 0.0),
        boresight=(1.0, 0.0, 0.0),
        downlink_channel=channels[0],
        uplink_channel=channels[1],
        coverage_range_m=5000.0,
    )


def medium(seed: int = 1, trains: int = 2, **more: Any) -> RadioMedium:
    settings: dict[str, Any] = {
        "sample_rate_hz": SIGNAL.sample_rate_hz,
        "samples": SIGNAL.samples,
        "carriers_hz": {1: 2.4e9, 2: 2.405e9, 3: 2.41e9, 4: 2.415e9},
        "stations": (antenna(0.0, "a"), antenna(-400.0, "b"), antenna(0.0, "c", (3, 4))),
        "trains": tuple(f"t{n}" for n in range(trains)),
        "station_pattern": AntennaPattern(gain_dbi=12.0, **LOBE),
        "train_pattern": AntennaPattern(gain_dbi=6.0, **LOBE),
        "path_loss_exponent": 2.0,
        "noise_figure_db": 8.0,
        "oscillator_ppm": 0.1,
        **more,
    }
    return RadioMedium(RadioDescription(**settings), seed)


def trains_at(*x_m: float) -> TrainAntennas:
    count = len(x_m)
    velocity = np.tile([20.0, 0.0, 0.0], (count, 1))
    return TrainAntennas(np.array([(x, 1.0, 0.0) for x in x_m]), velocity, np.zeros(count))


def downlink(radio: RadioMedium, tick: int, sent: dict[int, ComplexArray], *x_m: float) -> Heard:
    return radio.downlink(tick, tick * 0.1, radio.paths(trains_at(*x_m)), sent)


def noise_of(radio: RadioMedium, tick: int, train: int = 0, channel: int = 1) -> ComplexArray:
    """Return the noise of a port: half the sum of what it hears of a burst and its opposite."""
    station = 0 if channel == 1 else 2
    plus, minus = (
        downlink(radio, tick, {station: sign * BURST}, 100.0, 150.0)[train, channel].samples
        for sign in (1.0, -1.0)
    )
    return np.asarray(0.5 * (plus + minus))


# Thermal noise ----------------------------------------------------------------------------


@pytest.mark.parametrize("noise_figure_db", [0.0, 8.0])
def test_the_noise_floor_is_k_t_b_f(noise_figure_db: float) -> None:
    radio = medium(noise_figure_db=noise_figure_db)
    k_t_b_mw = BOLTZMANN_J_PER_K * 290.0 * SIGNAL.sample_rate_hz * 1e3
    floor_mw = k_t_b_mw * 10.0 ** (noise_figure_db / 10.0)
    assert radio.noise_mw == pytest.approx(floor_mw, rel=1e-3)
    assert downlink(radio, 0, {0: BURST}, 100.0, 150.0)[0, 1].noise_mw == radio.noise_mw


def test_noise_has_its_power_in_equal_uncorrelated_parts_and_is_white() -> None:
    radio = medium()
    blocks = np.array([noise_of(radio, tick) for tick in range(200)]) / math.sqrt(radio.noise_mw)
    count = blocks.size
    # Bounds of five standard deviations each.
    assert np.mean(np.abs(blocks) ** 2) == pytest.approx(1.0, abs=5.0 / math.sqrt(count))
    for part in (blocks.real, blocks.imag):
        assert np.var(part) == pytest.approx(0.5, abs=5.0 * 0.5 * math.sqrt(2.0 / count))
        assert np.mean(part) == pytest.approx(0.0, abs=5.0 * math.sqrt(0.5 / count))
    assert np.mean(blocks.real * blocks.imag) == pytest.approx(0.0, abs=2.5 / math.sqrt(count))
    for lag in range(1, 33):
        along = np.mean(blocks[:, lag:] * blocks[:, :-lag].conj())
        assert abs(along) < 5.0 / math.sqrt(count)
    for lag in (1, 2, 10):
        across = np.mean(blocks[lag:] * blocks[:-lag].conj())
        assert abs(across) < 5.0 / math.sqrt(count)


def test_ports_have_noise_of_their_own() -> None:
    radio = medium()
    blocks = [noise_of(radio, 3, train, channel) for train in (0, 1) for channel in (1, 3)]
    paths = radio.paths(trains_at(100.0, 150.0))
    plus, minus = (radio.uplink(3, 0.3, paths, {0: (2, s * BURST)})[0, 2] for s in (1.0, -1.0))
    blocks.append(0.5 * (plus.samples + minus.samples))
    correlation = np.abs(np.corrcoef(blocks)) - np.eye(len(blocks))
    assert correlation.max() < 5.0 / math.sqrt(SIGNAL.samples)


# Repeatability ----------------------------------------------------------------------------


def test_a_port_hears_the_same_whatever_else_is_heard() -> None:
    alone = downlink(medium(), 7, {0: BURST}, 100.0, 9e9)[0, 1]
    crowded = downlink(medium(), 7, {2: BURST, 0: BURST}, 100.0, 150.0)
    assert set(crowded) == {(0, 1), (1, 1), (0, 3), (1, 3)}
    assert np.array_equal(crowded[0, 1].samples, alone.samples)


def test_a_tick_is_the_same_whatever_came_before() -> None:
    radio = medium()
    for tick in (5, 3, 4, 4):
        downlink(radio, tick, {0: BURST, 2: BURST}, 100.0, 150.0)
    again = downlink(radio, 7, {0: BURST}, 100.0, 150.0)
    fresh = downlink(medium(), 7, {0: BURST}, 100.0, 150.0)
    for port, received in fresh.items():
        assert np.array_equal(again[port].samples, received.samples)


def test_two_media_of_one_seed_agree_and_of_two_seeds_do_not() -> None:
    one, same, other = (
        downlink(medium(seed), 7, {0: BURST, 1: BURST}, 100.0, 150.0) for seed in (1, 1, 2)
    )
    assert set(one) == set(same) == set(other)
    for port in one:
        assert np.array_equal(one[port].samples, same[port].samples)
        assert one[port].snr == same[port].snr
        assert not np.array_equal(one[port].samples, other[port].samples)
    sender = {1: (2, BURST), 0: (2, BURST)}
    radios = medium(), medium()
    up = [r.uplink(7, 0.7, r.paths(trains_at(100.0, 150.0)), sender) for r in radios]
    reverse = dict(reversed(list(sender.items())))
    up.append(radios[0].uplink(7, 0.7, radios[0].paths(trains_at(100.0, 150.0)), reverse))
    for port in up[0]:
        assert np.array_equal(up[0][port].samples, up[1][port].samples)
        assert np.array_equal(up[0][port].samples, up[2][port].samples)


def test_what_was_received_is_not_changed_by_the_next_tick() -> None:
    radio = medium()
    received = downlink(radio, 0, {0: BURST}, 100.0, 150.0)[0, 1].samples
    kept = received.copy()
    downlink(radio, 1, {0: BURST, 1: BURST}, 120.0, 130.0)
    assert np.array_equal(received, kept)


def test_what_was_sent_is_not_changed() -> None:
    sent = BURST.copy()
    downlink(medium(), 0, {0: sent, 1: sent}, 100.0, 150.0)
    assert np.array_equal(sent, BURST)


# More than one sender ---------------------------------------------------------------------


def test_stations_on_one_channel_add() -> None:
    radio = medium()
    first, second, both = (
        downlink(radio, 2, sent, 100.0, 150.0)[0, 1]
        for sent in ({0: BURST}, {1: BURST}, {0: BURST, 1: BURST})
    )
    noise = noise_of(radio, 2)
    total = first.samples + second.samples - noise
    assert np.max(np.abs(both.samples - total)) < 1e-6 * np.max(np.abs(total))  # single precision
    assert (both.source, both.signal_mw) == (first.source, first.signal_mw)
    assert first.signal_mw > second.signal_mw
    assert both.noise_mw == first.noise_mw


def test_trains_on_one_channel_add() -> None:
    radio = medium()
    paths = radio.paths(trains_at(300.0, 100.0))
    one, two, both = (
        radio.uplink(2, 0.2, paths, sent)[0, 2]
        for sent in ({0: (2, BURST)}, {1: (2, BURST)}, {0: (2, BURST), 1: (2, BURST)})
    )
    opposite = radio.uplink(2, 0.2, paths, {0: (2, -BURST)})[0, 2]
    noise = 0.5 * (one.samples + opposite.samples)
    total = one.samples + two.samples - noise
    assert np.max(np.abs(both.samples - total)) < 1e-6 * np.max(np.abs(total))  # single precision
    assert both.source == two.source == (0, 1)


# Jammers ----------------------------------------------------------------------------------


def jammed(**fault: Any) -> RadioMedium:
    settings = {"kind": "jam", "channel": 1, "power_dbm": 20.0, "from_s": 1.0, "to_s": 2.0}
    isotropic = AntennaPattern(gain_dbi=0.0, beamwidth_deg=60.0, front_to_back_db=0.0)
    return medium(faults=(RadioFault(**{**settings, **fault}),), train_pattern=isotropic)


def test_a_jammer_arrives_with_the_power_of_friis() -> None:
    radio = jammed(position_m=(100.0, 251.0, 0.0))  # 250 m beside the first train
    expected_mw = 10.0 ** ((20.0 - 20.0 * math.log10(4.0 * math.pi * 250.0 * 2.4e9 / C_MPS)) / 10.0)
    heard = downlink(radio, 15, {0: BURST}, 100.0, 150.0)[0, 1]
    assert heard.noise_mw - radio.noise_mw == pytest.approx(expected_mw, rel=1e-9)


def test_a_jammer_is_noise_of_that_power() -> None:
    radio = jammed(position_m=(100.0, 251.0, 0.0))
    blocks = [noise_of(radio, 10 + tick) for tick in range(10)]
    noise_mw = downlink(radio, 15, {0: BURST}, 100.0, 150.0)[0, 1].noise_mw
    count = 10 * SIGNAL.samples
    assert np.mean(np.abs(blocks) ** 2) == pytest.approx(noise_mw, rel=5.0 / math.sqrt(count))


@pytest.mark.parametrize(("tick", "on"), [(9, False), (10, True), (19, True), (20, False)])
def test_a_jammer_has_its_time_and_its_channel(tick: int, on: bool) -> None:
    radio = jammed(position_m=(100.0, 251.0, 0.0))
    heard = downlink(radio, tick, {0: BURST, 2: BURST}, 100.0, 150.0)
    assert bool(heard[0, 1].noise_mw > 1.1 * radio.noise_mw) is on
    assert heard[0, 3].noise_mw == radio.noise_mw


def test_antennas_turned_away_suppress_a_jammer() -> None:
    ratios = []
    for x_m in (300.0, -300.0):
        place_m = (x_m, 0.0, 0.0)
        fault = RadioFault(
            kind="jam", channel=2, power_dbm=20.0, from_s=0.0, to_s=1.0, position_m=place_m
        )
        radio = medium(faults=(fault,))
        paths = radio.paths(trains_at(100.0, 150.0))
        heard = radio.uplink(0, 0.0, paths, {0: (2, BURST)})[0, 2]
        ratios.append(heard.noise_mw - radio.noise_mw)
    # The station looks east; its front-to-back ratio is 30 dB.
    assert ratios[0] / ratios[1] == pytest.approx(1e3, rel=1e-6)
