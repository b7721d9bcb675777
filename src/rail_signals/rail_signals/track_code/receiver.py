"""The track-code receiver for long inputs: the same decisions, many hops at a time.

The demodulated wave comes from `rail_signals.track_code.block_demodulator`; amplitudes, residuals
and windows of all slots of a batch from `rail_signals.track_code.slot_kernel`. As long as the word
in force goes on, that settles the decisions, and where it changes, most of them. A slot that holds
no word is given to the decision stage of `ReferenceTrackCodeReceiver`, which says why.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import BoolArray, ComplexArray, FloatArray

from .block_demodulator import BlockDemodulator, RealArray
from .decision import MOST_NOISE, Decision, no_slot, read_only
from .hop_kernel import SingleArray
from .profile import SLOT_RATE_HZ, TrackCodeProfile
from .reference_receiver import (
    CHANGE_OVER_NOISE,
    ReferenceTrackCodeReceiver,
    Word,
    input_fault,
)
from .slot_kernel import SLOT_STEP, measure_slots
from .word import decode

_BATCH_HOPS = 2048


@dataclass(frozen=True)
class _Slots:
    """What the long slots of a batch hold, one at the end of each hop (`measure_slots`).

    Attributes
    ----------
    stream : float64 [slot + hops hop]
        The demodulated wave, from the slot before the batch on [Hz].
    bits : bool [hops, tones]
    levels : float64 [hops, tones]
    parts : float32 [hops, 2 tones]
        Real, then imaginary parts of the amplitudes of the tones present [Hz].
    residual_hz : float32 [hops]
        What they leave over.
    is_clear : bool [hops]
        Whether levels and noise are those of a word.
    is_changed : bool [hops]
        Whether the tones of the slot before do not go on.
    goes_on : bool [hops]
        Whether a hop confirms the word of the one before, if that was valid.
    """

    stream: FloatArray
    bits: BoolArray
    levels: FloatArray
    parts: SingleArray
    residual_hz: SingleArray
    is_clear: BoolArray
    is_changed: BoolArray
    goes_on: BoolArray


class TrackCodeReceiver(ReferenceTrackCodeReceiver):
    """`ReferenceTrackCodeReceiver` for long inputs: same parameters, same decisions, less work.

    The levels differ from those of `ReferenceTrackCodeReceiver` by about 1e-3, from the finite
    length of the filters. They do not depend, to the last bit, on the way the input is cut.
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
        freedom = len(self._estimator.whitener)
        worst_spread = float(np.max(self._estimator.spread / self._deviations))
        # One hop on, the tones of a word have turned.
        turn = np.exp(2j * math.pi * self.hop_samples / SLOT_RATE_HZ * np.array(profile.tones_hz))
        self._tables = (
            _single(np.pad(measure.T, ((0, -self._slot.size % SLOT_STEP), (0, 0)))),
            _real_rows(self._model),
            _real_rows(self._continued * turn),
            self._deviations,
            np.array(
                [
                    (profile.absent_max + profile.present_min) / 2,
                    profile.absent_max,
                    profile.present_min,
                    profile.present_max,
                    freedom * (MOST_NOISE / worst_spread) ** 2,
                    CHANGE_OVER_NOISE,
                    self._least_change_hz,
                ]
            ),
        )
        nothing = no_slot(profile, 0.0, "")
        self._nothing = nothing.bits, nothing.levels
        self._valid = False
        self._fields: Mapping[str, int] | None = None
        self._word_decoded = b""
        self._message: Mapping[str, int] | None = None

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
        demodulated, amplitude, faulty = self._fast_demodulator.demodulate(frames)
        slots = self._measured(np.concatenate([self._slot, demodulated.ravel()]), hops)
        faulty |= amplitude < self._least_amplitude
        slots.goes_on[faulty] = False
        decisions: list[Decision] = []

        def decide_until(stop: int) -> None:
            """Decide hop by hop up to `stop`, or until a word is valid."""
            for k in range(len(decisions), stop):
                if not faulty[k] and self._must_wait():
                    decisions.append(self._wait())
                    continue
                if faulty[k]:
                    decisions.append(self._begin_anew(input_fault(frames[k]) or "no carrier"))
                    continue
                decision = self._decide_slot(slots, k)
                decisions.append(decision)
                if decision.valid:
                    self._valid, self._fields = True, decision.fields
                    return

        for stop in [*np.flatnonzero(~slots.goes_on).tolist(), hops]:
            while len(decisions) < stop:
                if not self._valid:
                    decide_until(stop)
                else:
                    decisions += self._continued_decisions(slots, len(decisions), stop)
            # Here the word may end.
            decide_until(min(stop + 1, hops))
        self._slot = slots.stream[slots.stream.size - self._slot.size :].copy()
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

    def _begin_anew(self, fault: str) -> Decision:
        """Decision of a hop at fault."""
        self._valid = False
        self._hops += 1
        self._restart(-self.chain.settling_samples)
        return no_slot(self.profile, self.time_s, fault)

    def _decide_slot(self, slots: _Slots, k: int) -> Decision:
        """Decision of a hop with a full slot: what `_take` does, from what is known of it."""
        self._valid = False
        self._hops += 1
        self._fresh += self.hop_samples
        if self._word is not None:
            is_latest = self._word.sample == self._now - self.hop_samples
            self._slot = self._slot_of(slots, k)
            if slots.is_changed[k] if is_latest else self._change_noticed():
                self._restart(0)
                return no_slot(self.profile, self.time_s, "change noticed")
        bits = slots.bits[k]
        fields = self._decoded(bits) if slots.is_clear[k] else None
        if fields is None:
            self._slot = self._slot_of(slots, k)
            return self._decide()
        if not self._confirmation.confirm(bits):
            reason = self._confirmation.reason
            return Decision(self.time_s, bits, slots.levels[k], False, None, reason)
        self._put_in_force(slots, k)
        return Decision(self.time_s, bits, slots.levels[k], True, fields, "")

    def _slot_of(self, slots: _Slots, k: int) -> FloatArray:
        """The long slot at the end of hop `k` of a batch."""
        start = (k + 1) * self.hop_samples
        return slots.stream[start : start + self.profile.slot_samples]

    def _decoded(self, bits: BoolArray) -> Mapping[str, int] | None:
        """`decode` of the bits; those of the call before are not decoded again."""
        key = bits.tobytes()
        if key != self._word_decoded:
            self._word_decoded, self._message = key, decode(self.profile, bits)
        return self._message

    def _put_in_force(self, slots: _Slots, k: int) -> None:
        """Let the word of the slot at the end of hop `k`, which is the newest, be in force."""
        parts, tones = slots.parts[k], self.profile.tones
        amplitudes = parts[:tones] + 1j * parts[tones:]
        self._word = Word(amplitudes, self._now, float(slots.residual_hz[k]))

    def _measured(self, stream: FloatArray, hops: int) -> _Slots:
        """What the slots of a batch hold; the stream begins with the slot before them."""
        size, tones = 1 + hops, self.profile.tones
        bits, levels = np.empty((size, tones), dtype=np.bool_), np.empty((size, tones))
        parts = np.empty((size, 2 * tones), dtype=np.float32)
        residual_hz = np.empty(size, dtype=np.float32)
        is_clear, is_changed = np.empty(size, dtype=np.bool_), np.empty(size, dtype=np.bool_)
        single = np.zeros(stream.size + SLOT_STEP, dtype=np.float32)
        single[: stream.size] = stream
        measure_slots(
            single,
            self.hop_samples,
            *self._tables,
            bits,
            levels,
            parts,
            residual_hz,
            is_clear,
            is_changed,
        )
        goes_on = (bits[1:] == bits[:-1]).all(axis=1) & is_clear[1:] & ~is_changed[1:]
        return _Slots(
            stream,
            read_only(bits)[1:],
            read_only(levels)[1:],
            parts[1:],
            residual_hz[1:],
            is_clear[1:],
            is_changed[1:],
            goes_on,
        )

    def _continued_decisions(self, slots: _Slots, start: int, stop: int) -> list[Decision]:
        """Decisions from hop `start` to `stop`, in which the word in force goes on."""
        first = self._hops + 1
        self._hops += stop - start
        self._fresh += (stop - start) * self.hop_samples
        self._put_in_force(slots, stop - 1)
        times = np.arange(first, self._hops + 1) * self.hop_samples / SLOT_RATE_HZ
        # One row of bits does for all: they are the same.
        bits, levels = repeat(slots.bits[start]), slots.levels[start:stop]
        each = zip(times.tolist(), bits, levels, repeat(True), repeat(self._fields), repeat(""))
        # As `Decision._make`, without a call of Python for each.
        return list(map(tuple.__new__, repeat(Decision), each))


def _real_rows(waves: ComplexArray) -> SingleArray:
    """Map from real and imaginary parts of amplitudes to ``Re(waves @ amplitudes)``."""
    return _single(np.concatenate([waves.real, -waves.imag], axis=1).T)


def _single(array: FloatArray) -> SingleArray:
    return np.ascontiguousarray(array, dtype=np.float32)
