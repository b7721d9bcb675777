"""Compiled fit of reference tones: pieces of a block, leakage among them, Gauss and Newton.

With a handful of tones and 32 pieces, calls of NumPy cost ten times what the sums do. What is
fitted, and why, is told in `rail_signals.doppler.tone_fit`. Of each tone the arrays [tone, piece]
are `pieces`, turned back by its frequency; ``turn``, by which each was turned back at its middle;
and ``wave``, the tone of unit size as it is thought to be.
"""

from __future__ import annotations

import math

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.compiled import compiled

from .tone_leakage import add_leakage, leakage_matrix

#: Pieces of a block.
PIECES = 32
#: Terms of the polynomials of phase and of amplitude.
PHASE_TERMS, _AMPLITUDE_TERMS = 5, 3
#: Energy of a tone over noise from which cubic and quartic phase are fitted.
_STRONG = 1000.0
_STEPS, _WEAK_STEPS = 2, 3


@compiled
def fit_tones(
    block: ComplexArray,
    frequency_hz: FloatArray,
    chirp: FloatArray,
    level: ComplexArray,
    noise: float,
    sample_rate_hz: float,
    within: FloatArray,
    piece_s: FloatArray,
    basis: FloatArray,
    slopes: FloatArray,
    templates: FloatArray,
    of_templates: FloatArray,
    found: FloatArray,
) -> None:
    """Fit tones to a block.

    Parameters
    ----------
    block : complex128 [samples]
    frequency_hz, chirp, level : [tone]
        First guess of each, as of `rail_signals.doppler.tone_search.DetectedTones`.
    noise : float
        Power per sample.
    sample_rate_hz : float
    within : float64 [sample of a piece]
        Times from the middle of a piece, times -2 pi.
    piece_s : float64 [piece]
        Middles of the pieces.
    basis, slopes : float64 [term, piece]
        Polynomials of the phase, and their slopes in turns per second.
    templates, of_templates : float64 [part, piece, template], [2, template]
        Conjugate tones that weak ones are searched with, their offsets [Hz] and chirps [Hz/s].
    found : float64 [5, tone]
        As `rail_signals.doppler.tone_fit.ToneFit`; result.
    """
    tones, length = len(frequency_hz), len(within)
    turn = np.empty((tones, PIECES), dtype=np.complex128)
    pieces = np.empty((tones, PIECES), dtype=np.complex128)
    _turn_back(block, frequency_hz, within, piece_s, turn, pieces)
    matrix = leakage_matrix(frequency_hz, sample_rate_hz, length)
    weak = np.empty(tones, dtype=np.bool_)
    for n in range(tones):
        energy = level[n].real ** 2 + level[n].imag ** 2
        weak[n] = energy < _STRONG * noise / len(block)
    strong = not weak.any()

    moving_hz, own = np.empty((tones, PIECES)), np.empty((tones, PIECES))
    wave, tone = np.empty_like(turn), np.empty_like(turn)
    other, rest = np.empty_like(turn), np.empty_like(turn)
    per_chirp = np.zeros(PHASE_TERMS)
    for p in range(PIECES):
        for term in range(PHASE_TERMS):
            per_chirp[term] += math.pi * piece_s[p] ** 2 * basis[term, p] / PIECES
    phase, amplitude = np.zeros((tones, PHASE_TERMS)), np.zeros((tones, _AMPLITUDE_TERMS))
    for n in range(tones):
        phase[n] = chirp[n] * per_chirp
        phase[n, 0] += math.atan2(level[n].imag, level[n].real)
        amplitude[n, 0] = abs(level[n])
    if not strong:
        for n in range(tones):
            for p in range(PIECES):
                moving_hz[n, p] = chirp[n] * piece_s[p]
                bend = math.pi * chirp[n] * piece_s[p] ** 2
                tone[n, p] = level[n] * complex(math.cos(bend), math.sin(bend))
                tone[n, p] *= turn[n, p].conjugate()
        add_leakage(tone, moving_hz, matrix, sample_rate_hz, length, other, own)
        for n in range(tones):
            if weak[n]:
                for p in range(PIECES):
                    rest[n, p] = pieces[n, p] - other[n, p] * turn[n, p]
                best, response = _best_template(rest[n], templates)
                phase[n] = of_templates[1, best] * per_chirp
                phase[n, 0] += math.atan2(response.imag, response.real)
                phase[n, 1] += of_templates[0, best] / slopes[1, 0]
                amplitude[n, 0] = abs(response)

    least = 0.3 * amplitude[:, 0]
    size = np.empty((tones, PIECES))
    for step in range(_STEPS if strong else _WEAK_STEPS):
        for n in range(tones):
            for p in range(PIECES):
                angle, off_hz = 0.0, 0.0
                for term in range(PHASE_TERMS):
                    angle += phase[n, term] * basis[term, p]
                    off_hz += phase[n, term] * slopes[term, p]
                total = 0.0
                for term in range(_AMPLITUDE_TERMS):
                    total += amplitude[n, term] * basis[term, p]
                wave[n, p] = complex(math.cos(angle), math.sin(angle))
                size[n, p] = total
                if step < 2:  # then they move no more to speak of
                    moving_hz[n, p] = off_hz
                tone[n, p] = total * wave[n, p] * turn[n, p].conjugate()
        add_leakage(tone, moving_hz, matrix, sample_rate_hz, length, other, own)
        for n in range(tones):
            for p in range(PIECES):
                near = (pieces[n, p] - other[n, p] * turn[n, p]) * wave[n, p].conjugate()
                tone[n, p] = near
                rest[n, p] = near - size[n, p] * own[n, p]
            # Free of leakage, each piece of a strong tone tells its phase; else sums are linear.
            exact = strong and step > 0
            parts = (tone[n], rest[n], size[n])
            found[4, n] = _step(parts, basis, exact, weak[n], phase[n], amplitude[n])
            if amplitude[n, 0] < least[n]:
                amplitude[n, 0] = least[n]
    for n in range(tones):
        found[0, n] = frequency_hz[n] + phase[n, 1] * slopes[1, 0]
        found[1, n] = phase[n, 2] / per_chirp[2]
        found[2, n] = amplitude[n, 0] ** 2
        left = _left(rest[n], basis)
        found[3, n] = left * (length * PIECES / (PIECES - PHASE_TERMS))


@compiled
def _turn_back(
    block: ComplexArray,
    frequency_hz: FloatArray,
    within: FloatArray,
    piece_s: FloatArray,
    turn: ComplexArray,
    pieces: ComplexArray,
) -> None:
    """Mean of each piece of a block that is turned back by each frequency; turns and means out."""
    length = len(within)
    # Sample by sample of all pieces at once: neighbours in a sum would have to wait for each other.
    parts = np.empty((2, length, PIECES))
    for p in range(PIECES):
        for i in range(length):
            sample = block[p * length + i]
            parts[0, i, p], parts[1, i, p] = sample.real, sample.imag
    total = np.empty((2, PIECES))
    for n in range(len(frequency_hz)):
        total[:] = 0.0
        for i in range(length):
            angle = frequency_hz[n] * within[i]
            c, s = math.cos(angle), math.sin(angle)
            for p in range(PIECES):
                total[0, p] += parts[0, i, p] * c - parts[1, i, p] * s
                total[1, p] += parts[0, i, p] * s + parts[1, i, p] * c
        for p in range(PIECES):
            angle = frequency_hz[n] * (-2.0 * math.pi * piece_s[p])
            turn[n, p] = complex(math.cos(angle), math.sin(angle))
            pieces[n, p] = complex(total[0, p], total[1, p]) * turn[n, p] / length


@compiled
def _best_template(pieces: ComplexArray, templates: FloatArray) -> tuple[int, complex]:
    """Template that fits pieces best, and its response."""
    response = np.zeros((2, templates.shape[2]))
    for p in range(PIECES):
        real, imag = pieces[p].real, pieces[p].imag
        one, other = templates[0, p], templates[1, p]
        for i in range(len(one)):
            response[0, i] += real * one[i] - imag * other[i]
            response[1, i] += real * other[i] + imag * one[i]
    best, most = 0, -1.0
    for i in range(response.shape[1]):
        power = response[0, i] ** 2 + response[1, i] ** 2
        if power > most:
            best, most = i, power
    return best, complex(response[0, best], response[1, best])


@compiled
def _step(
    parts: tuple[ComplexArray, ComplexArray, FloatArray],
    basis: FloatArray,
    exact: bool,
    weak: bool,
    phase: FloatArray,
    amplitude: FloatArray,
) -> float:
    """Take one step of phase and amplitude of a tone; the largest change of a phase term [rad].

    ``parts`` are, of each piece, the tone turned back by what it is thought to be, what is left of
    it, and its size.
    """
    near, rest, size = parts
    change, level_change = np.zeros(PHASE_TERMS), np.zeros(_AMPLITUDE_TERMS)
    for p in range(PIECES):
        error = math.atan2(near[p].imag, near[p].real) if exact else near[p].imag / size[p]
        for term in range(PHASE_TERMS):
            change[term] += error * basis[term, p]
        for term in range(_AMPLITUDE_TERMS):
            level_change[term] += rest[p].real * basis[term, p]
    largest = 0.0
    for term in range(3 if weak else PHASE_TERMS):
        # A step is limited, so that what is no tone cannot run away and spoil the others.
        step = change[term] / PIECES
        if abs(step) > 1.0:
            step = math.copysign(1.0, step)
        phase[term] += step
        # What is not a number must not look as if it had settled.
        if abs(step) > largest or step != step:
            largest = abs(step)
    for term in range(1 if weak else _AMPLITUDE_TERMS):
        amplitude[term] += level_change[term] / PIECES
    return largest


@compiled
def _left(rest: ComplexArray, basis: FloatArray) -> float:
    """Mean power of what is left in the pieces and is not along any term."""
    power = 0.0
    real, imag = np.zeros(PHASE_TERMS), np.zeros(PHASE_TERMS)
    for p in range(PIECES):
        power += rest[p].real ** 2 + rest[p].imag ** 2
        for term in range(PHASE_TERMS):
            real[term] += rest[p].real * basis[term, p]
            imag[term] += rest[p].imag * basis[term, p]
    along = 0.0
    for term in range(PHASE_TERMS):
        along += real[term] ** 2 + imag[term] ** 2
    return power / PIECES - along / PIECES**2
