"""The CBTC medium: gains, fading along the way, noise, faults; independent links."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import j0, jv

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.train_radio.mimo_fading import MimoFading
from rail_signals.train_radio.path_loss import path_loss_db
from rail_world.train_radio.description import BaseStation, CbtcDescription, CbtcFault, LossSection
from rail_world.train_radio.fading_kernel import node_count, scattered
from rail_world.train_radio.links import COLUMNS
from rail_world.train_radio.medium import Burst, CbtcMedium, Links

from .pure_fading import gains

RATE_HZ, TICK_S, SAMPLES = 400e3, 0.1, 40_000
DOWN_HZ, UP_HZ = {1: 2.412e9, 2: 2.422e9}, {1: 2.452e9, 2: 2.462e9}
ALWAYS = {"from_s": 0.0, "to_s": 1e6}
DEAD = CbtcFault(kind="dead_base_station", base_station="x", **ALWAYS)
#: Noise out of sight: the widest margin that a link may have.
CLEAR = {"snr_offset_db": 60.0, "base_power_dbm": 60.0, "train_power_dbm": 60.0}
LAMBDA_M = SPEED_OF_LIGHT_M_PER_S / DOWN_HZ[1]


def masts(*places: tuple[float, int], track: str = "main") -> tuple[BaseStation, ...]:
    return tuple(
        BaseStation(
            name=f"{track}_b{n}", track=track, chainage_m=x, position_m=(x, 6.0, 8.0),
            channel=channel,
        )
        for n, (x, channel) in enumerate(places)
    )  # fmt: skip


def medium(count: int = 1, seed: int = 1, **more: Any) -> CbtcMedium:
    described: dict[str, Any] = {
        "base_stations": masts((1000.0, 1), (3000.0, 2)),
        "trains": tuple(f"t{n}" for n in range(count)),
        "downlink_hz": DOWN_HZ,
        "uplink_hz": UP_HZ,
        "sample_rate_hz": RATE_HZ,
        "base_antennas": 2,
        "train_antennas": 2,
        "base_power_dbm": 30.0,
        "train_power_dbm": 30.0,
        "noise_figure_db": 6.0,
        "path_loss_exponent": 3.0,
        "coverage_range_m": 3000.0,
        "rician_factor": 0.0,
        "snr_offset_db": 0.0,
        **more,
    }
    return CbtcMedium(CbtcDescription(**described), seed, TICK_S)


def at(
    *chainage_m: float, speed_mps: float = 0.0, acceleration_mps2: float = 0.0, track: int = 0
) -> FloatArray:
    state = np.zeros((len(chainage_m), 10))
    state[:, 0] = state[:, 1] = state[:, 8] = chainage_m
    state[:, 5], state[:, 6], state[:, 7] = speed_mps, acceleration_mps2, track
    state[:, 9] = 1.0
    return state


def ones(start: int = 0, count: int = SAMPLES, only: int | None = None) -> Burst:
    samples = np.ones((2, count), dtype=np.complex128)
    if only is not None:
        samples[1 - only] = 0.0
    return Burst(start, samples)


def hear(
    radio: CbtcMedium,
    links: Links,
    *spans: tuple[int, int],
    sent: dict[int, list[Burst]] | None = None,
    train: int = 0,
    channel: int = 1,
) -> NDArray[np.complex64]:
    windows = {(train, channel): spans or ((0, SAMPLES),)}
    heard = radio.downlink(links, {0: [ones(only=0)]} if sent is None else sent, windows)
    return np.concatenate([burst.samples for burst in heard[train, channel]], axis=1)


def without_noise(radio: CbtcMedium, links: Links, *spans: tuple[int, int]) -> ComplexArray:
    return np.asarray(hear(radio, links, *spans) - hear(radio, links, *spans, sent={}), complex)


def test_the_columns_are_those_of_the_topic() -> None:
    from rail_msgs_py.topics.world import STATE

    assert STATE.columns == COLUMNS


# Gains ------------------------------------------------------------------------------------


@pytest.mark.parametrize("chainage_m", [700.0, 1000.0, 1003.0, 2400.0])
def test_gain_is_that_of_the_path_loss(chainage_m: float) -> None:
    links = medium(snr_offset_db=-3.0).links(0, 0.0, at(chainage_m))
    distance_m = math.hypot(chainage_m - 1000.0, 6.0, 8.0)
    assert links.distance_m[0, 0] == pytest.approx(distance_m)
    assert links.sight[0, 0] == pytest.approx((chainage_m - 1000.0) / distance_m)
    for direction, carrier_hz in enumerate((DOWN_HZ[1], UP_HZ[1])):
        loss_db = float(path_loss_db(distance_m, carrier_hz, exponent=3.0)) + 3.0
        assert links.gain_db[direction, :, 0, 0] == pytest.approx(-loss_db)


def test_the_begin_of_a_tick_is_the_end_of_the_one_before() -> None:
    radio = medium(sections=(cutting(1500.0, 1515.0, edge_m=10.0),))
    before = radio.links(0, 0.0, at(1500.0, speed_mps=80.0))
    moved_m = (80.0 + 81.0) / 2.0 * TICK_S
    after = radio.links(1, 0.1, at(1500.0 + moved_m, speed_mps=81.0, acceleration_mps2=10.0))
    np.testing.assert_allclose(after.gain_db[:, 0], before.gain_db[:, 1], atol=1e-9)
    assert np.abs(after.gain_db[:, 1] - before.gain_db[:, 1]).min() > 0.05


def cutting(from_m: float, to_m: float, edge_m: float = 0.0) -> LossSection:
    return LossSection(
        kind="cutting", track="main", from_m=from_m, to_m=to_m, edge_m=edge_m, wall_loss_db=12.0
    )


def test_sections_attenuate() -> None:
    tunnel = LossSection(
        kind="tunnel", track="main", from_m=1200.0, to_m=1400.0, entry_loss_db=10.0,
        loss_db_per_m=0.05,
    )  # fmt: skip
    tracks = ("main", "other")
    open_air, lossy = medium(5, tracks=tracks), medium(5, sections=(tunnel,), tracks=tracks)
    state = at(1100.0, 1250.0, 1390.0, 1500.0, 1250.0)
    state[4, 7] = 1.0  # beside the tunnel, not in it
    lost_db = open_air.links(0, 0.0, state).gain_db - lossy.links(0, 0.0, state).gain_db
    np.testing.assert_allclose(lost_db[0, 1, 0], [0.0, 12.5, 19.5, 30.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(lost_db[1, 1, 1], [30.0, 17.5, 10.5, 0.0, 0.0], atol=1e-9)


def test_in_a_section_of_another_track_the_better_end_counts() -> None:
    tunnel = LossSection(
        kind="tunnel", track="other", from_m=1200.0, to_m=1400.0, entry_loss_db=10.0,
        loss_db_per_m=0.05,
    )  # fmt: skip
    state = at(1250.0, 1390.0, track=1)
    tracks = ("main", "other")
    gains = [
        medium(2, tracks=tracks, sections=s).links(0, 0.0, state).gain_db[0, 1, 0]
        for s in ((), (tunnel,))
    ]
    np.testing.assert_allclose(gains[0] - gains[1], [12.5, 10.5], atol=1e-9)


# Signal and noise -------------------------------------------------------------------------


@pytest.mark.parametrize("uplink", [False, True])
def test_a_block_has_the_expected_ratio_of_signal_to_noise(uplink: bool) -> None:
    radio = medium(200, seed=3)
    links = radio.links(2, 0.2, at(*[1300.0] * 200))
    power_mw = 10.0 ** (10.0 / 10.0)
    burst = Burst(0, np.full((2, 200), math.sqrt(power_mw / 2.0), dtype=np.complex128))
    spans = [(0, 200), (600, 1000)]
    heard: list[tuple[Burst, ...]]
    if uplink:
        heard = [radio.uplink(links, {train: (1, [burst])}, {0: spans})[0] for train in range(200)]
    else:
        found = radio.downlink(links, {0: [burst]}, {(t, 1): spans for t in range(200)})
        heard = [found[t, 1] for t in range(200)]
    noise_mw = np.mean([np.abs(pair[1].samples) ** 2 for pair in heard[: 1 if uplink else 200]])
    assert noise_mw == pytest.approx(radio.noise_mw, rel=0.15 if uplink else 0.01)
    thermal_dbm = -173.975 + 6.0 + 10.0 * math.log10(RATE_HZ)
    assert radio.noise_mw == pytest.approx(10.0 ** (thermal_dbm / 10.0))
    signal_mw = np.mean([np.abs(pair[0].samples) ** 2 for pair in heard]) - noise_mw
    expected = radio.snr(links, uplink=uplink, power_dbm=10.0)[0]
    # The mean of 400 exponential variates.
    assert signal_mw / radio.noise_mw == pytest.approx(expected.mean(), rel=4.0 / math.sqrt(400))


def test_noise_is_white_and_differs_by_antenna_and_port() -> None:
    radio = medium(2)
    links = radio.links(2, 0.2, at(1300.0, 1400.0))
    both = [hear(radio, links, sent={}, train=n) for n in (0, 1)]
    x = np.concatenate(both) / math.sqrt(radio.noise_mw)
    covariance = x @ x.conj().T / SAMPLES
    np.testing.assert_allclose(covariance, np.eye(4), atol=5.0 / math.sqrt(SAMPLES))
    lagged = np.mean(x[:, 1:] * x[:, :-1].conj(), axis=1)
    assert np.abs(lagged).max() < 5.0 / math.sqrt(SAMPLES)


def test_a_window_hears_what_the_whole_tick_hears() -> None:
    radio = medium()
    links = radio.links(3, 0.3, at(1300.0, speed_mps=70.0))
    sent = {0: [ones(100, 1200), ones(5000, 1200), ones(30_000, 5_000)]}
    whole = hear(radio, links, sent=sent)
    for spans in (((0, 700), (650, 6000)), ((29_000, 40_000),), ((6100, 6101),)):
        parts = hear(radio, links, *spans, sent=sent)
        expected = np.concatenate([whole[:, start:stop] for start, stop in spans], axis=1)
        np.testing.assert_array_equal(parts, expected)


def test_co_channel_base_stations_add() -> None:
    radio = medium(base_stations=masts((1000.0, 1), (3000.0, 2), (1500.0, 1)))
    links = radio.links(1, 0.1, at(1300.0, speed_mps=30.0))
    span = (1000, 3000)
    quiet = hear(radio, links, span, sent={})
    one, other, both = (
        hear(radio, links, span, sent={base: [ones(900, 1500)] for base in bases}) - quiet
        for bases in ((0,), (2,), (0, 2))
    )
    np.testing.assert_allclose(both, one + other, atol=1e-5 * np.abs(both).max())
    assert np.abs(one).max() > 0.0 and np.abs(other).max() > 0.0
    assert not np.any(hear(radio, links, span, sent={1: [ones()]}) - quiet)  # on channel 2


# Fading -----------------------------------------------------------------------------------


def test_the_waves_add_up_to_the_field() -> None:
    field = MimoFading(np.random.default_rng(4), 2, 2, 0.125)
    place_m = 54_321.0 + np.linspace(0.0, 7.0, 40)
    turns_per_m, start = field.waves
    room = np.empty((2, turns_per_m.shape[-1]))
    for rx, tx in np.ndindex(2, 2):
        waves = turns_per_m[rx, tx], start[rx, tx].real.copy(), start[rx, tx].imag.copy()
        for kernel in (scattered, scattered.py_func):
            found = [complex(*kernel(*waves, at_m, room)) for at_m in place_m]
            np.testing.assert_allclose(found, field.at(place_m)[rx, tx], atol=1e-6)


@pytest.mark.parametrize("speed_mps", [0.5, 20.0, 90.0, 140.0])
@pytest.mark.parametrize("count", [2, 300, 1200, 2048])
@pytest.mark.parametrize("rician_factor", [0.0, 5.0])
def test_gains_between_nodes_err_by_less_than_55_db(
    speed_mps: float, count: int, rician_factor: float
) -> None:
    radio = medium(rician_factor=rician_factor)
    links = radio.links(3, 0.3, at(1030.0, speed_mps=speed_mps, acceleration_mps2=2.0))
    begin = 8000
    time_s = (begin + np.arange(count)) / RATE_HZ
    exact = gains(1, links, (0, 0, 0), time_s, DOWN_HZ[1], rician_factor)
    amplitude = 10.0 ** (links.gain_db[0, 1, 0, 0] / 20.0)
    quiet = hear(radio, links, (begin, begin + count), sent={})
    for antenna in (0, 1):
        sent = {0: [Burst(begin, 1e9 * ones(count=count, only=antenna).samples)]}
        heard = hear(radio, links, (begin, begin + count), sent=sent) - quiet
        error = np.abs(1e-9 * heard - exact[:, antenna]).max()
        assert error < 10.0 ** (-55.0 / 20.0) * amplitude


def test_enough_nodes_are_taken() -> None:
    for x in np.geomspace(1e-3, 300.0, 300).tolist():
        nodes = node_count(x)
        assert 4.0 * np.abs(jv(np.arange(nodes, nodes + 60), x)).sum() < 1e-3


def test_ticks_join_without_a_step() -> None:
    radio = medium(**CLEAR, rician_factor=1.0)
    speed, path, a = 60.0, 1200.0, 8.0
    edges = []
    for tick in range(6):
        links = radio.links(tick, tick * TICK_S, at(path, speed_mps=speed, acceleration_mps2=a))
        head, tail = (
            without_noise(radio, links, (0, 3)),
            without_noise(radio, links, (39_997, SAMPLES)),
        )
        edges.append((head, tail))
        path += speed * TICK_S + 0.5 * a * TICK_S**2
        speed += a * TICK_S
    for (_, tail), (head, _) in pairwise(edges):
        predicted = 2.0 * tail[:, -1] - tail[:, -2]
        assert np.abs(head[:, 0] - predicted).max() < 3e-3 * np.abs(tail).max()
        assert np.abs(head[:, 0] - head[:, 1]).max() < 0.03 * np.abs(tail).max()


def test_along_a_run_the_channel_is_rayleigh_with_the_spectrum_of_jakes() -> None:
    radio, speed_mps = medium(**CLEAR), 80.0
    spans = [(n, n + 1) for n in range(0, SAMPLES, 400)]  # 1 ms, 8 cm
    sent = {0: [ones(start, 1, only=0) for start, _ in spans]}
    runs = []
    for tick in range(12):
        links = radio.links(tick, 0.1 * tick, at(1500.0 + 8.0 * tick, speed_mps=speed_mps))
        gain = 10.0 ** (links.gain_db[0, 1, 0, 0] / 20.0)
        runs.append(hear(radio, links, *spans, sent=sent) / gain)
    h = np.concatenate(runs, axis=1)
    power = np.abs(h) ** 2
    assert power.mean() == pytest.approx(1.0, abs=0.1)
    assert np.mean(power**2) / power.mean() ** 2 == pytest.approx(2.0, abs=0.2)
    assert np.mean(power < 0.1) == pytest.approx(1.0 - math.exp(-0.1), abs=0.03)
    for lag in (1, 2, 3):
        found = np.mean(h[:, lag:] * h[:, :-lag].conj()) / power.mean()
        apart_m = lag * speed_mps * 400 / RATE_HZ
        assert abs(found - j0(2.0 * math.pi * apart_m / LAMBDA_M)) < 0.12


def test_a_train_that_stands_has_a_constant_channel() -> None:
    radio = medium(**CLEAR, rician_factor=2.0)
    heard = [
        without_noise(radio, radio.links(tick, 0.1 * tick, at(1200.0)), (0, 50), (39_000, 39_050))
        for tick in (0, 7)
    ]
    scale = np.abs(heard[0]).max()
    np.testing.assert_allclose(heard[1], heard[0], atol=1e-6 * scale)
    np.testing.assert_allclose(heard[0], heard[0][:, :1].repeat(100, axis=1), atol=1e-6 * scale)


def test_the_line_of_sight_shifts_up_before_the_mast_and_down_behind() -> None:
    radio = medium(**CLEAR, rician_factor=1e3)
    for chainage_m, cosine in ((800.0, -1.0), (1200.0, 1.0)):
        links = radio.links(1, 0.1, at(chainage_m, speed_mps=60.0))
        h = without_noise(radio, links, (38_000, SAMPLES))
        shift_hz = np.angle(np.mean(h[:, 1:] * h[:, :-1].conj())) * RATE_HZ / (2.0 * math.pi)
        assert shift_hz == pytest.approx(-cosine * 60.0 / LAMBDA_M, rel=0.02)


# Reach and faults -------------------------------------------------------------------------


def test_out_of_reach_nothing_is_delivered() -> None:
    radio = medium(3, coverage_range_m=500.0)
    state = at(1400.0, 1600.0, 1400.0)
    state[2, 9] = 0.0  # not on the line
    links = radio.links(0, 0.0, state)
    assert links.in_coverage.tolist() == [[True, False, False], [False, False, False]]
    windows = {(t, c): [(0, 10)] for t in range(3) for c in (1, 2)}
    assert list(radio.downlink(links, {0: [ones()], 1: [ones()]}, windows)) == [(0, 1)]
    sent = {train: (1, [ones()]) for train in range(3)}
    assert list(radio.uplink(links, sent, {0: [(0, 10)], 1: [(0, 10)]})) == [0]
    snr = radio.snr(links)
    assert snr[0, 0] > 0.0 and np.count_nonzero(snr) == 1


def test_faults_act_in_their_time_only() -> None:
    faults = (
        CbtcFault(kind="dead_base_station", base_station="main_b0", from_s=1.0, to_s=2.0),
        CbtcFault(kind="jam", channel=1, noise_dbm=-60.0, from_s=3.0, to_s=4.0),
    )
    radio, span = medium(faults=faults), (0, 4000)
    strong = [Burst(0, 30.0 * ones().samples)]
    for time_s in (0.5, 1.5, 2.0, 3.5, 4.0):
        links = radio.links(round(10 * time_s), time_s, at(1100.0))
        quiet = hear(radio, links, span, sent={})
        dead = not np.any(hear(radio, links, span, sent={0: strong}) - quiet)
        assert dead == (time_s == 1.5)
        assert (0 not in radio.uplink(links, {0: (1, strong)}, {0: [span]})) == dead
        assert (radio.snr(links)[0, 0] == 0.0) == dead
        noise_mw = 1e-6 if time_s == 3.5 else radio.noise_mw
        assert np.mean(np.abs(quiet) ** 2) == pytest.approx(noise_mw, rel=0.05)


# Independence -----------------------------------------------------------------------------


def test_a_link_is_the_same_whatever_the_others_do() -> None:
    def heard(order: int, others: bool) -> tuple[NDArray[Any], NDArray[Any]]:
        radio = medium(3, seed=9, rician_factor=1.0)
        links = radio.links(5, 0.5, at(1300.0, 1350.0, 2600.0, speed_mps=50.0))
        ports = [(0, 1), (1, 1), (2, 2), (1, 2)] if others else [(1, 1)]
        sent = {1: [ones(0, 90)], 0: [ones(10, 90)]} if others else {0: [ones(10, 90)]}
        windows = {port: [(0, 300)] for port in ports[::order]}
        up: dict[int, Any] = {1: (1, [ones(20, 70)]), 2: (2, [ones(20, 70)])}
        if not others:
            del up[2]
        by_base = {base: [(0, 300)] for base in ((0, 1)[::order] if others else (0,))}
        down = radio.downlink(links, sent, windows)[1, 1][0]
        return down.samples, radio.uplink(links, up, by_base)[0][0].samples

    first = heard(1, True)
    for other in (heard(-1, True), heard(1, False)):
        np.testing.assert_array_equal(other[0], first[0])
        np.testing.assert_array_equal(other[1], first[1])
    assert not np.allclose(first[0], first[1])  # a direction fades by itself


def test_seeds_ticks_and_links_differ() -> None:
    place = at(1300.0, 1300.0)
    base = medium(2)
    reference = hear(base, base.links(4, 0.4, place), (0, 8))
    for radio, tick, train in ((medium(2, seed=2), 4, 0), (medium(2), 5, 0), (medium(2), 4, 1)):
        other = hear(radio, radio.links(tick, 0.4, place), (0, 8), train=train)
        assert not np.any(other == reference)


# Descriptions -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"base_stations": masts((0.0, 1)) * 2}, "main_b0 comes twice"),
        ({"trains": ("a", "a")}, "a comes twice"),
        ({"tracks": ("other",)}, "no track main"),
        ({"base_stations": masts((0.0, 3))}, "none for channel 3 of main_b0"),
        ({"uplink_hz": DOWN_HZ}, "nearer than 400000"),
        ({"base_antennas": 3}, "base_antennas"),
        ({"faults": (CbtcFault(kind="jam", channel=7, **ALWAYS),)}, "on channel 7"),
        ({"faults": (DEAD,)}, "no base station x"),
        ({"sample_rate_hz": 400_003.0}, "whole number"),
    ],
)
def test_a_description_that_cannot_be_is_refused(more: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        medium(**more)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"kind": "tunnel", "wall_loss_db": 3.0}, "wall_loss_db: 3 does not go with a tunnel"),
        ({"kind": "cutting"}, "a cutting needs it"),
        ({"kind": "cutting", "wall_loss_db": 3.0, "to_m": 5.0}, "got 5"),
    ],
)
def test_a_section_that_cannot_be_is_refused(more: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        LossSection(**{"track": "main", "from_m": 10.0, "to_m": 20.0, **more})


def test_wrong_tables_bursts_and_windows_are_refused() -> None:
    radio = medium()
    links = radio.links(0, 0.0, at(1300.0))
    with pytest.raises(ValueError, match=r"\(2, 10\), not \(1, 10\)"):
        radio.links(0, 0.0, at(1.0, 2.0))
    with pytest.raises(ValueError, match="window"):
        hear(radio, links, (0, SAMPLES + 1))
    with pytest.raises(ValueError, match="40001 is not in"):
        hear(radio, links, sent={0: [ones(1)]})
    with pytest.raises(ValueError, match=r"\(1, 5\), not \[2"):
        hear(radio, links, sent={0: [Burst(0, np.ones((1, 5)) + 0j)]})
    for bursts in ([ones(50, 10), ones(0, 10)], [ones(0, 100), ones(99, 10)]):
        with pytest.raises(ValueError, match="overlap, or are not in their order"):
            hear(radio, links, sent={0: bursts})
