"""The track-code transmitter: a carrier, frequency-modulated by the tones of a word.

Kim et al., equations 1-3, with their errata: the modulating wave is
``s(t) = sum_i 2 pi b_i A_i sin(2 pi F_i t)`` (1), the sent one
``v(t) = sin(2 pi f_o t + int s(tau) dtau)`` (2, the variable of integration restored), hence
``v(t) = sin(2 pi f_o t - sum_i (b_i A_i / F_i) cos(2 pi F_i t) + const)`` (3, where 2 pi cancels).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.arrays import BoolArray, FloatArray

from .profile import TrackCodeProfile

_ROW = 128


class FmTransmitter:
    """Sends words as one endless FM wave, block by block.

    Each tone runs on from the first sample whether it is sent or not; a change of word
    only shifts the constant of equation 3, so the phase of the wave never jumps. Phases
    are closed forms of the sample number: nothing adds up over hours (below 1e-6 rad
    after a day), and the wave does not depend on how it is cut into blocks, but for rounding.

    Parameters
    ----------
    profile
        Tones and deviations.
    carrier_hz
        Carrier frequency f_o [Hz]; need not be one of the profile's.
    sample_rate_hz
        Sample rate [Hz]; the highest instantaneous frequency must stay below half of it.
    tone_phases_rad : [tones], optional
        Phase of each tone at the first sample [rad]; zero unless given.

    Raises
    ------
    ValueError
        If a frequency does not fit; the message names it and quotes the value.

    Examples
    --------
    >>> from rail_signals.track_code.profile import load_profile
    >>> transmitter = FmTransmitter(load_profile("three_tones"), 1700.0, 16_000.0)
    >>> wave = transmitter.block([True, False, True], 1600)
    >>> wave.shape, transmitter.samples
    ((1600,), 1600)
    """

    def __init__(
        self,
        profile: TrackCodeProfile,
        carrier_hz: float,
        sample_rate_hz: float,
        tone_phases_rad: Sequence[float] | None = None,
    ) -> None:
        if not (math.isfinite(carrier_hz) and carrier_hz > profile.peak_deviation_hz):
            raise ValueError(
                f"carrier_hz must be above the deviation of {profile.peak_deviation_hz:g} Hz,"
                f" got {carrier_hz!r}"
            )
        highest = carrier_hz + profile.peak_deviation_hz
        if not (math.isfinite(sample_rate_hz) and sample_rate_hz > 2 * highest):
            raise ValueError(
                f"sample_rate_hz must be above twice {highest:g} Hz, got {sample_rate_hz!r}"
            )
        phases = np.zeros(profile.tones) if tone_phases_rad is None else tone_phases_rad
        self._turns = np.asarray(phases, dtype=np.float64) / (2 * math.pi)
        if self._turns.shape != (profile.tones,) or not np.isfinite(self._turns).all():
            raise ValueError(
                f"tone_phases_rad must hold {profile.tones} finite phases, got {phases!r}"
            )
        self.profile = profile
        self.carrier_hz = float(carrier_hz)
        self.sample_rate_hz = float(sample_rate_hz)
        self._indices = np.array(profile.deviations_hz) / np.array(profile.tones_hz)
        place = np.arange(_ROW) / self.sample_rate_hz * np.array(profile.tones_hz)[:, None]
        self._row = np.vstack([np.cos(2 * math.pi * place), np.sin(2 * math.pi * place)])
        self.reset()

    @property
    def samples(self) -> int:
        """Samples sent so far."""
        return self._samples

    def reset(self) -> None:
        """Start again at the first sample."""
        self._samples = 0
        self._bits: BoolArray = np.zeros(self.profile.tones, dtype=np.bool_)
        self._constant_rad = 0.0

    def block(self, bits: ArrayLike, samples: int) -> FloatArray:
        """Next samples of the wave.

        Parameters
        ----------
        bits : bool [tones]
            The tones that are present during this block.
        samples
            Length of the block.

        Returns
        -------
        float64 [samples]
            Passband wave of unit amplitude.

        Raises
        ------
        ValueError
            If the shape or type of `bits`, or `samples`, is wrong.
        """
        present = np.asarray(bits)
        if present.shape != (self.profile.tones,) or present.dtype != np.bool_:
            raise ValueError(
                f"bits must be {self.profile.tones} truth values, got {present.dtype}"
                f" of shape {present.shape}"
            )
        if isinstance(samples, bool) or samples != int(samples) or samples < 0:
            raise ValueError(f"samples must be a non-negative integer, got {samples!r}")
        if not np.array_equal(present, self._bits):
            self._change(present)
        # Sample numbers are exact in float64 for thousands of years.
        number = np.arange(self._samples, self._samples + int(samples), dtype=np.float64)
        turns = number * self.carrier_hz / self.sample_rate_hz
        phase = 2 * math.pi * (turns - np.floor(turns)) + self._constant_rad
        phase -= self._modulation(present, int(samples))
        self._samples += int(samples)
        return np.asarray(np.sin(phase), dtype=np.float64)

    def _change(self, present: BoolArray) -> None:
        """Take over a new word, keeping the phase of the wave where it is."""
        changed = present.astype(np.float64) - self._bits
        self._constant_rad += float(
            changed * self._indices @ np.cos(self._tone_phases_rad(np.array([self._samples]))[0])
        )
        self._constant_rad = math.remainder(self._constant_rad, 2 * math.pi)
        self._bits = present.copy()

    def _modulation(self, present: BoolArray, samples: int) -> FloatArray:
        """Sum of ``(A_i / F_i) cos(2 pi F_i t)`` over the tones present, float64 [samples].

        The sample number is split into the start of a row and the place in it, and the
        cosine of their sum into products: one matrix product instead of a cosine for
        each tone and sample.
        """
        first, last = self._samples // _ROW, -(-(self._samples + samples) // _ROW)
        start = self._tone_phases_rad(np.arange(first, last) * _ROW)
        sized = np.where(present, self._indices, 0.0)
        rows = np.hstack([sized * np.cos(start), -sized * np.sin(start)]) @ self._row
        skip = self._samples - first * _ROW
        return np.asarray(rows.ravel()[skip : skip + samples], dtype=np.float64)

    def _tone_phases_rad(self, number: NDArray[np.int64]) -> FloatArray:
        """Phases [samples, tones] of the tones at the given samples [rad], within one turn."""
        cycles = number[:, None] * np.array(self.profile.tones_hz) / self.sample_rate_hz
        turns = cycles + self._turns
        return np.asarray(2 * math.pi * (turns - np.floor(turns)), dtype=np.float64)
