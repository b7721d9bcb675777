"""The rails as a medium: attenuation, joints, shunts, faults, noise; independent bits."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from rail_signals.arrays import FloatArray
from rail_world.track_code.description import Harmonic, RailDescription, RailFault, TrackCircuit
from rail_world.track_code.medium import RailMedium, TrainsOnRails
from rail_world.track_code.noise import RealNoiseSource

RATE_HZ, TICK_S, SAMPLES = 16_000.0, 0.1, 1600
LENGTH_M = 500.0
ONE = np.ones(SAMPLES)
RAILS = {
    "sample_rate_hz": RATE_HZ,
    "attenuation_db_per_km": 6.0,
    "joint_attenuation_db": 40.0,
    "white_noise_v": 0.0,
    "impulse_rate_per_s": 0.0,
    "impulse_amplitude_v": 0.0,
}
#: Of a fault that is there for good.
ALWAYS = {"from_s": 0.0, "to_s": 1e6}


def circuits(count: int = 6, track: str = "main", prefix: str = "tc") -> tuple[TrackCircuit, ...]:
    return tuple(
        TrackCircuit(
            name=f"{prefix}{n}", track=track, start_m=n * LENGTH_M, end_m=(n + 1) * LENGTH_M,
            carrier_hz=(1700.0, 2300.0)[n % 2],
        )
        for n in range(count)
    )  # fmt: skip


def medium(trains: int = 1, seed: int = 1, **more: Any) -> RailMedium:
    described: dict[str, Any] = {
        "circuits": circuits(),
        "trains": tuple(f"t{n}" for n in range(trains)),
        **RAILS,
        **more,
    }
    return RailMedium(RailDescription(**described), seed, TICK_S)


SANDED = RailFault(kind="sanding", train="t9", loss_db=60.0, **ALWAYS)


def broken(circuit: str, at_m: float | None = None, **when: float) -> RailFault:
    fields = {"kind": "broken_rail", "circuit": circuit, "at_m": at_m, "loss_db": 60.0}
    return RailFault(**fields | ALWAYS | when)


def at(*front_m: float, length_m: float = 100.0, on_line: bool = True) -> TrainsOnRails:
    front = np.array(front_m)
    return TrainsOnRails(
        np.zeros(len(front), dtype=np.intp), front, front - length_m, np.full(len(front), on_line)
    )


def db(ratio: float) -> float:
    return 20.0 * math.log10(ratio)


def sine(frequency_hz: float, tick: int) -> FloatArray:
    turns = frequency_hz / RATE_HZ * (tick * SAMPLES + np.arange(SAMPLES))
    return np.asarray(np.sin(2.0 * np.pi * turns))


# Gains ------------------------------------------------------------------------------------


@pytest.mark.parametrize("front_m", [1000.0, 1200.0, 1499.0])
def test_a_train_hears_its_own_transmitter_by_the_way_to_it(front_m: float) -> None:
    heard = medium().propagate(0, 0.0, at(front_m), {2: ONE}).trains[0]
    assert db(heard[0]) == pytest.approx(-6.0 * (1500.0 - front_m) / 1000.0)
    np.testing.assert_array_equal(heard, heard[0])


@pytest.mark.parametrize(
    ("sender", "loss_db"),
    [
        (1, 6.0 * 0.3 + 40.0 + 50.0),  # behind: past a joint and its own axles
        (2, 6.0 * 0.2),
        (3, 6.0 * 0.7 + 40.0),
        (4, 6.0 * 1.2 + 80.0),
    ],
)
def test_neighbours_leak_across_joints(sender: int, loss_db: float) -> None:
    heard = medium().propagate(0, 0.0, at(1300.0), {sender: ONE}).trains[0]
    assert db(heard[0]) == pytest.approx(-loss_db)


def test_what_is_too_far_is_not_heard() -> None:
    rails = medium()
    assert not rails.propagate(0, 0.0, at(1300.0), {0: ONE, 5: ONE}).trains.any()


def test_signals_add_up() -> None:
    blocks = {n: sine(1700.0 + 100.0 * n, 0) for n in range(6)}
    whole = medium().propagate(0, 0.0, at(1300.0), blocks)
    parts = [medium().propagate(0, 0.0, at(1300.0), {n: blocks[n]}) for n in range(6)]
    np.testing.assert_allclose(whole.trains, sum(p.trains for p in parts), atol=1e-15)
    np.testing.assert_allclose(whole.circuits, sum(p.circuits for p in parts), atol=1e-15)


@pytest.mark.parametrize(
    ("front_m", "shunted"),
    [
        (1000.0, False),
        (1000.5, True),
        (1300.0, True),
        (1500.0, True),
        (1599.0, True),
        (1600.0, False),
    ],
)
def test_a_circuit_is_shunted_while_a_train_has_axles_in_it(front_m: float, shunted: bool) -> None:
    heard = medium().propagate(0, 0.0, at(front_m), {2: ONE}).circuits[2]
    assert db(heard[0]) == pytest.approx(-3.0 - (50.0 if shunted else 0.0))


def test_a_train_ahead_takes_the_signal_of_the_train_behind() -> None:
    heard = medium(2).propagate(0, 0.0, at(1100.0, 1400.0), {2: ONE}).trains[:, 0]
    assert db(heard[0]) == pytest.approx(-6.0 * 0.4 - 50.0)
    assert db(heard[1]) == pytest.approx(-6.0 * 0.1)


def test_tracks_do_not_hear_each_other() -> None:
    rails = medium(circuits=(*circuits(), *circuits(6, "other", "x")), tracks=("other", "main"))
    heard = rails.propagate(0, 0.0, at(1300.0), {2: ONE})
    assert not heard.trains.any()  # the train is on track 0, "other"
    assert db(heard.circuits[2, 0]) == pytest.approx(-3.0)  # and does not shunt "main"
    assert rails.circuit_of(at(1300.0)).tolist() == [8]


def test_a_train_across_a_junction_shunts_both_tracks() -> None:
    rails = medium(circuits=(*circuits(), *circuits(6, "other", "x")))
    trains = TrainsOnRails(
        np.array([1]), np.array([50.0]), np.array([2950.0]), np.array([True]), np.array([0])
    )
    heard = rails.propagate(0, 0.0, trains, dict.fromkeys(range(12), ONE))
    quiet = [n for n in range(12) if db(heard.circuits[n, 0]) < -30.0]
    assert quiet == [5, 6]


def test_a_train_that_is_not_on_the_line_neither_hears_nor_shunts() -> None:
    heard = medium().propagate(0, 0.0, at(1300.0, on_line=False), {2: ONE})
    assert not heard.trains.any()
    assert db(heard.circuits[2, 0]) == pytest.approx(-3.0)


# Motion -----------------------------------------------------------------------------------


def test_gains_run_straight_from_one_tick_to_the_next() -> None:
    rails, fronts = medium(), [1290.0, 1300.0, 1310.0, 1495.0, 1505.0, 1515.0]
    ticks = [
        rails.propagate(n, n * TICK_S, at(x), {2: ONE, 3: 0.5 * ONE}) for n, x in enumerate(fronts)
    ]
    for circuit in (None, 1, 3):
        heard = [r.trains[0] if circuit is None else r.circuits[circuit] for r in ticks]
        for before, tick in pairwise(heard):
            step = np.diff(tick)
            np.testing.assert_allclose(step, step[0], atol=1e-12)
            # The border is no larger a step than those about it.
            about = max(abs(step[0]), abs(before[-1] - before[-2]))
            assert abs(tick[0] - before[-1]) <= about + 1e-12


def test_after_a_gap_trains_stand() -> None:
    rails = medium()
    rails.propagate(0, 0.0, at(1100.0), {2: ONE})
    fresh = medium().propagate(7, 0.7, at(1300.0), {2: ONE})
    np.testing.assert_array_equal(
        rails.propagate(7, 0.7, at(1300.0), {2: ONE}).trains, fresh.trains
    )


# Faults -----------------------------------------------------------------------------------


def test_faults_act_in_their_time_only() -> None:
    faults = (
        RailFault(kind="sanding", train="t0", from_s=1.0, to_s=2.0, loss_db=30.0),
        RailFault(kind="dead_transmitter", circuit="tc2", from_s=3.0, to_s=4.0),
        broken("tc2", 1400.0, from_s=5.0, to_s=6.0),
    )
    rails = medium(faults=faults)
    found = {}
    for time_s in (0.5, 1.5, 2.0, 3.5, 4.0, 5.5, 6.0):
        # A tick number of its own each: nothing fades in from the one before.
        heard = rails.propagate(round(time_s * 20), time_s, at(1300.0), {2: ONE}).trains[0, 0]
        found[time_s] = db(heard) if heard else -math.inf
    assert found == {
        time_s: pytest.approx(-1.2 - loss_db)
        for time_s, loss_db in zip(found, (0.0, 30.0, 0.0, math.inf, 0.0, 60.0, 0.0), strict=True)
    }


def test_past_the_break_of_a_rail_the_signal_is_back() -> None:
    fault = broken("tc2")
    rails = medium(faults=(fault,))
    assert db(rails.propagate(0, 0.0, at(1240.0), {2: ONE}).trains[0, 0]) < -60.0
    heard = rails.propagate(5, 0.5, at(1260.0), {2: ONE})
    assert db(heard.trains[0, 0]) == pytest.approx(-6.0 * 0.24)
    clear = rails.propagate(9, 0.9, at(0.0, on_line=False), {2: ONE}).circuits[2, 0]
    assert db(clear) < -60.0  # so the circuit shows occupied


# Noise and harmonics ----------------------------------------------------------------------


def test_white_noise_is_white_gaussian_and_as_strong_as_said() -> None:
    rails = medium(4, white_noise_v=2e-3)
    noise = np.concatenate(
        [rails.propagate(n, 0.0, at(*[1300.0] * 4), {}).trains for n in range(50)], axis=1
    )
    count = noise.size
    assert noise.mean() == pytest.approx(0.0, abs=4 * 2e-3 / math.sqrt(count))
    assert noise.std() == pytest.approx(2e-3, rel=4 / math.sqrt(2 * count))
    assert np.mean((noise / 2e-3) ** 4) == pytest.approx(3.0, abs=4 * math.sqrt(96 / count))
    lag = np.mean(noise[:, 1:] * noise[:, :-1]) / 4e-6
    assert abs(lag) < 4 / math.sqrt(count)
    across = np.corrcoef(noise)[np.triu_indices(4, 1)]
    assert np.abs(across).max() < 4.5 / math.sqrt(count / 4)


def test_noise_depends_on_seed_stage_port_and_tick_only() -> None:
    source = RealNoiseSource(3, 7)
    whole = source.blocks(1, [0, 1, 2], 5)
    np.testing.assert_array_equal(RealNoiseSource(3, 7).blocks(1, [2], 5)[0], whole[2])
    others = [(3, 2, 0, 5), (3, 1, 9, 5), (3, 1, 0, 6), (4, 1, 0, 5)]
    for seed, stage, port, tick in others:
        assert not np.any(RealNoiseSource(seed, 7).blocks(stage, [port], tick)[0] == whole[0])


def test_impulses_come_as_often_and_as_high_as_said() -> None:
    rails = medium(4, impulse_rate_per_s=40.0, impulse_amplitude_v=0.5)
    heard = np.concatenate(
        [rails.propagate(n, 0.0, at(*[1300.0] * 4), {}).trains for n in range(100)], axis=1
    )
    counts = np.count_nonzero(heard, axis=1)  # 400 are expected in 10 s
    assert abs(counts - 400).max() < 4 * 20
    heights = np.abs(heard[heard != 0.0])
    assert heights.mean() == pytest.approx(0.5, rel=4 / math.sqrt(heights.size))
    assert abs(np.sign(heard).sum()) < 4 * math.sqrt(heights.size)


def test_harmonics_go_on_over_ticks() -> None:
    lines = (Harmonic(order=31, amplitude_v=0.3), Harmonic(order=47, amplitude_v=0.1))
    rails = medium(harmonics=lines, fundamental_hz=50.03)  # no whole number of turns in a tick
    first = 10_000_000
    heard = np.concatenate(
        [rails.propagate(n, 0.0, at(1300.0), {}).trains[0] for n in range(first, first + 10)]
    )
    t = np.arange(heard.size) / RATE_HZ
    for line in lines:
        tone = np.exp(-2j * np.pi * line.order * 50.03 * t) * np.hanning(t.size)
        amplitude = 2.0 * abs(np.sum(heard * tone)) / np.hanning(t.size).sum()
        assert amplitude == pytest.approx(line.amplitude_v, rel=1e-3)
        basis = np.stack(
            [f(2 * np.pi * n.order * 50.03 * t) for n in lines for f in (np.cos, np.sin)]
        )
    rest = heard - basis.T @ np.linalg.lstsq(basis.T, heard, rcond=None)[0]
    assert np.abs(rest).max() < 1e-6


def test_a_train_hears_the_same_whatever_the_others_do() -> None:
    settings: dict[str, Any] = {
        "white_noise_v": 1e-3, "impulse_rate_per_s": 20.0, "impulse_amplitude_v": 1.0,
        "harmonics": (Harmonic(order=31, amplitude_v=0.1),),
    }  # fmt: skip
    blocks = {n: sine(1700.0 + 600.0 * (n % 2), 4) for n in range(6)}
    alone = medium(1, **settings).propagate(4, 0.4, at(300.0), blocks)
    for fronts in ((300.0, 1700.0), (300.0, 2200.0)):
        # The other train is past all that the first one hears.
        heard = medium(2, **settings).propagate(4, 0.4, at(*fronts), blocks)
        np.testing.assert_array_equal(heard.trains[0], alone.trains[0])
        np.testing.assert_array_equal(heard.circuits[0], alone.circuits[0])
    fewer = medium(1, **settings).propagate(4, 0.4, at(300.0), {n: blocks[n] for n in range(3)})
    np.testing.assert_array_equal(fewer.trains[0], alone.trains[0])


# Descriptions -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"circuits": circuits()[::2]}, "starts at"),
        ({"circuits": circuits() + circuits()[:1]}, "twice"),
        ({"tracks": ("other",)}, "no track main"),
        ({"faults": (SANDED,)}, "no train t9"),
        ({"faults": (broken("tc1", 5.0),)}, "not in tc1"),
        ({"harmonics": (Harmonic(order=160, amplitude_v=1.0),)}, "not below"),
    ],
)
def test_a_description_that_cannot_be_is_refused(more: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        medium(**more)


def test_wrong_blocks_and_trains_are_refused() -> None:
    with pytest.raises(ValueError, match="samples, not 1600"):
        medium().propagate(0, 0.0, at(1300.0), {2: np.ones(5)})
    with pytest.raises(ValueError, match="2 trains, not 1"):
        medium().propagate(0, 0.0, at(1300.0, 1400.0), {})
    with pytest.raises(ValueError, match="whole number"):
        RailMedium(RailDescription(circuits=circuits(), **RAILS), 1, 0.10003)
    with pytest.raises(ValueError, match="do not agree"):
        TrainsOnRails(np.zeros(2, dtype=np.intp), np.zeros(1), np.zeros(1), np.ones(1, dtype=bool))
