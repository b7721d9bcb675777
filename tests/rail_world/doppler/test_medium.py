"""The medium of the reference tones against the exact phase of a moving antenna."""

from __future__ import annotations

import numpy as np
import pytest

from rail_msgs_py.topics.world import STATE
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.doppler.signal import block_times_s, received_tones, reference_tone
from rail_signals.doppler.tone_plan import TonePlan
from rail_world.doppler.description import ReferenceDescription, ReferenceFault, ReferenceStation
from rail_world.doppler.medium import ReferenceMedium
from rail_world.line.description import Arc, Straight, TrackDescription
from rail_world.line.network import build_network

PLAN = TonePlan()
NETWORK = build_network(
    {
        "straight": TrackDescription(elements=(Straight(straight_m=3000.0),)),
        "curve": TrackDescription(elements=(Arc(arc_m=3000.0, radius_m=400.0),)),
    },
    (),
)
ALWAYS = {"from_s": 0.0, "to_s": 1e6}
STATIONS = ((1000.0, 20.0, 6.0), (1600.0, -20.0, 6.0))


def medium(*faults: ReferenceFault, **changes: object) -> ReferenceMedium:
    stations = tuple(
        ReferenceStation(name=f"ref{n}", track="straight", chainage_m=place[0], position_m=place)
        for n, place in enumerate(STATIONS, start=1)
    )
    fields: dict[str, object] = {
        "receiver_ppm": 0.0,
        "station_ppb": 0.0,
        "noise_figure_db": 0.0,
        "path_loss_exponent": 2.0,
        "extra_loss_db": 0.0,
        "coverage_range_m": 2000.0,
    }
    description = ReferenceDescription(
        stations=stations,
        trains=("a",),
        tracks=("straight", "curve"),
        carrier_hz=PLAN.carrier_hz,
        sample_rate_hz=PLAN.sample_rate_hz,
        samples=PLAN.samples,
        faults=faults,
        **(fields | changes),
    )
    return ReferenceMedium(description, NETWORK, 7)


def state(track: str, chainage_m: float, speed_mps: float, acceleration: float = 0.0) -> np.ndarray:
    pose = NETWORK.tracks[track].pose(chainage_m)
    row = dict.fromkeys(STATE.columns, 0.0) | {
        "x_m": float(pose.x_m),
        "y_m": float(pose.y_m),
        "z_m": float(pose.z_m),
        "heading_rad": float(pose.heading_rad),
        "speed_mps": speed_mps,
        "acceleration_mps2": acceleration,
        "track_index": float(["straight", "curve"].index(track)),
        "chainage_m": chainage_m,
        "on_line": 1.0,
    }
    return np.array([list(row.values())])


def tones(power_mw: float = 1.0) -> dict[int, np.ndarray]:
    return {n: np.sqrt(power_mw) * reference_tone(PLAN, 2 + 3 * n) for n in range(2)}


def exact(track: str, chainage_m: float, speed_mps: float, acceleration: float) -> np.ndarray:
    """Distances [station, sample] along the true line."""
    t = block_times_s(PLAN)
    pose = NETWORK.tracks[track].pose(chainage_m + speed_mps * t + 0.5 * acceleration * t * t)
    place = np.stack((pose.x_m, pose.y_m, pose.z_m))
    line = place[None] - np.array(STATIONS)[:, :, None]
    return np.sqrt((line**2).sum(axis=1))


@pytest.mark.parametrize(
    ("track", "chainage_m", "speed_mps", "acceleration"),
    [
        ("straight", 1005.0, 138.0, -1.0),
        ("straight", 1400.0, -80.0, 0.0),
        ("curve", 700.0, 60.0, 1.0),
    ],
)
def test_the_wave_is_that_of_the_exact_way(
    track: str, chainage_m: float, speed_mps: float, acceleration: float
) -> None:
    strong_mw = 1e12  # far above the noise
    row = state(track, chainage_m, speed_mps, acceleration)
    heard = medium().receive(3, 0.3, row, tones(strong_mw))[0]
    distance_m = exact(track, chainage_m, speed_mps, acceleration)
    # Free space from 1 m on.
    wavelength_m = SPEED_OF_LIGHT_M_PER_S / PLAN.carrier_hz
    amplitude = np.sqrt(strong_mw) * wavelength_m / (4.0 * np.pi * distance_m)
    wanted = received_tones(PLAN, [2, 5], distance_m, amplitude)
    # A common phase per station is the oscillators'.
    basis = np.stack(
        [
            received_tones(PLAN, [slot], distance_m[[n]], amplitude[n])
            for n, slot in enumerate((2, 5))
        ]
    )
    turn = np.linalg.lstsq(basis.T, heard, rcond=None)[0]
    np.testing.assert_allclose(np.abs(turn), 1.0, rtol=1e-3)
    left = np.abs(heard - turn @ basis)
    assert left.max() < 3e-3 * np.abs(wanted).max()


def test_noise_is_that_of_the_receiver_and_a_draw_of_its_own() -> None:
    row = state("straight", 1300.0, 30.0)
    one, same, other = (
        medium().receive(tick, 0.1 * tick, row, tones(1e-30))[0] for tick in (3, 3, 4)
    )
    assert np.array_equal(one, same) and not np.array_equal(one, other)
    # k T times the sample rate [mW].
    assert np.mean(np.abs(one) ** 2) == pytest.approx(1.38e-23 * 290.0 * 64e3 * 1e3, rel=0.1)


def test_offsets_of_oscillators_shift_the_tones() -> None:
    still = state("straight", 1300.0, 0.0)
    radio = medium(receiver_ppm=0.5)
    heard = radio.receive(0, 0.0, still, {0: 1e6 * reference_tone(PLAN, 4)})[0]
    turn = np.angle(np.vdot(heard[:-1], heard[1:])) * PLAN.sample_rate_hz / (2.0 * np.pi)
    offset_hz = -float(radio.receiver_hz[0])
    assert 0.0 < abs(offset_hz) <= 1300.0
    assert turn == pytest.approx(PLAN.slot_offset_hz(4) + offset_hz, abs=0.5)


def test_a_dead_station_is_silent_and_a_detuned_one_is_off_while_it_lasts() -> None:
    still = state("straight", 1300.0, 0.0)
    dead = ReferenceFault(kind="dead_reference", station="ref1", from_s=1.0, to_s=2.0)
    only = {0: tones()[0]}
    assert medium(dead).receive(10, 1.0, still, only) == {}
    assert 0 in medium(dead).receive(20, 2.0, still, only)
    detuned = ReferenceFault(kind="detuned_reference", station="ref1", **ALWAYS, shift_hz=100.0)
    heard = medium(detuned).receive(0, 0.0, still, {0: 1e6 * only[0]})[0]
    turn = np.angle(np.vdot(heard[:-1], heard[1:])) * PLAN.sample_rate_hz / (2.0 * np.pi)
    assert turn == pytest.approx(PLAN.slot_offset_hz(2) + 100.0, abs=0.5)


def test_nothing_is_heard_past_the_reach_or_off_the_line() -> None:
    assert (
        medium(coverage_range_m=500.0).receive(0, 0.0, state("straight", 2900.0, 0.0), tones())
        == {}
    )
    off = state("straight", 1300.0, 0.0)
    off[0, -1] = 0.0
    assert medium().receive(0, 0.0, off, tones()) == {}


def test_a_block_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match=r"block of \(5,\), not of 2048 samples"):
        medium().receive(0, 0.0, state("straight", 1300.0, 0.0), {0: np.ones(5, dtype=complex)})


def test_a_fault_of_no_station_is_refused() -> None:
    with pytest.raises(ValueError, match="no reference station ref9"):
        medium(ReferenceFault(kind="dead_reference", station="ref9", **ALWAYS))


def test_an_envelope_of_two_lines_is_delayed_as_one_of_each() -> None:
    row = state("straight", 1400.0, -80.0, 0.5)
    one = {0: 1e6 * reference_tone(PLAN, 2)}
    both = {0: one[0] + 1e-5 * 1e6 * reference_tone(PLAN, 7)}
    other = {0: 1e6 * reference_tone(PLAN, 7)}
    heard = [medium().receive(3, 0.3, row, sent)[0] for sent in (one, both, other)]
    # A line by itself is turned, an envelope of several goes through its transform.
    kept = [medium()._sent(0, sent[0]).line for sent in (one, both, other)]
    assert kept == [True, False, True]
    most = np.abs(heard[0]).max()
    np.testing.assert_allclose(heard[1], heard[0] + 1e-5 * heard[2], atol=2e-6 * most)
    assert np.abs(heard[1] - heard[0]).max() > 5e-6 * most
