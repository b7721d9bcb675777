"""A track code followed from slot to slot by maximum likelihood.

A word lasts for seconds, and its tones go on through all of it. What one slot says about them,
turned on by the time of a hop, is where the fit of the next one starts; near the truth the
search of `rail_signals.track_code.ml`, which fails long before the fit does, is not needed. Every
slot is decided by its own samples: of the fits from the slot before, from the mean of those before,
and, where none is plausible, from scratch, the likeliest.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.arrays import ComplexArray, FloatArray

from .ml import MaximumLikelihoodTones, SlotFit, SlotToneFit

# Weight of the newest slot in the mean. Slots overlap, so that a lesser one would gain little.
_NEWEST = 0.15
# Tones of which mean and slot may differ before the mean is given up for another word.
_MOST_CHANGED = 4


class TrackedTones:
    """Estimator of a track code's tones in slots that follow each other.

    Parameters
    ----------
    fit
        Estimator for a slot, with nominal deviations.
    hop_samples
        Samples from one slot to the next.

    Examples
    --------
    >>> fit = MaximumLikelihoodTones([3.0, 10.0], 500, 250.0, deviations_hz=[2.0, 2.0])
    >>> t = np.arange(550) / 250.0
    >>> wave = np.exp(1j * (1.0 + 2.0 / 10.0 * np.sin(2 * np.pi * 10.0 * t)))[None, :]
    >>> tracked = TrackedTones(fit, 50)
    >>> for start in (0, 50):
    ...     found = tracked.next(wave[:, start : start + 500])
    >>> abs(found.amplitudes_hz[0]).round(6).tolist()
    [0.0, 2.0]
    """

    def __init__(self, fit: MaximumLikelihoodTones, hop_samples: int) -> None:
        if fit.deviations_hz is None:
            raise ValueError("fit must have nominal deviations")
        if hop_samples < 1:
            raise ValueError(f"hop_samples must be at least 1, got {hop_samples!r}")
        self._fit = fit
        self._tones = len(fit.tones_hz)
        self._hop_s = hop_samples / fit.sample_rate_hz
        self._turn = np.exp(2j * math.pi * fit.tones_hz * self._hop_s)
        self._half_hz = fit.deviations_hz / 2
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next slots are the first."""
        self._last: SlotFit | None = None
        self._mean = np.zeros((0, 0))

    def next(self, baseband: ArrayLike) -> SlotToneFit:
        """Fit the next slot of every stream.

        Parameters
        ----------
        baseband : complex [streams, samples]
            As of :meth:`MaximumLikelihoodTones.estimate`, one hop after those before.

        Returns
        -------
        SlotToneFit
            ``plausible`` tells which streams are locked.

        Raises
        ------
        ValueError
            If the shape is wrong, or the number of streams another than before.
        """
        z, size = self._fit.scaled(baseband)
        if z.ndim != 2 or (self._last is not None and len(z) != len(self._mean)):
            raise ValueError(f"baseband must be [streams, samples] as before, got {z.shape}")
        if self._last is None:
            fitted = self._fit.search(z)
            self._mean = fitted.parameters.copy()
        else:
            before = fitted = self._fit.fitted(z, self._ahead(self._last.parameters))
            self._mean = self._ahead(self._mean)
            fitted = before.likelier(self._fit.fitted(z, self._mean))
            lost = np.flatnonzero(~fitted.plausible)
            if lost.size:
                fitted = fitted.with_likelier(lost, self._fit.search(z[lost]))
            self._average(fitted)
        self._last = fitted
        return self._fit.result(fitted, size)

    def _ahead(self, parameters: FloatArray) -> FloatArray:
        """Parameters of the wave that goes on, about the middle of the next slot."""
        ahead: FloatArray = parameters.copy()
        ahead[:, 0] += parameters[:, 1] * self._hop_s
        x, y = slice(2, 2 + self._tones), slice(2 + self._tones, None)
        turned: ComplexArray = (parameters[:, x] - 1j * parameters[:, y]) * self._turn
        ahead[:, x], ahead[:, y] = turned.real, -turned.imag
        return ahead

    def _average(self, fitted: SlotFit) -> None:
        """Move the mean towards the slots that hold the same word, or begin it anew."""
        assert self._last is not None
        changed = np.count_nonzero(
            self._present(fitted.parameters) != self._present(self._mean), axis=1
        )
        anew = fitted.plausible & ((changed > _MOST_CHANGED) | ~self._last.plausible)
        step = fitted.parameters - self._mean
        step[:, 0] = (step[:, 0] + math.pi) % (2 * math.pi) - math.pi
        weight = np.where(anew, 1.0, np.where(fitted.plausible, _NEWEST, 0.0))
        self._mean += weight[:, None] * step

    def _present(self, parameters: FloatArray) -> NDArray[np.bool_]:
        """Which tones are there [streams, tones]."""
        x, y = parameters[:, 2 : 2 + self._tones], parameters[:, 2 + self._tones :]
        return np.asarray(np.hypot(x, y) > self._half_hz)
