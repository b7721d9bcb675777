"""Track codes in white noise as complex baseband, many messages at a time.

The wave is that of Kim et al., equation 3, about its carrier and at the rate of the
discriminator; the density of its noise is what a receiver at the rails would have.

=============  ==========================================================
``C/N0``       power of the carrier over the density of the noise [dB Hz]
``snr``        power of the carrier over that of the noise in a sample, linear
=============  ==========================================================
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import BoolArray, FloatArray
from rail_signals.track_code.profile import SLOT_RATE_HZ, TrackCodeProfile

RATE_HZ: Final = 640.0
"""Sample rate [Hz]: that of the receivers' discriminator."""

SAMPLES_PER_SLOT_SAMPLE: Final = round(RATE_HZ / SLOT_RATE_HZ)

PERIOD_S: Final = 12.5
"""Time after which all tones of ``tones27``, multiples of 0.08 Hz, begin again [s]."""

Baseband: TypeAlias = NDArray[np.complex64]


def snr_of(density_db_hz: float) -> float:
    """Carrier-to-noise ratio of a sample, linear, of C/N0 [dB Hz].

    >>> round(snr_of(31.0), 2)
    1.97
    """
    return float(10 ** (density_db_hz / 10)) / RATE_HZ


def slot_samples(profile: TrackCodeProfile) -> int:
    """Samples at `RATE_HZ` of the long slot of a profile."""
    return profile.slot_samples * SAMPLES_PER_SLOT_SAMPLE


def with_deviations_scaled(profile: TrackCodeProfile, scale: float) -> TrackCodeProfile:
    """A profile of larger or smaller deviations.

    Smaller ones take a stronger carrier, which keeps a discriminator above its threshold.
    """
    return replace(profile, deviations_hz=tuple(scale * each for each in profile.deviations_hz))


def draw_waves(
    profile: TrackCodeProfile, bits: BoolArray, samples: int, rng: np.random.Generator
) -> tuple[Baseband, FloatArray]:
    """Waves of unit amplitude, each seen from a random time on.

    Parameters
    ----------
    profile
        Tones and deviations.
    bits : bool [messages, tones]
        Tones that are sent.
    samples
        Length.
    rng
        Draws the time within `PERIOD_S` and the phase of the carrier.

    Returns
    -------
    baseband : complex64 [messages, samples]
    tone_phases_rad : float64 [messages, tones]
        Phase of each tone at the first sample, that of the sine of the frequency.
    """
    tones_hz = np.array(profile.tones_hz)
    start = 2 * math.pi * tones_hz * rng.uniform(0, PERIOD_S, (len(bits), 1))
    index = bits * (np.array(profile.deviations_hz) / tones_hz)
    both = np.concatenate([index * np.cos(start), index * np.sin(start)], axis=1)
    phase = -(both.astype(np.float32) @ _tone_waves(profile.tones_hz, samples))
    phase += rng.uniform(0, 2 * math.pi, (len(bits), 1)).astype(np.float32)
    baseband = np.empty(phase.shape, dtype=np.complex64)
    baseband.real, baseband.imag = np.cos(phase), np.sin(phase)
    return baseband, start


@lru_cache(maxsize=16)
def _tone_waves(tones_hz: tuple[float, ...], samples: int) -> NDArray[np.float32]:
    """Cosines, then negative sines of the tones, float32 [2 tones, samples], read-only."""
    turn = 2 * math.pi * np.outer(tones_hz, np.arange(samples) / RATE_HZ)
    waves = np.concatenate([np.cos(turn), -np.sin(turn)]).astype(np.float32)
    waves.setflags(write=False)
    return waves


def draw_noise(shape: tuple[int, int], snr: float, rng: np.random.Generator) -> Baseband:
    """White noise about a carrier of unit amplitude, complex64 [messages, samples]."""
    parts = rng.standard_normal((*shape, 2), dtype=np.float32)
    return np.asarray(parts.view(np.complex64)[..., 0] * np.float32(math.sqrt(0.5 / snr)))
