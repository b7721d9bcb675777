"""The model of a train's trace: against the line itself, and its derivatives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.arrays import FloatArray
from rail_signals.train_bus.bus_line import CableSection, Coupler, Stub, Termination
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.consist import COMMON, CarRun, Consist, Deviations, Tolerances
from rail_signals.train_bus.tdr.cable_substitution import CableSubstitution, likely_substitutions
from rail_signals.train_bus.tdr.fault_scan import scan_faults, scan_water
from rail_signals.train_bus.tdr.hypotheses import as_fault, clipped, place_m
from rail_signals.train_bus.tdr.model import TraceModel
from rail_signals.train_bus.tdr.parts import FaultGuess
from rail_signals.train_bus.tdr.projection import Projection
from rail_signals.train_bus.tdr.reflectometer import Reflectometer
from rail_signals.train_bus.tdr.response import TimeGrid, reflected_wave
from rail_signals.train_bus.tdr.sequential_fit import Windows

CABLE = Cable.from_impedance(120.0, 0.7, 0.0534, 0.0, 2.78e-4)
NODE = Stub(CableSection(CABLE, 0.4), Termination(10e3), 30e-12)
SMOOTH = Tolerances(roughness=0.0)
TRAIN = Consist(
    tuple(CarRun(CABLE, length) for length in (26.0, 47.0, 45.0, 28.0)),
    NODE,
    Coupler(0.02, 80e-9, 10e-12),
    Termination(120.0),
    SMOOTH,
)
INSTRUMENT = Reflectometer()
SAMPLES = INSTRUMENT.samples_for(TRAIN.bus_line().delay_s)
MODEL = TraceModel(TRAIN, INSTRUMENT, SAMPLES)
BUILT = Deviations.draw(4, np.random.default_rng(5))
VECTOR = BUILT.to_vector()
GUESSES = [
    None,
    FaultGuess("open", 1, np.array([20.0])),
    FaultGuess("short", 2, np.array([10.0, 2.0])),
    FaultGuess("water_ingress", 1, np.array([12.0, 6.0, 0.3, 2.0])),
    FaultGuess("bad_splice", 1, np.array([20.0, 5.0, 40.0])),
    FaultGuess("loose_connector", 1, np.array([5.0, 40.0])),
    FaultGuess("missing_shield_ground", 2, np.array([0.1, 0.2])),
    FaultGuess("wrong_cable", 1, np.array([-0.2, 0.1, 0.3, 0.2])),
]


def name(guess: FaultGuess | None) -> str:
    return "healthy" if guess is None else guess.kind


def measured(guess: FaultGuess | None) -> FloatArray:
    """The trace without noise, of the line itself, by a transform of another length."""
    bus_line = TRAIN.bus_line(BUILT)
    if guess is not None:
        loss = math.exp(SMOOTH.loss * BUILT.loss)
        bus_line = as_fault(TRAIN, guess, loss).apply(bus_line)
    start = INSTRUMENT.start_s + SMOOTH.trigger_s * BUILT.trigger
    grid = TimeGrid(2 * SAMPLES, INSTRUMENT.sample_period_s / 2, start)
    wave = reflected_wave(bus_line, grid, 120.0, INSTRUMENT.rise_time_s)[::2]
    return (1 + SMOOTH.gain * BUILT.gain) * wave + SMOOTH.offset * BUILT.offset


@pytest.mark.parametrize("guess", GUESSES, ids=name)
def test_it_is_the_line(guess: FaultGuess | None) -> None:
    predicted = MODEL.predict(VECTOR, guess)
    np.testing.assert_allclose(predicted.trace, measured(guess), atol=2e-6)
    np.testing.assert_allclose(MODEL.trace(VECTOR, guess), predicted.trace, atol=1e-12)


@pytest.mark.parametrize("guess", GUESSES, ids=name)
def test_its_derivatives(guess: FaultGuess | None) -> None:
    """Central differences; what is not among the rows has no effect."""
    predicted = MODEL.predict(VECTOR, guess)
    rows = predicted.rows.tolist()
    for k in range(len(VECTOR)):
        step = np.zeros_like(VECTOR)
        step[k] = 1e-3
        change = (MODEL.trace(VECTOR + step, guess) - MODEL.trace(VECTOR - step, guess)) / 2e-3
        found = predicted.jacobian[rows.index(k)] if k in rows else np.zeros(SAMPLES)
        np.testing.assert_allclose(found, change, atol=2e-7)
    if guess is None:
        assert predicted.fault_jacobian.shape == (0, SAMPLES)
        return
    for k, value in enumerate(guess.values):
        step = np.zeros_like(guess.values)
        step[k] = 1e-4 * max(abs(value), 0.1)
        up, down = (
            MODEL.trace(VECTOR, FaultGuess(guess.kind, guess.index, guess.values + sign * step))
            for sign in (1, -1)
        )
        change = (up - down) / (2 * step[k])
        scale = np.abs(change).max()
        np.testing.assert_allclose(predicted.fault_jacobian[k], change, atol=1e-4 * scale)


def test_a_window_needs_only_what_it_reaches() -> None:
    """Two runs and a third without end: the first samples are those of the whole train."""
    windows = Windows(TRAIN, INSTRUMENT, SAMPLES)
    short = windows.model(2)
    assert short.grid.samples < SAMPLES / 2
    whole = MODEL.trace(VECTOR)[: short.grid.samples]
    np.testing.assert_allclose(short.trace(VECTOR), whole, atol=2e-5)
    guess = GUESSES[4]
    np.testing.assert_allclose(
        short.trace(VECTOR, guess), MODEL.trace(VECTOR, guess)[: short.grid.samples], atol=2e-5
    )


@pytest.mark.parametrize("run", range(4))
def test_another_cable_without_solving_the_line_again(run: int) -> None:
    windows = Windows(TRAIN, INSTRUMENT, SAMPLES)
    at = windows.fit(MODEL.trace(VECTOR), 1.0, 4, VECTOR, steps=0)
    swap = CableSubstitution(MODEL, at, MODEL.fields(VECTOR), run)
    guess = FaultGuess("wrong_cable", run, np.array([0.4, -0.25, 0.0, 0.0]))
    expected = MODEL.trace(VECTOR, guess) - MODEL.trace(VECTOR)
    np.testing.assert_allclose(swap.change(0.4, -0.25), expected, atol=1e-10)


def test_the_scan_finds_what_is_put_in() -> None:
    """Small lumped faults, without noise: place and values, and the right run."""
    windows = Windows(TRAIN, INSTRUMENT, SAMPLES)
    sigma = 1e-3
    drawn = np.zeros_like(VECTOR)
    fields = MODEL.fields(drawn)
    splice = FaultGuess("bad_splice", 2, np.array([20.0, 0.5, 5.0]))
    at = windows.fit(MODEL.trace(drawn, splice), sigma, 4, drawn, steps=0)
    found = scan_faults(MODEL, at, fields, Projection(at))
    peak = found.peaks(1, 5.0)[0]
    assert found.place_m[peak] == pytest.approx(93.0, abs=0.6)
    assert found.resistance_ohm[peak] == pytest.approx(0.5, rel=0.1)
    assert found.inductance_h[peak] == pytest.approx(5e-9, abs=1.5e-8)
    assert found.largest == pytest.approx(found.statistic[peak])
    other = FaultGuess("wrong_cable", 2, np.array([0.02, 0.0, 0.0, 0.0]))
    at = windows.fit(MODEL.trace(drawn, other), sigma, 4, drawn, steps=0)
    found = scan_faults(MODEL, at, fields, Projection(at))
    assert int(found.run_statistic.argmax()) == 2
    wet = FaultGuess("water_ingress", 1, np.array([18.0, 7.0, 0.02, 0.0]))
    at = windows.fit(MODEL.trace(drawn, wet), sigma, 4, drawn, steps=0)
    stretches = scan_water(MODEL, at, fields, Projection(at), 30.0, 70.0)
    _, place, length, rise = max(stretches)
    assert place == pytest.approx(44.0, abs=1.1)
    assert length == 7.0
    assert rise == pytest.approx(0.02, rel=0.15)


def test_likely_swaps_name_the_cable() -> None:
    windows = Windows(TRAIN, INSTRUMENT, SAMPLES)
    drawn = np.zeros_like(VECTOR)
    guess = FaultGuess("wrong_cable", 1, np.array([-0.3, -0.4, 0.0, 0.0]))
    at = windows.fit(MODEL.trace(drawn, guess), 1e-3, 4, drawn, steps=0)
    best = likely_substitutions(MODEL, at, MODEL.fields(drawn), Projection(at), 1)[0]
    assert best[1] == -0.3
    assert best[2] == pytest.approx(-0.4, abs=0.04)


def test_projection_is_the_fit_of_the_linear_problem() -> None:
    """The cost it tells is the least over all deviations of the linearised cost."""
    windows = Windows(TRAIN, INSTRUMENT, SAMPLES)
    rng = np.random.default_rng(2)
    drawn = np.zeros_like(VECTOR)
    trace = MODEL.trace(drawn) + 1e-3 * rng.standard_normal(SAMPLES)
    at = windows.fit(trace, 1e-3, 4, drawn, steps=0)
    rows = at.prediction.jacobian / 1e-3
    stacked = np.vstack([rows.T, np.eye(len(rows))])
    change = rng.standard_normal(SAMPLES)
    goal = np.concatenate([at.residual - change, np.zeros(len(rows))])
    _, least, *_ = np.linalg.lstsq(stacked, goal, rcond=None)
    assert float(Projection(at).costs(change[None])[0]) == pytest.approx(float(least[0]))
    column = rng.standard_normal((1, SAMPLES))
    statistic, amplitude = Projection(at).likelihood_ratio(column)
    free = np.hstack([stacked, np.concatenate([column[0], np.zeros(len(rows))])[:, None]])
    goal = np.concatenate([at.residual, np.zeros(len(rows))])
    with_it, least_with, *_ = np.linalg.lstsq(free, goal, rcond=None)
    _, least_without, *_ = np.linalg.lstsq(stacked, goal, rcond=None)
    assert float(amplitude[0, 0]) == pytest.approx(float(with_it[-1]), rel=1e-6)
    gained = float(least_without[0] - least_with[0])
    assert float(statistic[0]) == pytest.approx(gained, rel=1e-6)


def test_places_and_limits() -> None:
    assert place_m(TRAIN, GUESSES[1]) == pytest.approx(46.0)  # type: ignore[arg-type]
    assert place_m(TRAIN, FaultGuess("loose_connector", 0, np.zeros(2))) == 26.0
    assert place_m(TRAIN, FaultGuess("wrong_cable", 3, np.zeros(4))) == 118.0
    outside = clipped(TRAIN, FaultGuess("water_ingress", 0, np.array([40.0, 5.0, -1.0, 0.0])))
    assert outside.values.tolist() == [pytest.approx(20.99), 5.0, 0.0, 0.0]
    assert COMMON == 7
