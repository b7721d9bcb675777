"""The document's receiver from its discriminator on, for many messages at a time.

`rail_signals.track_code.reference_receiver` at 640 Hz: its band-pass and its analytic filter are
one impulse response about the carrier; discriminator, low-pass, DC rejecter, compressor, slots and
rules are the same.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft, signal

from rail_signals.arrays import BoolArray, FloatArray
from rail_signals.track_code.decision import MOST_NOISE
from rail_signals.track_code.demodulator import DemodulatorChain
from rail_signals.track_code.filters import DEMODULATED_RATE_HZ, dc_rejecter, response
from rail_signals.track_code.profile import TrackCodeProfile
from rail_signals.track_code.reference_receiver import receiver_estimator

from .baseband import RATE_HZ, SAMPLES_PER_SLOT_SAMPLE, Baseband
from .words import CheckedWords

CARRIER_HZ: Final = 1700.0
INPUT_RATE_HZ: Final = 16_000.0
"""Carrier and sample rate of the receiver whose filters these are [Hz]."""

HOP_SAMPLES: Final = 8
"""Samples at 64 Hz from decision to decision."""

_BAND_TAPS: Final = 128
_BAND_POINTS: Final = 1024
_EVERY: Final = round(RATE_HZ / DEMODULATED_RATE_HZ)


class Decisions(NamedTuple):
    """What is made of slots.

    Attributes
    ----------
    bits : bool [messages, decisions, tones]
        Level above the middle between the windows.
    levels : float64 [messages, decisions, tones]
        Deviation over the nominal one.
    confirmed : bool [messages, decisions]
        Whether a word is valid: by windows, noise, check, and the decision before.
    """

    bits: BoolArray
    levels: FloatArray
    confirmed: BoolArray


class LowRateChain:
    """The chain for one profile.

    Parameters
    ----------
    profile
        With a CRC.

    Attributes
    ----------
    words : CheckedWords
    settled_samples : int
        Samples at `RATE_HZ` that the receiver takes from silence to its first decision.
    """

    def __init__(self, profile: TrackCodeProfile) -> None:
        self.profile: Final = profile
        self.words: Final = CheckedWords(profile)
        self._chain = DemodulatorChain(profile, CARRIER_HZ, INPUT_RATE_HZ)
        assert self._chain.discriminator_rate_hz == RATE_HZ
        hops = math.ceil((self._chain.settling_samples + profile.slot_samples) / HOP_SAMPLES)
        self.settled_samples: Final = hops * HOP_SAMPLES * SAMPLES_PER_SLOT_SAMPLE
        self._estimator = receiver_estimator(self._chain)
        self._deviations_hz = np.array(profile.deviations_hz)
        self._band = _band_about_carrier(self._chain)
        self._at_128_hz = np.concatenate([dc_rejecter(), self._chain.compressor])

    def samples_for(self, decisions: int) -> int:
        """Samples at `RATE_HZ` from silence to the last of so many decisions."""
        return self.settled_samples + (decisions - 1) * HOP_SAMPLES * SAMPLES_PER_SLOT_SAMPLE

    def receive(self, baseband: Baseband, decisions: int) -> Decisions:
        """The last decisions, a hop apart, of waves that begin in silence.

        Parameters
        ----------
        baseband : complex64 [messages, samples]
            Samples as of `samples_for`, or more; a multiple of those of a hop.
        decisions
            How many; the first is never confirmed.
        """
        length = self.profile.slot_samples
        wave = self.demodulated(baseband)[:, -length - (decisions - 1) * HOP_SAMPLES :]
        slots = np.lib.stride_tricks.sliding_window_view(wave, length, axis=1)[:, ::HOP_SAMPLES]
        bits, levels, valid = self.judge(slots)
        return Decisions(bits, levels, confirmed(bits, valid))

    def demodulated(self, baseband: Baseband) -> FloatArray:
        """Demodulated wave at 64 Hz [Hz], float64 [messages, samples / 10]."""
        count = baseband.shape[1]
        size = fft.next_fast_len(count + self._band.size)
        spectrum = fft.fft(baseband, size, axis=1)
        spectrum *= fft.fft(self._band, size)
        band = fft.ifft(spectrum, axis=1)[:, :count]
        before = np.concatenate([np.zeros((len(band), 1), band.dtype), band[:, :-1]], axis=1)
        step = band * before.conj()
        frequency_hz = np.arctan2(step.imag, step.real) * (RATE_HZ / (2 * math.pi))
        low = signal.sosfilt(self._chain.low_pass, frequency_hz, axis=1)[:, _EVERY - 1 :: _EVERY]
        return np.asarray(signal.sosfilt(self._at_128_hz, low, axis=1)[:, 1::2])

    def judge(self, slots: FloatArray) -> tuple[BoolArray, FloatArray, BoolArray]:
        """Decide slots by themselves, as `rail_signals.track_code.decision.judge_levels` does.

        Parameters
        ----------
        slots : float64 [..., slot_samples]
            Demodulated waves at 64 Hz [Hz].

        Returns
        -------
        bits : bool [..., tones]
        levels : float64 [..., tones]
        valid : bool [...]
            Levels in their windows, little noise, right check.
        """
        profile = self.profile
        levels = np.abs(self._estimator.amplitudes(slots)) / self._deviations_hz
        noise = self._estimator.noise(slots) / self._deviations_hz
        bits = np.asarray(levels > (profile.absent_max + profile.present_min) / 2)
        present = (levels >= profile.present_min) & (levels <= profile.present_max)
        clear = (present | (levels <= profile.absent_max)).all(axis=-1)
        quiet = noise.max(axis=-1) <= MOST_NOISE
        return bits, levels, clear & quiet & self.words.pass_check(bits)


def confirmed(bits: BoolArray, valid: BoolArray) -> BoolArray:
    """Which decisions confirm the one before: both valid, and of the same word.

    Parameters
    ----------
    bits : bool [messages, decisions, tones]
    valid : bool [messages, decisions]

    Returns
    -------
    bool [messages, decisions]
        Never the first.
    """
    repeated = np.zeros_like(valid)
    same = (bits[:, 1:] == bits[:, :-1]).all(axis=-1)
    repeated[:, 1:] = valid[:, 1:] & valid[:, :-1] & same
    return repeated


@lru_cache(maxsize=8)
def low_rate_chain(profile: TrackCodeProfile) -> LowRateChain:
    """The chain for a profile; its design takes longer than some messages do."""
    return LowRateChain(profile)


def _band_about_carrier(chain: DemodulatorChain) -> NDArray[np.complex64]:
    """Impulse response of band-pass and analytic filter about the carrier, complex64 [taps]."""
    frequency_hz = CARRIER_HZ + np.fft.fftfreq(_BAND_POINTS, 1 / RATE_HZ)
    band = response(chain.band_pass, frequency_hz, INPUT_RATE_HZ)
    taps = chain.analytic_taps
    turn = np.exp(-2j * math.pi * np.outer(frequency_hz / INPUT_RATE_HZ, np.arange(taps.size)))
    # Half, since the analytic filter doubles a real wave's positive frequencies.
    return np.fft.ifft(band * (turn @ taps) / 2)[:_BAND_TAPS].astype(np.complex64)
