"""Streaming receiver of track codes with a double sliding slot.

The wave is demodulated (`Demodulator`), and two slots slide over the result at 64 Hz, hop
by hop. The **long slot** decides: tone levels by least squares (`tone_estimator`), windows,
check bits and confirmation (`rail_signals.track_code.decision`). The **short slot** notices a
change: the tones of the word in force, whose phases are known, are continued into it, and what is
left over is compared with what noise leaves. When it notices, the word loses its validity at
once, and a new long slot begins: no decision after that rests on a mixture of two words. A
change too small to be noticed at first is left to windows, noise, check bits and confirmation.

Time from a change of the word to its validity: the delay until it is noticed (0.1 s, the
filters and the grid of hops), the long slot, and ``confirmations - 1`` hops.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray, FloatArray

from .decision import Confirmation, Decision, judge_levels, no_slot, read_only
from .demodulator import Demodulator, DemodulatorChain
from .profile import SLOT_RATE_HZ, TrackCodeProfile
from .tone_levels import ToneEstimator, tone_columns, tone_estimator

MOST_AT_PEAK = 0.05
"""Fraction of samples of a hop that may be at its peak value; an unclipped wave has a few."""

LOUDEST = 1e6
"""Sample magnitude beyond which the input is taken for broken."""

CHANGE_OVER_NOISE = 4.0
# A new word differs in several tones; a third of the weakest one, in root mean square.
_CHANGE_OF_WEAKEST = 0.35


@dataclass(frozen=True)
class Word:
    """The word in force: present tones at one instant."""

    amplitudes: ComplexArray
    sample: int
    residual_hz: float


class ReferenceTrackCodeReceiver:
    """Turns the wave picked up from the rails into decisions, block by block.

    The decisions depend on the samples alone and not on how they are cut into blocks:
    samples wait until a hop is complete.

    Parameters
    ----------
    profile
        Track-code family.
    carrier_hz
        Carrier to receive [Hz].
    sample_rate_hz
        Input rate [Hz], a multiple of 128 Hz.
    hop_samples
        Samples at 64 Hz from decision to decision.
    confirmations
        Successive long slots that must hold the same word.
    least_amplitude
        Carrier amplitude below which there is no signal, in the unit of the samples.

    Raises
    ------
    ValueError
        If a parameter is out of range; the message names it and quotes the value.

    Examples
    --------
    >>> from rail_signals.track_code.profile import load_profile
    >>> from rail_signals.track_code.signal import FmTransmitter
    >>> profile = load_profile("tones18")
    >>> wave = FmTransmitter(profile, 2000.0, 6400.0).block(np.arange(18) == 4, 19200)
    >>> ReferenceTrackCodeReceiver(profile, 2000.0, 6400.0).feed(wave)[-1].fields
    {'tone': 4}
    """

    def __init__(
        self,
        profile: TrackCodeProfile,
        carrier_hz: float,
        sample_rate_hz: float,
        *,
        hop_samples: int = 8,
        confirmations: int = 2,
        least_amplitude: float = 1e-3,
    ) -> None:
        if isinstance(hop_samples, bool) or hop_samples != int(hop_samples) or hop_samples < 1:
            raise ValueError(f"hop_samples must be a positive integer, got {hop_samples!r}")
        if not (math.isfinite(least_amplitude) and least_amplitude > 0):
            raise ValueError(
                f"least_amplitude must be finite and above zero, got {least_amplitude!r}"
            )
        self.profile = profile
        self.chain = DemodulatorChain(profile, float(carrier_hz), float(sample_rate_hz))
        self.hop_samples = int(hop_samples)
        self._least_amplitude = least_amplitude
        self._estimator = receiver_estimator(self.chain)
        self._deviations = np.array(profile.deviations_hz)
        gain = self.chain.gain(profile.tones_hz)
        self._short = profile.short_slot_samples
        self._continued = tone_columns(profile.tones_hz, SLOT_RATE_HZ, self._short) * gain
        self._model = tone_columns(profile.tones_hz, SLOT_RATE_HZ, profile.slot_samples) * gain
        self._least_change_hz = _CHANGE_OF_WEAKEST * float(np.min(self._deviations * abs(gain)))
        self._frame = round(sample_rate_hz / SLOT_RATE_HZ) * self.hop_samples
        self._demodulator = Demodulator(self.chain)
        self._confirmation = Confirmation(confirmations)
        # Not that of a subclass, which is not there yet.
        ReferenceTrackCodeReceiver.reset(self)

    def reset(self) -> None:
        """Forget everything received; the next sample is the first."""
        self._demodulator.reset()
        self._waiting = np.zeros(0)
        self._hops = 0
        self._slot = np.zeros(self.profile.slot_samples)
        self._restart(-self.chain.settling_samples)

    @property
    def time_s(self) -> float:
        """Time of the newest decision [s]."""
        return self._hops * self.hop_samples / SLOT_RATE_HZ

    def feed(self, samples: ArrayLike) -> list[Decision]:
        """Receive the next samples.

        Parameters
        ----------
        samples : float [n]
            Passband wave of any length, none included. Samples that are not finite, or
            that are clipped, make decisions invalid until the slot is free of them.

        Returns
        -------
        list of Decision
            One for each hop that these samples complete.

        Raises
        ------
        ValueError
            If the samples are not real floating-point numbers in one dimension.
        """
        block = np.asarray(samples)
        if block.ndim != 1 or block.dtype.kind != "f":
            raise ValueError(
                f"samples must be real floats in one dimension, got {block.dtype}"
                f" of shape {block.shape}"
            )
        everything = np.concatenate([self._waiting, block.astype(np.float64, copy=False)])
        whole = everything.size - everything.size % self._frame
        self._waiting = everything[whole:].copy()
        return [self._hop(frame) for frame in everything[:whole].reshape(-1, self._frame)]

    def _hop(self, frame: FloatArray) -> Decision:
        """Take one hop of samples and decide."""
        fault = input_fault(frame)
        # Zeros keep what is not a number out of the filters, which would never forget it.
        demodulated, amplitude = self._demodulator.frame(np.zeros_like(frame) if fault else frame)
        return self._take(fault, demodulated, amplitude)

    def _take(self, fault: str, demodulated: FloatArray, amplitude: float) -> Decision:
        """Take what a hop became, and what was wrong with its samples, and decide."""
        self._hops += 1
        kept = np.concatenate([self._slot, demodulated])
        self._slot = kept[kept.size - self._slot.size :]
        if not fault and amplitude < self._least_amplitude:
            fault = "no carrier"
        if fault:
            self._restart(-self.chain.settling_samples)
            return no_slot(self.profile, self.time_s, fault)
        self._fresh += self.hop_samples
        if self._change_noticed():
            self._restart(0)
            return no_slot(self.profile, self.time_s, "change noticed")
        if self._fresh < self._slot.size:
            missing_s = (self._slot.size - self._fresh) / SLOT_RATE_HZ
            return no_slot(self.profile, self.time_s, f"slot lacks {missing_s:.3f} s")
        return self._decide()

    def _restart(self, fresh: int) -> None:
        """Begin a new long slot, of which so many samples are there already."""
        self._fresh = fresh
        self._word: Word | None = None
        self._confirmation.reset()

    def _decide(self) -> Decision:
        """Decide by the long slot."""
        amplitudes = self._estimator.amplitudes(self._slot)
        levels = np.asarray(np.abs(amplitudes) / self._deviations)
        noise = self._estimator.noise(self._slot) / self._deviations
        bits, fields, reason = judge_levels(self.profile, levels, noise)
        if fields is None:
            self._confirmation.reset()
        elif not self._confirmation.confirm(bits):
            reason = self._confirmation.reason
        else:
            present = np.where(bits, amplitudes, 0)
            left = self._slot - (self._model @ present).real
            self._word = Word(present, self._now, float(np.sqrt(np.mean(left * left))))
        message = None if reason else fields
        return Decision(
            self.time_s, read_only(bits), read_only(levels), not reason, message, reason
        )

    def _change_noticed(self) -> bool:
        """Whether the short slot holds something else than the word in force goes on to be."""
        word = self._word
        if word is None:
            return False
        elapsed_s = (self._now - word.sample) / SLOT_RATE_HZ
        turn = np.exp(2j * math.pi * elapsed_s * np.array(self.profile.tones_hz))
        left = self._slot[-self._short :] - (self._continued @ (word.amplitudes * turn)).real
        residual_hz = float(np.sqrt(np.mean(left * left)))
        return residual_hz > max(CHANGE_OVER_NOISE * word.residual_hz, self._least_change_hz)

    @property
    def _now(self) -> int:
        """Number of the newest sample at 64 Hz."""
        return self._hops * self.hop_samples


def receiver_estimator(chain: DemodulatorChain) -> ToneEstimator:
    """Estimator of the long slot behind a chain: its gains, its noise, its DC rejecter."""
    samples = chain.profile.slot_samples
    return tone_estimator(
        chain.profile.tones_hz,
        SLOT_RATE_HZ,
        samples,
        noise_spectrum=chain.noise_spectrum,
        gain=chain.gain(chain.profile.tones_hz),
        nuisance=chain.rejecter_modes(samples),
    )


def input_fault(frame: FloatArray) -> str:
    """What is wrong with samples as such; empty if nothing is."""
    size = np.abs(frame)
    peak = float(size.max())
    if not math.isfinite(peak):
        return "samples are not finite"
    if peak > LOUDEST:
        return f"samples exceed {LOUDEST:g}"
    if peak == 0:
        return "no carrier"
    if np.count_nonzero(size == peak) > MOST_AT_PEAK * frame.size:
        return "samples are clipped"
    return ""
