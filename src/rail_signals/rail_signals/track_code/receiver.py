"""The track-code receiver for long inputs: the same decisions, many hops at a time.

The demodulated wave comes from `rail_signals.track_code.block_demodulator`. Amplitudes, residuals
and windows of all slots of a batch are then a few matrix products. As long as the word in force
goes on, that settles the decisions; every other hop is given to the decision stage of
`ReferenceTrackCodeReceiver`, which is not repeated here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import repeat
from typing import TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from rail_signals.arrays import BoolArray, ComplexArray, FloatArray
from rail_signals.compiled import compiled

from .block_demodulator import BlockDemodulator
from .decision import MOST_NOISE, Decision, no_slot, read_only
from .profile import SLOT_RATE_HZ, TrackCodeProfile
from .reference_receiver import (
    CHANGE_OVER_NOISE,
    LOUDEST,
    MOST_AT_PEAK,
    ReferenceTrackCodeReceiver,
    Word,
    input_fault,
)

SingleArray: TypeAlias = NDArray[np.float32]
RealArray: TypeAlias = NDArray[np.floating]

_BATCH_HOPS = 2048
_PIECE_BYTES = 1 << 18
# Bits of a float but its sign, by its size in bytes: magnitudes are in the order of these numbers.
_MAGNITUDES = {4: np.int32(0x7FFFFFFF), 8: np.int64(0x7FFFFFFFFFFFFFFF)}


@dataclass(frozen=True)
class _Steady:
    """Slots of a batch, as they are where the word of the slot before stays in force.

    Attributes
    ----------
    goes_on : bool [hops]
        Whether a hop confirms the word of the one before, if that was valid.
    bits : bool [hops, tones]
    levels : float64 [hops, tones]
    parts : float32 [hops, 2 tones]
        Real, then imaginary parts of the amplitudes of the tones present [Hz].
    residual_hz : float32 [hops]
        What they leave over.
    """

    goes_on: BoolArray
    bits: BoolArray
    levels: FloatArray
    parts: SingleArray
    residual_hz: SingleArray


class TrackCodeReceiver(ReferenceTrackCodeReceiver):
    """`ReferenceTrackCodeReceiver` for long inputs: same parameters, same decisions, less work.

    The levels differ from those of `ReferenceTrackCodeReceiver` by about 1e-3, from the finite
    length of the filters, and in their last digits with the way the input is cut.
    Input in single precision is the fastest.

    Examples
    --------
    >>> from rail_signals.track_code.profile import load_profile
    >>> from rail_signals.track_code.signal import FmTransmitter
    >>> profile = load_profile("tones18")
    >>> wave = FmTransmitter(profile, 2000.0, 6400.0).block(np.arange(18) == 4, 19200)
    >>> TrackCodeReceiver(profile, 2000.0, 6400.0).feed(wave)[-1].fields
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
        super().__init__(
            profile,
            carrier_hz,
            sample_rate_hz,
            hop_samples=hop_samples,
            confirmations=confirmations,
            least_amplitude=least_amplitude,
        )
        self._fast_demodulator = BlockDemodulator(self.chain, self.hop_samples)
        matrix = self._estimator.matrix
        # Amplitudes and residuals of a slot in one product.
        measure = np.concatenate([matrix.real, matrix.imag, self._estimator.whitener])
        self._measure = np.ascontiguousarray(measure.T, dtype=np.float32)
        self._worst_spread = float(np.max(self._estimator.spread / self._deviations))
        nothing = no_slot(profile, 0.0, "")
        self._nothing = nothing.bits, nothing.levels
        # One hop on, the tones of a word have turned.
        turn = np.exp(2j * math.pi * self.hop_samples / SLOT_RATE_HZ * np.array(profile.tones_hz))
        self._wave = _real_rows(self._model)
        self._next_wave = _real_rows(self._continued * turn)
        self._valid = False
        self._fields: Mapping[str, int] | None = None

    def reset(self) -> None:
        """Forget everything received; the next sample is the first."""
        super().reset()
        self._fast_demodulator.reset()
        self._valid, self._fields = False, None

    def feed(self, samples: ArrayLike) -> list[Decision]:
        """Receive the next samples; as `ReferenceTrackCodeReceiver.feed`."""
        block = np.asarray(samples)
        if block.ndim != 1 or block.dtype.kind != "f":
            return super().feed(block)  # refuses it
        decisions: list[Decision] = []
        for frames in self._frames(block):
            decisions += self._decide_frames(frames)
        return decisions

    def _frames(self, block: RealArray) -> Iterator[RealArray]:
        """Whole hops [hops, frame] of what waits and the next samples, in batches."""
        if self._waiting.size:
            missing = self._frame - self._waiting.size
            first = np.concatenate([self._waiting, block[:missing]])
            block = block[missing:]
            if first.size < self._frame:
                self._waiting = first
                return
            yield first[None, :]
        whole = block.size - block.size % self._frame
        self._waiting = block[whole:].astype(np.float64)
        frames = block[:whole].reshape(-1, self._frame)
        for start in range(0, len(frames), _BATCH_HOPS):
            yield frames[start : start + _BATCH_HOPS]

    def _decide_frames(self, frames: RealArray) -> list[Decision]:
        """Decisions of a batch of hops [hops, frame]."""
        hops = len(frames)
        decimated, faulty = self._decimated(frames)
        demodulated, amplitude = self._fast_demodulator.demodulate(decimated, hops)
        stream = np.concatenate([self._slot, demodulated.ravel()])
        # The first is the slot before the batch.
        every = sliding_window_view(stream, self._slot.size)[:: self.hop_samples]
        slots = every.astype(np.float32)
        steady = self._measured(slots)
        faulty |= amplitude < self._least_amplitude
        steady.goes_on[faulty] = False
        decisions: list[Decision] = []

        def decide_until(stop: int) -> None:
            """Decide hop by hop up to `stop`, or until a word is valid."""
            for k in range(len(decisions), stop):
                if not faulty[k] and self._must_wait():
                    decisions.append(self._wait())
                    continue
                self._valid = False
                self._slot = every[k]
                fault = input_fault(frames[k]) if faulty[k] else ""
                decision = self._take(fault, demodulated[k], float(amplitude[k]))
                decisions.append(decision)
                if decision.valid:
                    self._valid, self._fields = True, decision.fields
                    return

        for stop in [*np.flatnonzero(~steady.goes_on).tolist(), hops]:
            while len(decisions) < stop:
                if not self._valid:
                    decide_until(stop)
                else:
                    decisions += self._continued_decisions(steady, len(decisions), stop)
            # Here the word may end.
            decide_until(min(stop + 1, hops))
        self._slot = every[-1].copy()
        return decisions

    def _must_wait(self) -> bool:
        """Whether the next hop, if there is no fault in it, only adds to an unfinished slot."""
        return self._word is None and self._fresh + self.hop_samples < self._slot.size

    def _wait(self) -> Decision:
        """Decision of a hop of which that is true."""
        self._valid = False
        self._hops += 1
        self._fresh += self.hop_samples
        missing_s = (self._slot.size - self._fresh) / SLOT_RATE_HZ
        bits, levels = self._nothing
        return Decision(self.time_s, bits, levels, False, None, f"slot lacks {missing_s:.3f} s")

    def _decimated(self, frames: RealArray) -> tuple[SingleArray, BoolArray]:
        """First filter over a batch of hops, and which hops are faulty and count as zeros.

        In pieces that stay in the processor's cache.
        """
        step = max(1, _PIECE_BYTES // (frames.itemsize * self._frame))
        parts, faulty = [], []
        for start in range(0, len(frames), step):
            piece = frames[start : start + step]
            fault = _input_faults(piece)
            if fault.any():
                piece = np.where(fault[:, None], 0, piece)
            parts.append(self._fast_demodulator.decimate(piece.astype(np.float32, copy=False)))
            faulty.append(fault)
        return np.concatenate(parts), np.concatenate(faulty)

    def _measured(self, slots: SingleArray) -> _Steady:
        """Levels of all slots, and where the word of the slot before goes on."""
        profile, tones = self.profile, self.profile.tones
        measured = slots @ self._measure
        amplitudes, left = measured[:, : 2 * tones], measured[:, 2 * tones :]
        real, imag = amplitudes[:, :tones], amplitudes[:, tones:]
        levels = np.sqrt(real * real + imag * imag) / self._deviations
        noise = np.sqrt(np.vecdot(left, left) / left.shape[1]) * self._worst_spread
        bits = levels > (profile.absent_max + profile.present_min) / 2
        present = (levels >= profile.present_min) & (levels <= profile.present_max)
        clear = (present | (levels <= profile.absent_max)).all(axis=1) & (noise <= MOST_NOISE)
        parts = amplitudes * np.concatenate([bits, bits], axis=1)
        residual = _rms(slots - parts @ self._wave)
        change = _rms(slots[1:, -self._short :] - parts[:-1] @ self._next_wave)
        limit = np.maximum(CHANGE_OVER_NOISE * residual[:-1], self._least_change_hz)
        goes_on = (bits[1:] == bits[:-1]).all(axis=1) & clear[1:] & ~(change > limit)
        return _Steady(goes_on, read_only(bits)[1:], read_only(levels)[1:], parts[1:], residual[1:])

    def _continued_decisions(self, steady: _Steady, start: int, stop: int) -> list[Decision]:
        """Decisions from hop `start` to `stop`, in which the word in force goes on."""
        first = self._hops + 1
        self._hops += stop - start
        self._fresh += (stop - start) * self.hop_samples
        tones = self.profile.tones
        parts = steady.parts[stop - 1]
        self._word = Word(
            parts[:tones] + 1j * parts[tones:], self._now, float(steady.residual_hz[stop - 1])
        )
        times = np.arange(first, self._hops + 1) * self.hop_samples / SLOT_RATE_HZ
        bits, levels = steady.bits[start:stop], steady.levels[start:stop]
        each = zip(times.tolist(), bits, levels, repeat(True), repeat(self._fields), repeat(""))
        # As `Decision._make`, without a call of Python for each.
        return list(map(tuple.__new__, repeat(Decision), each))


def _real_rows(waves: ComplexArray) -> SingleArray:
    """Map from real and imaginary parts of amplitudes to ``Re(waves @ amplitudes)``."""
    rows = np.concatenate([waves.real, -waves.imag], axis=1).T
    return np.ascontiguousarray(rows, dtype=np.float32)


def _rms(rows: SingleArray) -> SingleArray:
    return np.asarray(np.sqrt(np.vecdot(rows, rows) / rows.shape[1]))


def _input_faults(frames: RealArray) -> BoolArray:
    """Which hops [hops, frame] hold samples at fault; what fault is said hop by hop."""
    whole = frames if frames.itemsize in _MAGNITUDES else frames.astype(np.float64)
    mask = _MAGNITUDES[whole.itemsize]
    peak_bits, at_peak = np.empty(len(frames), mask.dtype), np.empty(len(frames), np.intp)
    _peaks(np.ascontiguousarray(whole).view(mask.dtype), mask, peak_bits, at_peak)
    peak = peak_bits.view(whole.dtype)
    sound = (peak > 0) & (peak <= LOUDEST) & (at_peak <= MOST_AT_PEAK * frames.shape[1])
    return np.asarray(~sound, dtype=np.bool_)


@compiled
def _peaks(
    bits: NDArray[np.signedinteger],
    mask: np.signedinteger,
    peak: NDArray[np.signedinteger],
    at_peak: NDArray[np.intp],
) -> None:
    """Largest magnitude of every hop, and how many samples have it.

    Integers are compared, which several lanes at once can do in any order; NaN is the largest.

    Parameters
    ----------
    bits : int32 or int64 [hops, frame]
        Floats as they are stored.
    mask
        All bits but the sign.
    peak : int32 or int64 [hops]
        Bits of the largest magnitude; result.
    at_peak : intp [hops]
        Result.
    """
    for hop in range(len(bits)):
        row = bits[hop]
        most = mask ^ mask
        for i in range(len(row)):
            most = max(most, row[i] & mask)
        peak[hop] = most
        most = peak[hop]  # as narrow as the samples
        count = 0
        for i in range(len(row)):
            count += (row[i] & mask) == most
        at_peak[hop] = count
