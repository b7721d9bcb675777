"""Maximum-likelihood fit of several reference tones to one block.

The block is turned back by each frequency and averaged over pieces of a millisecond. These 32
values are, but for 1e-4, all that the block tells about a tone. What the other tones leave in
them is known (`rail_signals.doppler.tone_leakage`), so that all tones are fitted together, by
Gauss-Newton.

Phase and amplitude of a tone are polynomials orthogonal over the block. The linear term of the
phase is the shift: because of the orthogonality its variance is that of a pure tone,
``6 fs^2 / ((2 pi)^2 gamma N (N^2 - 1))``, however many other terms are fitted. Cubic and
quartic phase, the change of a chirp abeam, are fitted where a tone is strong enough to show them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.phasors import cis

from .tone_leakage import Leakage
from .tone_plan import TonePlan
from .tone_search import DetectedTones

#: Pieces of a block.
PIECES = 32
#: Terms of the polynomials of phase and of amplitude.
PHASE_TERMS, _AMPLITUDE_TERMS = 5, 3
#: Energy of a tone over noise from which cubic and quartic phase are fitted.
_STRONG = 1000.0
_STEPS, _WEAK_STEPS = 2, 3
#: Chirps that weak tones are searched with: this phase apart at the ends of the block [rad].
_TEMPLATE_PHASE_RAD = 1.2


class ToneFit(NamedTuple):
    """Tones that were fitted; arrays [n].

    ``frequency_hz`` is relative to the carrier and that of the whole block, ``power`` that of the
    tone; ``residual`` is power per sample of what the fit leaves of the pieces: the noise, if
    there is nothing else. ``last_step_rad`` is the largest change of a phase term in the last step.
    """

    frequency_hz: FloatArray
    chirp_hz_per_s: FloatArray
    power: FloatArray
    residual: FloatArray
    last_step_rad: FloatArray


class ToneFitter:
    """Fits the tones that a `ToneSearch` found.

    Parameters
    ----------
    plan
        The plan of the tones.
    """

    def __init__(self, plan: TonePlan) -> None:
        self._samples, self._rate_hz = plan.samples, plan.sample_rate_hz
        self._length = length = plan.samples // PIECES
        within_s = (np.arange(length) - 0.5 * (length - 1)) / plan.sample_rate_hz
        number = np.arange(PIECES, dtype=np.float64)
        piece_s = np.asarray((number - 0.5 * (PIECES - 1)) * (length / plan.sample_rate_hz))
        self._turns = -2 * math.pi * np.concatenate((within_s, piece_s))
        self._basis, slopes = _orthonormal(piece_s, PHASE_TERMS)
        # Phase of the pieces, and how far off its frequency the tone is there.
        self._course = np.concatenate((self._basis, slopes / (2 * math.pi)), axis=1)
        self._mean = np.ascontiguousarray(self._basis.T) / PIECES
        self._piece_s, self._bend = piece_s, math.pi * piece_s**2
        self._per_chirp = self._bend @ self._mean
        self._hz = float(self._course[1, -1])
        self._templates, self._template_hz, self._template_chirp = _templates(plan, piece_s)

    def fit(self, block: ComplexArray, detected: DetectedTones, noise: float) -> ToneFit:
        """Fit the tones ``detected`` to a block, complex [samples]; ``noise`` power per sample."""
        turn = cis(detected.frequency_hz[:, None] * self._turns)
        within, turn = turn[:, : self._length], turn[:, self._length :]
        sums = block.reshape(PIECES, self._length) @ within.T
        pieces = sums.T * turn / self._length
        leakage = Leakage(detected.frequency_hz, self._rate_hz, self._length)
        level = detected.level
        weak = level.real**2 + level.imag**2 < _STRONG * noise / self._samples
        phase, amplitude = self._start(detected, pieces, turn, leakage, weak)
        # Free of leakage, each piece of a strong tone tells its phase; else sums are linear.
        strong = not weak.any()
        least = 0.3 * amplitude[:, 0]
        back = turn.conj()
        for step in range(_STEPS if strong else _WEAK_STEPS):
            course = phase @ self._course
            wave = cis(course[:, :PIECES])
            size = amplitude @ self._basis[:_AMPLITUDE_TERMS]
            if step < 2:  # then they move no more to speak of
                leakage.move(course[:, PIECES:])
            other = leakage.into(size * wave * back)
            near = (pieces - other * turn) * wave.conj()
            rest = near - size * leakage.own
            exact = strong and step
            error = np.arctan2(near.imag, near.real) if exact else near.imag / size
            # A step is limited, so that what is no tone cannot run away and spoil the others.
            change = np.minimum(np.maximum(error @ self._mean, -1.0), 1.0)
            level_change = rest.real @ self._mean[:, :_AMPLITUDE_TERMS]
            if not strong:
                change[weak, 3:] = 0.0
                level_change[weak, 1:] = 0.0
            phase += change
            amplitude += level_change
            np.maximum(amplitude[:, 0], least, out=amplitude[:, 0])
        inner = rest @ self._mean
        left = np.vecdot(rest, rest).real / PIECES - np.vecdot(inner, inner).real
        return ToneFit(
            detected.frequency_hz + phase[:, 1] * self._hz,
            phase[:, 2] / self._per_chirp[2],
            amplitude[:, 0] ** 2,
            left * (self._length * PIECES / (PIECES - PHASE_TERMS)),
            np.abs(change).max(axis=1),
        )

    def _start(
        self,
        detected: DetectedTones,
        pieces: ComplexArray,
        turn: ComplexArray,
        leakage: Leakage,
        weak: NDArray[np.bool_],
    ) -> tuple[FloatArray, FloatArray]:
        """Terms of phase and amplitude [n, terms] to start from.

        Weak tones are searched again, without the window: it hides the ends of the block, which
        tell the chirp, and half of the energy.
        """
        _, _, chirp, level = detected
        phase = np.zeros((len(chirp), PHASE_TERMS))
        if weak.any():
            bend = chirp[:, None] * self._bend
            leakage.move(chirp[:, None] * self._piece_s)
            other = leakage.into(level[:, None] * cis(bend) * turn.conj())
            response = (pieces - other * turn) @ self._templates
            pick = (response.real**2 + response.imag**2).argmax(axis=1)
            phase[:, 1] = np.where(weak, self._template_hz[pick], 0.0) / self._hz
            chirp = np.where(weak, self._template_chirp[pick], chirp)
            level = np.where(weak, response[np.arange(len(pick)), pick], level)
        phase += chirp[:, None] * self._per_chirp
        phase[:, 0] += np.arctan2(level.imag, level.real)
        amplitude = np.zeros((len(chirp), _AMPLITUDE_TERMS))
        amplitude[:, 0] = np.abs(level)
        return phase, amplitude


def _templates(plan: TonePlan, piece_s: FloatArray) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Conjugate tones [pieces, templates], their offsets [Hz] and chirps [Hz/s]."""
    step = 4 * _TEMPLATE_PHASE_RAD / (math.pi * plan.duration_s**2)
    chirps = step * np.arange(-math.ceil(plan.max_chirp_hz_per_s / step), 1)
    offsets_hz = plan.bin_hz * np.arange(-4.0, 4.1, 0.5)
    offset_hz, chirp = np.repeat(offsets_hz, len(chirps)), np.tile(chirps, len(offsets_hz))
    time_s = piece_s[:, None]
    phase = math.pi * (2 * offset_hz * time_s + chirp * time_s**2)
    return cis(-phase) / PIECES, offset_hz, chirp


def _orthonormal(time_s: FloatArray, terms: int) -> tuple[FloatArray, FloatArray]:
    """Orthogonal polynomials of rising order and mean square 1, and their slopes [terms, times]."""
    scale = float(np.max(time_s))
    powers = np.vander(time_s / scale, terms, increasing=True)
    _, r = np.linalg.qr(powers / math.sqrt(len(time_s)))
    coefficients = np.linalg.inv(r * np.sign(np.diag(r))[:, None]).T
    order = np.arange(1, terms)
    slopes = coefficients[:, 1:] @ (order * powers[:, :-1]).T / scale
    return coefficients @ powers.T, slopes
