"""The radio medium against closed forms: Friis, antenna patterns, delay, Doppler, reach."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import ComplexArray
from rail_signals.ranging.receiver import FmToneReceiver, ToneEstimate
from rail_signals.ranging.signal import RangingSignal, modulate
from rail_world.ranging.description import (
    AntennaPattern,
    RadioDescription,
    RadioFault,
    StationAntenna,
)
from rail_world.ranging.medium import Paths, RadioMedium, Reception, TrainAntennas
from rail_world.ranging.medium_node import antennas_of

C_MPS = 299_792_458.0
SIGNAL = RangingSignal()
DOWN_HZ, UP_HZ = 2.4e9, 2.405e9
#: 1 MW: noise, at -100 dBm, is out of sight.
LOUD = 10.0**4.5


def antenna(
    x_m: float = 0.0,
    y_m: float = 0.0,
    *,
    towards: tuple[float, float, float] = (1.0, 0.0, 0.0),
    site: str = "wrs1",
    zone: str = "zone1",
    reach_m: float = 2000.0,
    channels: tuple[int, int] = (1, 2),
) -> StationAntenna:
    return StationAntenna(
        site=site,
        zone=zone,
        position_m=(x_m, y_m, 0.0),
        boresight=towards,
        downlink_channel=channels[0],
        uplink_channel=channels[1],
        coverage_range_m=reach_m,
    )


def pattern(**more: float) -> AntennaPattern:
    settings = {"gain_dbi": 6.0, "beamwidth_deg": 60.0, "front_to_back_db": 30.0}
    return AntennaPattern(**settings | more)


def medium(*stations: StationAntenna, trains: int = 1, seed: int = 1, **more: Any) -> RadioMedium:
    return RadioMedium(description(*stations, trains=trains, **more), seed)


def description(*stations: StationAntenna, trains: int = 1, **more: Any) -> RadioDescription:
    settings: dict[str, Any] = {
        "sample_rate_hz": SIGNAL.sample_rate_hz,
        "samples": SIGNAL.samples,
        "carriers_hz": {1: DOWN_HZ, 2: UP_HZ, 3: 2.41e9, 4: 2.415e9},
        "stations": stations or (antenna(),),
        "trains": tuple(f"train_{n}" for n in range(trains)),
        "station_pattern": pattern(gain_dbi=12.0),
        "train_pattern": pattern(),
        "path_loss_exponent": 2.0,
        "noise_figure_db": 8.0,
        "oscillator_ppm": 0.0,
        **more,
    }
    return RadioDescription(**settings)


def at(
    *places_m: tuple[float, float], heading_rad: float = 0.0, speed_mps: float = 0.0
) -> TrainAntennas:
    """Return trains in the plane of the masts, all with one heading and speed."""
    count = len(places_m)
    direction = np.array([math.cos(heading_rad), math.sin(heading_rad), 0.0])
    return TrainAntennas(
        np.array([(x, y, 0.0) for x, y in places_m]),
        np.tile(direction * speed_mps, (count, 1)),
        np.full(count, heading_rad),
    )


def burst(amplitude: float = LOUD, lag_rad: float = 0.0) -> ComplexArray:
    return amplitude * modulate(SIGNAL, [lag_rad])


def hear(radio: RadioMedium, trains: TrainAntennas, **more: Any) -> Reception:
    """Return what the first train hears of the first station on channel 1."""
    return radio.downlink(0, 0.0, radio.paths(trains), {0: burst(**more)})[0, 1]


def read(received: Reception, max_offset_hz: float = 5e3) -> ToneEstimate:
    return FmToneReceiver(SIGNAL, max_offset_hz=max_offset_hz).estimate(received.samples)


def friis_dbm(power_dbm: float, gains_dbi: float, distance_m: float, carrier_hz: float) -> float:
    return power_dbm + gains_dbi - 20.0 * math.log10(4 * math.pi * distance_m * carrier_hz / C_MPS)


def power_dbm(samples: ComplexArray) -> float:
    return 10.0 * math.log10(np.mean(np.abs(samples) ** 2))


# Power ------------------------------------------------------------------------------------


@pytest.mark.parametrize("distance_m", [1.0, 10.0, 200.0, 1234.5])
def test_received_power_on_the_axis_is_that_of_friis(distance_m: float) -> None:
    heard = hear(medium(), at((distance_m, 0.0)))
    expected_dbm = friis_dbm(90.0, 12.0 + 6.0, distance_m, DOWN_HZ)
    assert 10.0 * math.log10(heard.signal_mw) == pytest.approx(expected_dbm, abs=1e-9)
    assert power_dbm(heard.samples) == pytest.approx(expected_dbm, abs=1e-4)
    assert heard.source == (0, 0)
    assert heard.snr == heard.signal_mw / heard.noise_mw


def test_the_path_loss_exponent_counts_from_one_metre() -> None:
    near, far = (hear(medium(path_loss_exponent=3.0), at((d, 0.0))) for d in (1.0, 100.0))
    assert near.signal_mw == pytest.approx(10 ** (friis_dbm(90, 18, 1, DOWN_HZ) / 10))
    assert near.signal_mw / far.signal_mw == pytest.approx(100.0**3.0)


def test_the_link_is_reciprocal_but_for_the_carrier() -> None:
    radio = medium(antenna(towards=(1.0, 0.3, 0.0)))
    paths = radio.paths(at((300.0, 40.0), heading_rad=0.2))
    down = radio.downlink(0, 0.0, paths, {0: burst()})[0, 1]
    up = radio.uplink(0, 0.0, paths, {0: (2, burst())})[0, 2]
    assert up.source == down.source == (0, 0)
    assert down.signal_mw / up.signal_mw == pytest.approx((UP_HZ / DOWN_HZ) ** 2)


@pytest.mark.parametrize("beamwidth_deg", [20.0, 60.0, 90.0])
def test_half_the_power_at_half_the_beamwidth(beamwidth_deg: float) -> None:
    half_rad = math.radians(beamwidth_deg / 2.0)
    radio = medium(
        antenna(),
        antenna(towards=(math.cos(half_rad), math.sin(half_rad), 0.0), site="wrs2"),
        antenna(towards=(math.cos(half_rad), 0.0, -math.sin(half_rad)), site="wrs3"),
        station_pattern=pattern(beamwidth_deg=beamwidth_deg),
    )
    gain_db = radio.paths(at((500.0, 0.0))).gain_db[:, 0]
    assert gain_db[0] - gain_db[1:] == pytest.approx([3.0, 3.0], abs=1e-9)


@pytest.mark.parametrize("front_to_back_db", [0.0, 10.0, 30.0])
def test_front_to_back_ratio(front_to_back_db: float) -> None:
    both = pattern(front_to_back_db=front_to_back_db)
    radio = medium(station_pattern=both, train_pattern=both)
    ahead, behind = (radio.paths(at((x, 0.0))).gain_db[0, 0] for x in (300.0, -300.0))
    # Behind the station both antennas are turned away from each other.
    assert ahead - behind == pytest.approx(2.0 * front_to_back_db)


def test_the_train_antenna_looks_back_along_the_track() -> None:
    radio = medium()
    gains_db = [
        float(radio.paths(at((300.0, 0.0), heading_rad=h)).gain_db[0, 0])
        for h in (0.0, math.radians(30.0), -math.radians(30.0), math.pi)
    ]
    assert np.array(gains_db[0]) - gains_db == pytest.approx([0.0, 3.0, 3.0, 30.0], abs=1e-9)


# Delay and Doppler ------------------------------------------------------------------------


@pytest.mark.parametrize("place_m", [(1.0, 0.0), (37.5, 3.0), (199.999, -3.0), (640.25, 120.0)])
def test_the_delay_of_the_envelope_is_the_distance(place_m: tuple[float, float]) -> None:
    radio = medium()
    paths = radio.paths(at(place_m))
    one_way_m_per_rad = C_MPS / (2 * math.pi * SIGNAL.tones_hz[0])
    for received in (
        radio.downlink(0, 0.0, paths, {0: burst()})[0, 1],
        radio.uplink(0, 0.0, paths, {0: (2, burst())})[0, 2],
    ):
        found_m = float(read(received).phase_lag_rad[0]) * one_way_m_per_rad
        assert found_m == pytest.approx(math.hypot(*place_m), abs=1e-3)


def test_the_phase_of_the_carrier_is_that_of_the_same_path() -> None:
    radio = medium()
    step_m = 0.25 * C_MPS / DOWN_HZ
    near, far = (hear(radio, at((100.0 + x, 0.0))).samples for x in (0.0, step_m))
    # A quarter of a wavelength further: a quarter turn later.
    turn = np.angle(np.vdot(near, far))
    assert turn == pytest.approx(-math.pi / 2.0, abs=1e-3)


@pytest.mark.parametrize("speed_mps", [83.3, 0.0, -83.3])
def test_an_approaching_train_hears_a_higher_carrier(speed_mps: float) -> None:
    # Heading east with the station to the east: positive speed approaches.
    radio = medium(antenna(400.0, towards=(-1.0, 0.0, 0.0)))
    trains = at((0.0, 0.0), speed_mps=speed_mps)
    paths = radio.paths(trains)
    assert paths.closing_speed_mps[0, 0] == pytest.approx(speed_mps)
    down = radio.downlink(0, 0.0, paths, {0: burst()})[0, 1]
    up = radio.uplink(0, 0.0, paths, {0: (2, burst())})[0, 2]
    assert read(down).frequency_offset_hz == pytest.approx(DOWN_HZ * speed_mps / C_MPS, abs=0.1)
    assert read(up).frequency_offset_hz == pytest.approx(UP_HZ * speed_mps / C_MPS, abs=0.1)


def test_only_the_speed_along_the_line_of_sight_shifts() -> None:
    radio = medium(antenna(300.0, 300.0, towards=(-1.0, -1.0, 0.0)))
    closing = radio.paths(at((0.0, 0.0), (300.0, 0.0), speed_mps=50.0)).closing_speed_mps
    assert closing[0] == pytest.approx([50.0 / math.sqrt(2.0), 0.0], abs=1e-12)


def test_doppler_leaves_the_range_alone() -> None:
    radio = medium()
    still, fast = (
        float(read(hear(radio, at((150.0, 0.0), speed_mps=v))).phase_lag_rad[0]) for v in (0, 90)
    )
    # To first order; the tone itself shifts by v/c of 375 kHz, 0.1 Hz, over a 240 us burst.
    assert fast == pytest.approx(still, abs=1e-5)


# Oscillators ------------------------------------------------------------------------------


def offsets_hz(radio: RadioMedium, station: int, train: int, trains: int) -> tuple[float, float]:
    """Return the carrier offset [Hz] that train and station see of each other."""
    paths = radio.paths(at(*[(200.0, 0.0)] * trains))
    down = radio.downlink(0, 0.0, paths, {station: burst()})[train, 1]
    up = radio.uplink(0, 0.0, paths, {train: (2, burst())})[station, 2]
    return float(read(down).frequency_offset_hz), float(read(up).frequency_offset_hz)


def test_both_ends_see_the_same_offset_with_opposite_sign() -> None:
    radio = medium(oscillator_ppm=0.5)
    down_hz, up_hz = offsets_hz(radio, 0, 0, 1)
    assert abs(down_hz) > 10.0
    assert down_hz / DOWN_HZ == pytest.approx(-up_hz / UP_HZ, abs=1e-10)


def test_a_site_has_one_oscillator_and_a_train_another() -> None:
    radio = medium(
        antenna(zone="zone1"),
        antenna(zone="zone2"),
        antenna(site="wrs2", zone="zone3"),
        trains=2,
        oscillator_ppm=0.5,
    )
    found = {(s, t): offsets_hz(radio, s, t, 2)[0] for s in range(3) for t in range(2)}
    for train in range(2):
        assert found[0, train] == pytest.approx(found[1, train], abs=0.1)
        assert abs(found[0, train] - found[2, train]) > 10.0
    # offsets are differences of one figure per unit
    assert found[0, 0] - found[0, 1] == pytest.approx(found[2, 0] - found[2, 1], abs=0.2)


def test_oscillators_spread_as_described() -> None:
    stations = [antenna(site=f"wrs{n}") for n in range(400)]
    radio = medium(*stations, oscillator_ppm=0.3)
    paths = radio.paths(at((200.0, 0.0)))
    heard = radio.uplink(0, 0.0, paths, {0: (2, burst())})
    found_hz = read(
        Reception(np.array([heard[s, 2].samples for s in range(400)]), 1.0, 1.0, (0, 0))
    ).frequency_offset_hz
    # The stations' spread about the train's own offset; 5 sigma of a standard deviation.
    assert np.std(found_hz / UP_HZ) == pytest.approx(0.3e-6, rel=5.0 / math.sqrt(800.0))


# Who hears whom ---------------------------------------------------------------------------


def ears(radio: RadioMedium, paths: Paths, tick: int = 0, time_s: float = 0.0) -> set[str]:
    """Return who hears anything when everybody calls: 's0' a station antenna, 't0' a train."""
    stations = dict.fromkeys(range(len(radio.description.stations)), burst())
    trains = {t: (2, burst()) for t in range(len(radio.description.trains))}
    down = radio.downlink(tick, time_s, paths, stations)
    up = radio.uplink(tick, time_s, paths, trains)
    return {f"t{train}" for train, _ in down} | {f"s{station}" for station, _ in up}


def test_reach_cuts_both_ways() -> None:
    radio = medium(antenna(reach_m=400.0))
    assert ears(radio, radio.paths(at((399.999, 0.0)))) == {"s0", "t0"}
    assert ears(radio, radio.paths(at((400.001, 0.0)))) == set()
    assert ears(radio, radio.paths(at((-400.001, 0.0)))) == set()


def test_what_drowns_in_noise_is_not_there() -> None:
    radio = medium(sensitivity_db=0.0)
    paths = radio.paths(at((100.0, 0.0)))
    floor_mw = radio.noise_mw / 10 ** (friis_dbm(0.0, 18.0, 100.0, DOWN_HZ) / 10)
    for factor, heard in ((1.01, True), (0.99, False)):
        blocks = {0: burst(math.sqrt(floor_mw * factor))}
        assert ((0, 1) in radio.downlink(0, 0.0, paths, blocks)) is heard


def test_a_silent_station_is_not_heard_and_a_foreign_channel_neither() -> None:
    radio = medium(antenna(), antenna(channels=(3, 4), site="wrs2"))
    paths = radio.paths(at((100.0, 0.0)))
    assert radio.downlink(0, 0.0, paths, {}) == {}
    assert radio.uplink(0, 0.0, paths, {}) == {}
    assert set(radio.downlink(0, 0.0, paths, {1: burst()})) == {(0, 3)}
    assert set(radio.uplink(0, 0.0, paths, {0: (4, burst())})) == {(1, 4)}


def test_a_dead_station_neither_sends_nor_hears() -> None:
    fault = RadioFault(kind="dead_station", station="wrs1", from_s=10.0, to_s=20.0)
    radio = medium(antenna(), antenna(site="wrs2"), faults=(fault,))
    paths = radio.paths(at((100.0, 0.0)))
    for time_s, alive in ((9.9, True), (10.0, False), (19.9, False), (20.0, True)):
        down = radio.downlink(0, time_s, paths, {0: burst()})
        up = radio.uplink(0, time_s, paths, {0: (2, burst())})
        assert ((0, 1) in down) is alive
        assert ((0, 2) in up) is alive
        assert (1, 2) in up


def test_every_antenna_of_a_dead_site_is_dead() -> None:
    fault = RadioFault(kind="dead_station", station="wrs1", from_s=0.0, to_s=1e6)
    radio = medium(
        antenna(), antenna(zone="zone2"), antenna(site="wrs2", zone="zone3"), faults=(fault,)
    )
    assert radio.dead_stations(0.0) == {0, 1}


def test_a_train_that_is_not_on_the_line_hears_nothing_and_is_not_heard() -> None:
    columns = STATE.index
    state = np.zeros((2, len(columns)))
    state[:, columns["x_m"]] = 100.0
    state[:, columns["speed_mps"]] = 20.0
    state[0, columns["on_line"]] = 1.0
    radio = medium(trains=2)
    trains = antennas_of(state)
    assert trains.velocity_mps.tolist()[0] == [20.0, 0.0, 0.0]
    assert ears(radio, radio.paths(trains)) == {"t0", "s0"}
    # The table of the truth is not the medium's to change.
    assert state[1, columns["x_m"]] == 100.0
    heard = radio.uplink(0, 0.0, radio.paths(trains), {1: (2, burst())})
    assert heard == {}


def test_blocks_that_repeat_and_blocks_that_do_not_arrive_as_their_sum() -> None:
    one, other = antenna(), antenna(x_m=60.0, site="wrs2", zone="z2")
    radio = medium(one, other)
    trains = at((110.0, 0.0))
    paths = radio.paths(trains)
    rough = LOUD * np.exp(1j * np.cumsum(np.random.default_rng(2).normal(size=SIGNAL.samples)))
    parts = [
        radio.downlink(0, 0.0, paths, blocks)[0, 1].samples for blocks in ({0: burst()}, {1: rough})
    ]
    both = radio.downlink(0, 0.0, paths, {0: burst(), 1: rough})[0, 1].samples
    scale = np.abs(both).max()
    np.testing.assert_allclose(both, parts[0] + parts[1], rtol=0, atol=1e-5 * scale)


def test_a_block_of_another_length_is_refused() -> None:
    radio = medium()
    paths = radio.paths(at((50.0, 0.0)))
    with pytest.raises(ValueError, match="a block of 32 samples, not 960"):
        radio.downlink(0, 0.0, paths, {0: burst()[:32]})
