"""Propagation delay of a sampled block."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray, FloatArray

from .phasors import cis


def fractional_delay(blocks: ArrayLike, delay_s: ArrayLike, sample_rate_hz: float) -> ComplexArray:
    """Delay blocks by any time, band-limited and circular.

    A block is one observation window of a steady transmission and is extended
    periodically, so that a signal with whole periods in the block is delayed exactly.
    Only the envelope is delayed; the phase of the radio carrier belongs to the medium.

    Parameters
    ----------
    blocks : complex [..., samples]
        Complex envelopes.
    delay_s : [...]
        Delay of each block [s]; broadcasts against the leading axes of `blocks`.
    sample_rate_hz
        Complex sample rate [Hz].

    Returns
    -------
    complex128 [..., samples]

    Examples
    --------
    >>> abs(fractional_delay([1.0, 0.0, 0.0, 0.0], 0.5, 4.0)).round(12).tolist()
    [0.0, 0.0, 1.0, 0.0]
    """
    x = np.asarray(blocks, dtype=np.complex128)
    if x.ndim == 0 or x.shape[-1] == 0:
        raise ValueError(f"blocks must have at least one sample, got shape {x.shape}")
    if not (math.isfinite(sample_rate_hz) and sample_rate_hz > 0):
        raise ValueError(f"sample_rate_hz must be finite and above zero, got {sample_rate_hz!r}")
    delay = np.asarray(delay_s, dtype=np.float64)
    if not np.isfinite(delay).all():
        raise ValueError("delay_s must be finite")
    return delayed(np.fft.fft(x), delay, sample_rate_hz)


def delayed(spectra: ComplexArray, delay_s: FloatArray, sample_rate_hz: float) -> ComplexArray:
    """Blocks [..., samples] of the transforms of blocks, delayed as by `fractional_delay`."""
    ramp = _phase_ramp(delay_s * sample_rate_hz, spectra.shape[-1])
    return np.fft.ifft(spectra * ramp)


def repetition(block: ComplexArray, guess: int = 0) -> int:
    """Samples after which a block [samples] repeats, to the last bit; its length if it does not.

    Parameters
    ----------
    block : complex [samples]
    guess : int
        Tried first; taken if the block repeats after so many samples.

    Examples
    --------
    >>> repetition(np.array([1j, 2, 1j, 2, 1j, 2])), repetition(np.array([1j, 2, 3]))
    (2, 3)
    """
    samples = len(block)
    if 0 < guess < samples and samples % guess == 0 and _repeats(block, guess):
        return guess
    for count in range(1, samples // 2 + 1):
        if samples % count == 0 and _repeats(block, count):
            return count
    return samples


def _repeats(block: ComplexArray, count: int) -> bool:
    # A quick look at two samples settles most cases.
    return bool(block[0] == block[count] and (block[:-count] == block[count:]).all())


def _phase_ramp(delay_samples: FloatArray, samples: int) -> ComplexArray:
    """``exp(-j 2 pi k d / N)`` over the signed bin numbers k in transform order.

    Two short tables and their outer product replace N complex exponentials.
    """
    turn = -2 * math.pi * np.mod(delay_samples, samples)[..., None] / samples
    fine_count = _fine_count(samples)
    first = np.fft.fftfreq(samples, 1 / samples)[::fine_count]
    fine = cis(turn * np.arange(fine_count))
    coarse = cis(turn * first)
    shape = (*turn.shape[:-1], samples)
    return np.asarray((coarse[..., :, None] * fine[..., None, :]).reshape(shape))


@cache
def _fine_count(samples: int) -> int:
    """Length of the fine table: about the root, and the negative bins begin a coarse step."""
    if samples % 2:
        return 1
    half = samples // 2
    return max(d for d in range(1, math.isqrt(samples) + 1) if half % d == 0)
