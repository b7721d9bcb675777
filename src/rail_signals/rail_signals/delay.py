"""Propagation delay of a sampled block."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.phasors import cis
from rail_signals.ranging_signal import ComplexArray


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
    ramp = _phase_ramp(delay * sample_rate_hz, x.shape[-1])
    return np.fft.ifft(np.fft.fft(x) * ramp)


def _phase_ramp(delay_samples: np.ndarray, samples: int) -> ComplexArray:
    """``exp(-j 2 pi k d / N)`` over the signed bin numbers k in transform order.

    Two short tables and their outer product replace N complex exponentials.
    """
    turn = -2 * math.pi * np.mod(delay_samples, samples)[..., None] / samples
    fine_count = math.isqrt(samples - 1) + 1
    coarse_count = -(-samples // fine_count)
    fine = cis(turn * np.arange(fine_count))
    coarse = cis(turn * (fine_count * np.arange(coarse_count)))
    shape = (*turn.shape[:-1], coarse_count * fine_count)
    ramp = (coarse[..., :, None] * fine[..., None, :]).reshape(shape)[..., :samples]
    # Bins from the Nyquist frequency upwards are negative frequencies.
    ramp[..., (samples + 1) // 2 :] *= cis(-turn * samples)
    return ramp
