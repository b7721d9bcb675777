"""Maximum-likelihood fit of several reference tones to one block.

The block is turned back by each frequency and averaged over pieces of a millisecond. These 32
values are, but for 1e-4, all that the block tells about a tone. What the other tones leave in
them is known (`rail_signals.doppler.tone_leakage`), so that all tones are fitted together, by
Gauss-Newton (`rail_signals.doppler.tone_kernel`).

Phase and amplitude of a tone are polynomials orthogonal over the block. The linear term of the
phase is the shift: because of the orthogonality its variance is that of a pure tone,
``6 fs^2 / ((2 pi)^2 gamma N (N^2 - 1))``, however many other terms are fitted. Cubic and
quartic phase, the change of a chirp abeam, are fitted where a tone is strong enough to show them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray

from .tone_kernel import PHASE_TERMS, PIECES, fit_tones
from .tone_plan import TonePlan
from .tone_search import DetectedTones

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
        length = plan.samples // PIECES
        within_s = (np.arange(length) - 0.5 * (length - 1)) / plan.sample_rate_hz
        number = np.arange(PIECES, dtype=np.float64)
        piece_s = np.asarray((number - 0.5 * (PIECES - 1)) * (length / plan.sample_rate_hz))
        basis, slopes = _orthonormal(piece_s, PHASE_TERMS)
        self._rate_hz = plan.sample_rate_hz
        self._tables = (
            np.asarray(-2 * math.pi * within_s),
            piece_s,
            basis,
            slopes / (2 * math.pi),
            *_templates(plan, piece_s),
        )

    def fit(self, block: ComplexArray, detected: DetectedTones, noise: float) -> ToneFit:
        """Fit the tones ``detected`` to a block, complex [samples]; ``noise`` power per sample."""
        _, frequency_hz, chirp, level = detected
        found = np.empty((len(ToneFit._fields), len(frequency_hz)))
        fit_tones(block, frequency_hz, chirp, level, noise, self._rate_hz, *self._tables, found)
        return ToneFit(*found)


def _templates(plan: TonePlan, piece_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Conjugate tones [part, piece, template], offsets [Hz] and chirps [Hz/s] [2, template]."""
    step = 4 * _TEMPLATE_PHASE_RAD / (math.pi * plan.duration_s**2)
    chirps = step * np.arange(-math.ceil(plan.max_chirp_hz_per_s / step), 1)
    offsets_hz = plan.bin_hz * np.arange(-4.0, 4.1, 0.5)
    offset_hz, chirp = np.repeat(offsets_hz, len(chirps)), np.tile(chirps, len(offsets_hz))
    time_s = piece_s[:, None]
    phase = math.pi * (2 * offset_hz * time_s + chirp * time_s**2)
    waves = np.stack([np.cos(phase), -np.sin(phase)]) / PIECES
    return waves, np.stack([offset_hz, chirp])


def _orthonormal(time_s: FloatArray, terms: int) -> tuple[FloatArray, FloatArray]:
    """Orthogonal polynomials of rising order and mean square 1, and their slopes [terms, times]."""
    scale = float(np.max(time_s))
    powers = np.vander(time_s / scale, terms, increasing=True)
    _, r = np.linalg.qr(powers / math.sqrt(len(time_s)))
    coefficients = np.linalg.inv(r * np.sign(np.diag(r))[:, None]).T
    order = np.arange(1, terms)
    slopes = coefficients[:, 1:] @ (order * powers[:, :-1]).T / scale
    return coefficients @ powers.T, slopes
