"""Compiled search and fit of reference tones: beside NumPy, and beside their plain form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rail_signals.doppler.signal import block_times_s, received_tones
from rail_signals.doppler.solver import DopplerSolver
from rail_signals.doppler.station_kernel import gather_received
from rail_signals.doppler.surveyed_line import SurveyedLine
from rail_signals.doppler.tone_fit import ToneFitter
from rail_signals.doppler.tone_kernel import PHASE_TERMS, PIECES, _turn_back, fit_tones
from rail_signals.doppler.tone_leakage import add_leakage, leakage_matrix
from rail_signals.doppler.tone_plan import TonePlan
from rail_signals.doppler.tone_search import ToneSearch, _energy_beside, _find

PLAN = TonePlan()
SEARCH, FITTER = ToneSearch(PLAN), ToneFitter(PLAN)
LENGTH = PLAN.samples // PIECES
TONES = [1, 4, 5, 8]
TIMES_S = block_times_s(PLAN)
ABEAM_M = np.hypot(60.0 * TIMES_S + 2.0, 30.0)
DISTANCES_M = np.stack([ABEAM_M, 100 - 60 * TIMES_S, 700 + 60 * TIMES_S, 400 - 60 * TIMES_S])


def cis(angle: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(1j * angle))


def block_of(weakest: float, noise: float) -> np.ndarray:
    """Block of four tones that move, the first one abeam."""
    amplitude = np.array([[3.0], [1.0], [0.5], [weakest]])
    parts = np.random.default_rng(3).normal(scale=noise, size=(PLAN.samples, 2))
    block = received_tones(PLAN, TONES, DISTANCES_M, amplitude, offset_hz=200.0)
    return np.asarray(block + parts @ [1.0, 1.0j])


def leaked(tones: np.ndarray, moving_hz: np.ndarray, frequency_hz: np.ndarray) -> np.ndarray:
    """Leakage [n, piece] by Dirichlet's kernel itself."""
    total = np.zeros_like(tones)
    for k in range(len(tones)):
        for n in range(len(tones)):
            if n != k:
                away_hz = frequency_hz[n] - frequency_hz[k] + moving_hz[n]
                x = math.pi / PLAN.sample_rate_hz * away_hz
                total[k] += tones[n] * np.sin(LENGTH * x) / (LENGTH * np.sin(x))
    return total


def fitted(block: np.ndarray, noise: float) -> np.ndarray:
    """Gauss and Newton with whole arrays: frequency, chirp, power, residual, last step."""
    _, frequency_hz, chirp, level = SEARCH.find(SEARCH.spectrum(block), noise)
    within, piece_s, basis, slopes, templates, of_templates = FITTER._tables
    rate_hz = PLAN.sample_rate_hz
    mean = basis.T / PIECES
    turn = cis(-2 * math.pi * frequency_hz[:, None] * piece_s)
    sums = block.reshape(PIECES, LENGTH) @ cis(frequency_hz[:, None] * within).T
    pieces = sums.T * turn / LENGTH
    matrix = leakage_matrix(frequency_hz, rate_hz, LENGTH)
    other, own = np.zeros_like(turn), np.zeros(turn.shape)

    def leak(tones: np.ndarray, moving_hz: np.ndarray) -> np.ndarray:
        add_leakage(tones * turn.conj(), moving_hz, matrix, rate_hz, LENGTH, other, own)
        return np.asarray(other * turn)

    weak = np.abs(level) ** 2 < 1000.0 * noise / PLAN.samples
    strong, bend = not weak.any(), math.pi * piece_s**2
    phase = np.zeros((len(chirp), PHASE_TERMS))
    if not strong:
        left = pieces - leak(level[:, None] * cis(chirp[:, None] * bend), chirp[:, None] * piece_s)
        response = left @ (templates[0] + 1j * templates[1])
        pick = np.abs(response).argmax(axis=1)
        phase[:, 1] = np.where(weak, of_templates[0, pick], 0.0) / slopes[1, 0]
        chirp = np.where(weak, of_templates[1, pick], chirp)
        level = np.where(weak, response[np.arange(len(pick)), pick], level)
    per_chirp = bend @ mean
    phase += chirp[:, None] * per_chirp
    phase[:, 0] += np.angle(level)
    amplitude = np.zeros((len(chirp), 3))
    amplitude[:, 0] = np.abs(level)
    moving_hz = np.zeros(turn.shape)
    for step in range(2 if strong else 3):
        wave, size = cis(phase @ basis), amplitude @ basis[:3]
        moving_hz = phase @ slopes if step < 2 else moving_hz
        near = (pieces - leak(size * wave, moving_hz)) * wave.conj()
        rest = near - size * own
        error = np.angle(near) if strong and step else near.imag / size
        change, level_change = np.clip(error @ mean, -1, 1), rest.real @ mean[:, :3]
        change[weak, 3:] = level_change[weak, 1:] = 0.0
        phase, amplitude = phase + change, amplitude + level_change
    power = np.mean(np.abs(rest) ** 2, axis=1) - np.sum(np.abs(rest @ mean) ** 2, axis=1)
    return np.stack(
        [
            frequency_hz + phase[:, 1] * slopes[1, 0],
            phase[:, 2] / per_chirp[2],
            amplitude[:, 0] ** 2,
            power * LENGTH * PIECES / (PIECES - PHASE_TERMS),
            np.abs(change).max(axis=1),
        ]
    )


@pytest.mark.parametrize("weakest", [0.3, 0.02])
def test_a_fit_is_that_of_whole_arrays(weakest: float) -> None:
    block = block_of(weakest, 0.05)
    tones = SEARCH.find(SEARCH.spectrum(block), 0.005)
    assert tones.slots.tolist() == TONES
    assert (np.abs(tones.level).min() ** 2 < 1000.0 * 0.005 / PLAN.samples) == (weakest < 0.1)
    fit, expected = FITTER.fit(block, tones, 0.005), fitted(block, 0.005)
    for one, other in zip(fit, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-10)


def test_leakage_is_that_of_dirichlets_kernel() -> None:
    rng = np.random.default_rng(4)
    frequency_hz = np.array([-27e3, -21.5e3, 3e3, 8e3])
    tones = np.asarray(rng.normal(size=(4, PIECES, 2)) @ [1.0, 1.0j])
    moving_hz = rng.uniform(-100.0, 100.0, (4, PIECES))
    other, own = np.empty_like(tones), np.empty(tones.shape)
    matrix = leakage_matrix(frequency_hz, PLAN.sample_rate_hz, LENGTH)
    add_leakage(tones, moving_hz, matrix, PLAN.sample_rate_hz, LENGTH, other, own)
    np.testing.assert_allclose(other, leaked(tones, moving_hz, frequency_hz), atol=2e-3)
    x = math.pi / PLAN.sample_rate_hz * moving_hz
    np.testing.assert_allclose(own, np.sin(LENGTH * x) / (LENGTH * np.sin(x)), atol=1e-4)


def test_noise_is_that_of_the_bins_away_from_tones() -> None:
    spectrum = SEARCH.spectrum(block_of(0.3, 0.05))
    frequency_hz = np.array([-31.9e3, 5e3])
    bins = np.rint(frequency_hz / PLAN.bin_hz).astype(int)
    near = (bins[:, None] + np.arange(-9, 10)).ravel() % PLAN.samples
    expected = np.mean(np.delete(np.abs(spectrum) ** 2, near))
    assert _energy_beside(spectrum, frequency_hz, PLAN.bin_hz, 9) == pytest.approx(expected)


def test_the_nearest_station_of_a_slot_is_the_first_of_two() -> None:
    chainage_m = np.arange(0.0, 1001.0, 10.0)
    line = SurveyedLine(chainage_m, chainage_m, *(0.0 * chainage_m for _ in range(3)))
    places = [[at_m, 20.0, 0.0] for at_m in (100.0, 300.0, 700.0, 900.0)]
    solver = DopplerSolver(PLAN, line, places, [3, 7, 3, 3])
    assert solver.stations_of([3, 7, 2], 390.0).tolist() == [0, 1, -1]
    assert solver.stations_of([3], 400.0).tolist() == [0]
    assert solver.stations_of([3], 801.0).tolist() == [3]


def test_compiled_is_the_plain_form() -> None:
    block = block_of(0.02, 0.05)
    spectrum = SEARCH.spectrum(block)
    tones = SEARCH.find(spectrum, 0.005)
    frequency_hz = tones.frequency_hz
    within, piece_s, *_ = FITTER._tables
    shape = (len(TONES), PIECES)
    runs: list[tuple[Any, tuple[Any, ...], tuple[np.ndarray, ...]]] = [
        (
            fit_tones,
            (block, *tones[1:], 0.005, PLAN.sample_rate_hz, *FITTER._tables),
            (np.zeros((5, 4)),),
        ),
        (
            _turn_back,
            (block, frequency_hz, within, piece_s),
            (np.zeros(shape, complex), np.zeros(shape, complex)),
        ),
        (
            _find,
            (spectrum, 1.0, SEARCH._first, SEARCH._width, *SEARCH._templates),
            (np.zeros(10, np.intp), np.zeros((2, 10)), np.zeros(10, complex)),
        ),
    ]
    for kernel, given, results in runs:
        plain = tuple(result.copy() for result in results)
        assert kernel(*given, *results) == kernel.py_func(*given, *plain)
        for one, other in zip(results, plain, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


def test_what_is_received_is_gathered_by_station() -> None:
    rng = np.random.default_rng(5)
    stations_m, effects = rng.normal(size=(6, 3)), rng.normal(size=(6, 2))
    number, z, variance = np.array([4, 0, 5]), rng.normal(size=3), rng.uniform(1.0, 2.0, 3)
    expected = np.column_stack([stations_m[number], z, 1.0 / variance, effects[number]])
    for gather in (gather_received, gather_received.py_func):  # type: ignore[attr-defined]
        received = np.empty((3, 7))
        assert gather(number, z, variance, stations_m, effects, received)
        np.testing.assert_array_equal(received, expected)
        for wrong in (np.nan, np.inf, -1.0, 0.0):
            bad = variance.copy()
            bad[1] = wrong
            assert not gather(number, z, bad, stations_m, effects, received)
        assert not gather(number, z * np.inf, variance, stations_m, effects, received)
