"""The bus cable as a medium: closed forms of simple lines, reciprocity, faults that grow."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rail_signals.train_bus.bus_line import BusLine, CableSection, Coupler, Stub, Termination
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.cascade import transfer
from rail_signals.train_bus.consist import CarRun, Consist, Deviations, Tolerances
from rail_signals.train_bus.faults import (
    BadSplice,
    LooseConnector,
    MissingShieldGround,
    OpenCircuit,
    ShortCircuit,
    WaterIngress,
    WrongCable,
)
from rail_signals.train_bus.frame import BusFrameFormat
from rail_signals.train_bus.receiver import BusFrameReceiver
from rail_signals.train_bus.tdr.measured_trace import step_edge
from rail_signals.train_bus.tdr.reflectometer import Reflectometer, measure_consist
from rail_world.train_bus.description import BusDescription, BusFaultDescription, TrainBus
from rail_world.train_bus.fault_growth import contact, fault_of, grown, growth_fraction
from rail_world.train_bus.medium import BusMedium

FRAME = BusFrameFormat()
WAVE = FRAME.waveform(bytes(range(32)))
SHARED: dict[str, Any] = {
    "bit_rate_hz": 1e6,
    "samples_per_bit": 8,
    "level_v": 4.0,
    "noise_v": 0.0,
    "source_ohm": 105.0,
    "longest_delay_s": 4e-6,
    "reference_ohm": 105.0,
    "reflectometer_noise": 1e-12,
}
WRONG: dict[str, Any] = {
    "from_s": 0.0,
    "to_s": 100.0,
    "law": "linear",
    "size": 1000.0,
    "at_m": 0.0,
    "length_m": 5.0,
    "conductance_us_per_m": 10.0,
    "car": 1,
    "coupler": 1,
    "profile": "",
    "noise_factor": 1.0,
    "spread": 0.0,
}
# Nothing is off by anything worth mentioning.
EXACT = Tolerances(**dict.fromkeys(Tolerances.__dataclass_fields__, 1e-12))  # type: ignore[arg-type]
LOSSLESS = Cable.from_impedance(105.0, 0.66)
LOSSY = Cable.from_impedance(110.0, 0.66, 0.05, 0.0, 5e-5)
NODE = Stub(CableSection(LOSSY, 0.3), Termination(1e4), 50e-12)


def consist(
    cable: Cable = LOSSLESS,
    node: Stub | None = None,
    coupler: Coupler | None = None,
    tolerances: Tolerances = EXACT,
) -> Consist:
    runs = tuple(CarRun(cable, length_m) for length_m in (47.0, 47.0, 27.0))
    return Consist(runs, node, coupler or Coupler(), Termination(105.0), tolerances)


SEED = np.random.SeedSequence([7, 6, 0])
TRAIN = consist(LOSSY, NODE, Coupler(0.02, 50e-9), Tolerances())


def fault(kind: str, **fields: Any) -> BusFaultDescription:
    return BusFaultDescription(fault=kind, **{**WRONG, **fields})


def medium(
    drawing: Consist, wrong: BusFaultDescription | None = None, index: int = 0, **changes: Any
) -> BusMedium:
    train = TrainBus(train="a", cars=("CM2",), fault=wrong)
    bus = BusDescription(trains=(train,), **{**SHARED, **changes})
    return BusMedium(bus, train, drawing, seed=7, index=index)


def test_a_matched_line_without_loss_is_a_delay() -> None:
    drawing = consist()
    got = medium(drawing).carry(0, 0.0, WAVE, to_tail=True).samples
    assert len(got) == len(WAVE) + 40
    delay = drawing.bus_line().delay_s * FRAME.sample_rate_hz
    length = 2 * len(got)
    turn = np.exp(-2j * np.pi * np.arange(length // 2 + 1) / length * delay)
    later = np.fft.irfft(np.fft.rfft(WAVE, length) * turn, length)[: len(got)]
    assert got == pytest.approx(4.0 * later, abs=0.05)
    found = BusFrameReceiver(FRAME).receive(got)
    assert found.payload == bytes(range(32))
    assert found.delay_s * FRAME.sample_rate_hz == pytest.approx(delay, abs=0.05)


def test_a_resistance_in_series_divides_the_voltage() -> None:
    clean = medium(consist()).carry(0, 0.0, WAVE, to_tail=True).samples
    splice = medium(consist(), fault("bad_splice", at_m=60.0, size=500.0))
    half = splice.carry(200, 50.0, WAVE, to_tail=True).samples
    ohm = 500.0 * splice.grown(50.0)
    assert ohm == pytest.approx(250.0, rel=0.006)
    assert half == pytest.approx(clean * 210.0 / (210.0 + ohm), abs=1e-9)


def test_nothing_passes_a_cut_and_little_a_short() -> None:
    cut = medium(consist(), fault("open", at_m=60.0))
    assert np.abs(cut.carry(4, 1.0, WAVE, to_tail=False).samples).max() == 0.0
    short = medium(consist(), fault("short", at_m=60.0, size=1.0))
    clean = medium(consist()).carry(0, 0.0, WAVE, to_tail=True).samples
    # A resistance r across two matched halves: 2 r / (2 r + Z0).
    assert short.carry(400, 100.0, WAVE, to_tail=True).samples == pytest.approx(
        clean * 2.0 / (2.0 + 105.0), abs=1e-9
    )


def test_the_way_back_is_that_of_the_line_turned_round() -> None:
    bus_line = medium(TRAIN).bus_line
    turned = BusLine(tuple(reversed(bus_line.elements)), Termination(SHARED["source_ohm"]))
    frequency_hz = np.array([1e5, 5e5, 1e6, 3e6])
    load_ohm = bus_line.termination.resistance_ohm
    there = transfer(bus_line, frequency_hz, SHARED["source_ohm"])[-1]
    back = transfer(turned, frequency_hz, load_ohm)[-1]
    assert back == pytest.approx(there * SHARED["source_ohm"] / load_ohm, rel=1e-12)
    here = medium(TRAIN)
    ahead = here.carry(0, 0.0, WAVE, to_tail=True).samples
    behind = here.carry(0, 0.0, WAVE, to_tail=False).samples
    assert behind == pytest.approx(ahead * SHARED["source_ohm"] / load_ohm, abs=1e-12)


@pytest.mark.parametrize("ohm", [0.0, 30.0])
def test_the_reflectometer_sees_what_the_model_of_the_cable_says(ohm: float) -> None:
    wrong = fault("bad_splice", at_m=60.0, size=ohm) if ohm else None
    here = medium(TRAIN, wrong)
    instrument = Reflectometer(reference_ohm=105.0, noise_rms=1e-12)
    rng = np.random.Generator(np.random.Philox(SEED))
    deviations = Deviations.draw(3, rng)
    splice = BadSplice(60.0, ohm) if ohm else None
    told = measure_consist(TRAIN, deviations, instrument, rng, fault=splice)
    edge = np.tile(step_edge(told.time_s, instrument.rise_time_s), (2, 1))
    seen = here.reflect(400, 100.0, edge, 1.0 / instrument.sample_period_s)
    assert np.abs(seen[0] - told.reflection[0]).max() < 3e-6
    assert np.abs(seen[0] - seen[1]).max() < 1e-10  # the least noise that there may be


def test_a_hard_edge_rings_but_does_not_fold_back() -> None:
    hard = np.ones((1, 500))
    hard[:, :20] = 0.0
    seen = medium(consist()).reflect(0, 0.0, hard, 2e8)
    assert np.abs(seen).max() < 1e-9  # matched
    seen = medium(consist(), fault("open", at_m=47.0)).reflect(4, 1.0, hard, 2e8)[0]
    delay = 20 + round(2.0 * 47.0 / LOSSLESS.velocity_m_per_s * 2e8)
    assert np.abs(seen[: delay - 60]).max() < 1e-4
    assert seen[delay + 60 :] == pytest.approx(np.ones(len(seen) - delay - 60), abs=1e-4)


def test_noise_is_as_told_and_belongs_to_port_and_tick() -> None:
    loud = medium(TRAIN, noise_v=0.5, reflectometer_noise=2e-3)
    quiet = medium(TRAIN)
    clean = quiet.carry(3, 0.75, WAVE, to_tail=True)
    first, again = (loud.carry(3, 0.75, WAVE, to_tail=True) for _ in range(2))
    assert np.array_equal(first.samples, again.samples)
    assert (first.samples - clean.samples).std() == pytest.approx(0.5, rel=0.05)
    energy = float(clean.samples @ clean.samples) / FRAME.bits
    assert first.ebn0 == pytest.approx(energy / (2.0 * 0.25))
    others = [
        loud.carry(3, 0.75, WAVE, to_tail=False).samples,
        loud.carry(4, 1.0, WAVE, to_tail=True).samples,
        medium(TRAIN, index=1, noise_v=0.5).carry(3, 0.75, WAVE, to_tail=True).samples,
    ]
    for other in others:
        assert abs(np.corrcoef(other - clean.samples, first.samples - clean.samples)[0, 1]) < 0.1
    edge = np.tile(step_edge(np.arange(-10, 500) * 5e-9, 20e-9), (4, 1))
    seen = loud.reflect(3, 0.75, edge, 2e8) - quiet.reflect(3, 0.75, edge, 2e8)
    assert seen.std(axis=1) == pytest.approx(np.full(4, 2e-3), rel=0.15)


def test_a_floating_shield_lets_in_noise() -> None:
    wrong = fault("missing_shield_ground", car=2, size=0.2, noise_factor=3.0)
    here, calm = (medium(TRAIN, wrong, noise_v=level) for level in (0.5, 0.0))
    noise = here.carry(400, 100.0, WAVE, to_tail=True).samples
    assert (noise - calm.carry(400, 100.0, WAVE, to_tail=True).samples).std() == pytest.approx(
        1.5, rel=0.05
    )


def test_a_contact_that_is_not_firm_changes_from_tick_to_tick_and_trace_to_trace() -> None:
    loose = medium(consist(), fault("loose_connector", coupler=1, size=200.0, spread=0.3))
    peaks = {
        round(float(np.ptp(loose.carry(k, 100.0, WAVE, to_tail=True).samples)), 6) for k in range(6)
    }
    assert len(peaks) > 3
    edge = np.tile(step_edge(np.arange(-10, 400) * 5e-9, 20e-9), (6, 1))
    ends = loose.reflect(1, 100.0, edge, 2e8)[:, -1]
    assert len(np.unique(ends.round(6))) > 3
    firm = medium(consist(), fault("loose_connector", coupler=1, size=200.0))
    ends = firm.reflect(1, 100.0, edge, 2e8)[:, -1]
    # A resistance R in series with a matched line: R / (R + 2 Z0).
    assert ends == pytest.approx(np.full(6, 200.0 / (200.0 + 210.0)), abs=1e-6)


def test_laws_of_growth() -> None:
    assert growth_fraction("linear", 10.0, 20.0, 9.0) == 0.0
    assert growth_fraction("linear", 10.0, 20.0, 12.5) == 0.25
    assert growth_fraction("exponential", 10.0, 20.0, 10.0) == 0.0
    assert growth_fraction("exponential", 10.0, 20.0, 15.0) == pytest.approx(
        1.0 / (1.0 + 1000.0**0.5)
    )
    for law in ("linear", "exponential"):
        assert growth_fraction(law, 10.0, 20.0, 25.0) == 1.0  # type: ignore[arg-type]
    assert contact(0.3, 0.0) == 1.0
    assert math.log(contact(0.3, 1.0)) == pytest.approx(0.3, abs=0.026)


def test_growth_comes_in_steps_of_a_percent_and_stays() -> None:
    wrong = fault("bad_splice", at_m=1.0, from_s=10.0, to_s=20.0)
    assert [grown(wrong, t) for t in (0.0, 10.0)] == [0.0, 0.0]
    for time_s in np.linspace(10.1, 20.0, 50):
        exact = growth_fraction("linear", 10.0, 20.0, float(time_s))
        assert grown(wrong, float(time_s)) == pytest.approx(exact, rel=0.0051)
    assert grown(wrong, 1e6) == 1.0
    cut = fault("open", at_m=1.0, from_s=10.0, to_s=20.0)
    assert [grown(cut, t) for t in (9.9, 10.0)] == [0.0, 1.0]


def test_every_kind_of_fault_at_half_its_size() -> None:
    made = {
        "open": OpenCircuit(30.0),
        "short": ShortCircuit(30.0, 2000.0),
        "water_ingress": WaterIngress(30.0, 4.0, 500.0, 10.0 * 1e-6 * 0.5),
        "bad_splice": BadSplice(30.0, 500.0),
        "missing_shield_ground": MissingShieldGround(1, 500.0, 500.0, 2.0),
        "loose_connector": LooseConnector(0, 550.0, 0.0, 0.1),
        "wrong_cable": WrongCable(1, LOSSY),
    }
    places: dict[str, dict[str, Any]] = {
        "wrong_cable": {"car": 2},
        "missing_shield_ground": {"car": 2, "noise_factor": 3.0},
        "loose_connector": {"coupler": 1, "spread": 0.1},
        "water_ingress": {"at_m": 30.0, "length_m": 4.0, "conductance_us_per_m": 10.0},
    }
    for kind, expected in made.items():
        wrong = fault(kind, **places.get(kind, {"at_m": 30.0}))
        assert fault_of(wrong, 0.5, 1.1, LOSSY) == expected
        assert fault_of(wrong, 0.0, 1.1, LOSSY) is None
    with pytest.raises(ValueError, match="a cable is needed for wrong_cable, got None"):
        fault_of(fault("wrong_cable", car=1), 1.0)


def test_more_traces_than_a_tick_has_room_for_are_refused() -> None:
    with pytest.raises(ValueError, match="room for 64 traces, got 65"):
        medium(TRAIN).reflect(0, 0.0, np.zeros((65, 100)), 2e8)
