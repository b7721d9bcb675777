"""Trains off their drawing: deviations, roughness, and what a reflectometer makes of them."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from rail_signals.train_bus.bus_line import BusLine, CableSection, Coupler, Stub, Termination
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.consist import COMMON, CUT, CarRun, Consist, Deviations, Tolerances
from rail_signals.train_bus.faults import LooseConnector, MissingShieldGround
from rail_signals.train_bus.roughness import draw_roughness, roughened
from rail_signals.train_bus.tdr.backscatter import (
    Metric,
    resolution_m,
    spread_s,
    stretch_covariance,
)
from rail_signals.train_bus.tdr.reflectometer import (
    Reflectogram,
    Reflectometer,
    distance_m,
    measure,
    measure_consist,
)
from rail_signals.train_bus.tdr.sequential_fit import Windows
from rail_signals.train_bus.tdr.traces import noise_level, summarise

CABLE = Cable.from_impedance(120.0, 0.7, 0.0534, 0.0, 2.78e-4)
NODE = Stub(CableSection(CABLE, 0.4), Termination(10e3), 30e-12)
TRAIN = Consist(
    (CarRun(CABLE, 26.0), CarRun(CABLE, 47.0)), NODE, Coupler(0.02, 8e-8, 1e-11), Termination(120.0)
)
INSTRUMENT = Reflectometer()


def test_a_train_as_drawn() -> None:
    bus_line = TRAIN.bus_line()
    kinds = [type(e).__name__ for e in bus_line.elements]
    assert kinds == ["CableSection", "Stub", "Coupler", "CableSection", "Stub"]
    assert bus_line.length_m == TRAIN.length_m == 73.0
    assert TRAIN.starts_m.tolist() == [0.0, 26.0, 73.0]
    with pytest.raises(ValueError, match=r"runs must hold one car or more"):
        Consist((), None, Coupler(), Termination())


def test_deviations_there_and_back() -> None:
    rng = np.random.default_rng(1)
    built = Deviations.draw(2, rng)
    vector = built.to_vector()
    assert Deviations.from_vector(vector, 2).to_vector().tolist() == vector.tolist()
    many = np.concatenate([Deviations.draw(30, rng).to_vector() for _ in range(100)])
    assert np.abs(many).max() <= CUT
    assert many.std() == pytest.approx(0.987, abs=0.02)
    with pytest.raises(ValueError, match=r"values must have 14 entries, got shape"):
        Deviations.from_vector(np.zeros(3), 2)


def test_one_deviation_at_a_time() -> None:
    """A standard deviation of each does what its name says."""
    plain = Deviations.none(2)
    section = replace(plain, impedance=np.array([0.0, 1.0])).impedance
    assert section.tolist() == [0.0, 1.0]
    moved = TRAIN.bus_line(replace(plain, delay=np.array([1.0, 0.0]), impedance_batch=-1.0))
    first, last = moved.elements[0], moved.elements[3]
    assert isinstance(first, CableSection) and isinstance(last, CableSection)
    assert first.delay_factor == pytest.approx(math.exp(0.004))
    assert last.delay_factor == 1.0
    assert first.impedance_factor == last.impedance_factor == pytest.approx(math.exp(-0.02))
    ended = TRAIN.bus_line(replace(plain, termination=2.0)).termination.resistance_ohm
    assert ended == pytest.approx(120.0 * math.exp(0.02))
    coupler = TRAIN.bus_line(replace(plain, coupler=np.array([1.0]))).elements[2]
    assert isinstance(coupler, Coupler)
    assert coupler.inductance_h == pytest.approx(8e-8 * 1.15)


def test_roughness_is_the_process_it_says() -> None:
    long = replace(TRAIN, runs=(CarRun(CABLE, 40_000.0),))
    rough = draw_roughness(long, np.random.default_rng(2))
    assert rough.std() == pytest.approx(0.003, rel=0.03)
    for lag in (1, 3):
        correlation = float(np.mean(rough[lag:] * rough[:-lag])) / 0.003**2
        assert correlation == pytest.approx(math.exp(-lag / 3.0), abs=0.03)
    bus_line = roughened(TRAIN.bus_line(), rough)
    assert bus_line.length_m == pytest.approx(73.0)
    sections = [e for e in bus_line.elements if isinstance(e, CableSection)]
    assert len(sections) == 26 + 47
    assert sections[5].impedance_factor == pytest.approx(math.exp(rough[5]))
    assert roughened(TRAIN.bus_line(), np.zeros(80)) == TRAIN.bus_line()


def test_the_covariance_of_stretches() -> None:
    """Against sums over a fine grid of the process itself."""
    bounds = np.array([0.0, 2.0, 4.0, 9.0, 20.0])
    x = np.arange(0.0, 20.0, 0.02) + 0.01
    full = np.exp(-np.abs(x[:, None] - x[None]) / 3.0)
    means = np.array([(x > a) & (x < b) for a, b in itertools.pairwise(bounds)])
    weights = means / means.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(
        stretch_covariance(0.1, 3.0, bounds), 0.01 * weights @ full @ weights.T, rtol=1e-4
    )


def test_backscatter_has_the_covariance_it_says() -> None:
    """The traces of many rough trains: their spread at each time against the model's rows."""
    rng = np.random.default_rng(3)
    train = replace(TRAIN, tolerances=Tolerances(roughness=0.003))
    quiet = Reflectometer(noise_rms=1e-9)
    drawn = Deviations.none(2)
    traces = np.stack([measure_consist(train, drawn, quiet, rng).reflection[0] for _ in range(150)])
    windows = Windows(train, quiet, traces.shape[1])
    rows = windows.model(2).backscatter(np.zeros(COMMON + 7))
    expected = np.sqrt((rows**2).sum(axis=0))
    inside = (expected > 2e-4) & (np.arange(len(expected)) < 150)
    ratio = traces.std(axis=0)[inside] / expected[inside]
    assert inside.sum() > 100
    assert ratio.mean() == pytest.approx(1.0, abs=0.08)
    # In the metric of noise and backscatter the distance of a trace is that of its samples.
    metric = Metric(5e-4, rows)
    clean = windows.model(2).trace(drawn.to_vector())
    squares = []
    for trace in traces:
        noisy = trace + 5e-4 * rng.standard_normal(len(trace))
        squares.append(metric.square((noisy - clean) / 5e-4))
    count = traces.shape[1]
    assert np.mean(squares) == pytest.approx(
        count, abs=5 * math.sqrt(2 * count / 150) + 0.02 * count
    )


def test_what_an_edge_covers() -> None:
    assert resolution_m(CABLE, 0.0, 20e-9) == pytest.approx(0.5 * 0.7 * 299_792_458 * 20e-9)
    a = 2.78e-4 / (2 * 120.0 * math.sqrt(math.pi))
    assert spread_s(CABLE, 800.0, 0.0) == pytest.approx(2 * (a * 800.0) ** 2)


def test_a_trace_and_its_noise() -> None:
    bus_line = BusLine((CableSection(CABLE, 47.0),), Termination(120.0))
    found = measure(bus_line, INSTRUMENT, np.random.default_rng(4), traces=4)
    assert found.reflection.shape == (4, INSTRUMENT.samples_for(bus_line.delay_s))
    assert found.sample_period_s == pytest.approx(5e-9)
    assert noise_level(found.reflection) == pytest.approx(1e-3, rel=0.1)
    assert Reflectometer.with_snr(40.0).noise_rms == pytest.approx(0.01)
    assert Reflectometer.with_snr(63.0).snr_db == pytest.approx(63.0)
    assert float(distance_m(475.1e-9, 0.66 * 299_792_458)) == pytest.approx(47.0, abs=0.01)
    loud = measure(
        bus_line, INSTRUMENT, np.random.default_rng(4), 4, MissingShieldGround(0, 0.1, 0.1, 3.0)
    )
    assert noise_level(loud.reflection) == pytest.approx(3e-3, rel=0.1)


def test_only_what_changes_changes() -> None:
    rng = np.random.default_rng(5)
    built = Deviations.draw(2, rng)
    steady = summarise(measure_consist(TRAIN, built, INSTRUMENT, rng, 4))
    assert steady.change is None
    assert steady.noise_rms == pytest.approx(1e-3, rel=0.1)
    loose = LooseConnector(0, 5.0, 5e-8, 0.5)
    changing = summarise(measure_consist(TRAIN, built, INSTRUMENT, rng, 4, loose))
    assert changing.change is not None
    edge_ns = 2 * 26.0 / CABLE.velocity_m_per_s
    times = INSTRUMENT.grid(len(changing.mean)).time_s
    size = np.abs(changing.change)
    assert size[times < edge_ns - 60e-9].mean() < 0.2 * size[times > edge_ns + 60e-9].mean()
    same = summarise(measure_consist(TRAIN, built, INSTRUMENT, rng, 4, LooseConnector(0, 5.0)))
    assert same.change is None


def test_wrong_values_are_quoted() -> None:
    with pytest.raises(ValueError, match=r"sample_period_s must be at most a quarter"):
        Reflectometer(sample_period_s=6e-9)
    with pytest.raises(ValueError, match=r"noise_rms must be .*0"):
        Reflectometer(noise_rms=0)
    with pytest.raises(ValueError, match=r"impedance must be finite and above 0, got 0.0"):
        Tolerances(impedance=0.0)
    with pytest.raises(ValueError, match=r"time_s must rise evenly"):
        Reflectogram(np.concatenate([[0.0], np.arange(20) + 5.0]), np.zeros(21))
    with pytest.raises(ValueError, match=r"16 samples or more"):
        Reflectogram(np.arange(4.0), np.zeros(4))
