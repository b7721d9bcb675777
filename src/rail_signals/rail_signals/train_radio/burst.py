"""One burst of the train radio as a sampled waveform, and its receiver.

    bits -> symbols -> space-time code -> pilots inserted -> root-raised-cosine pulses

and back: matched filter, one sample per symbol, level and channel from the pilots, combining,
decisions. Symbol timing is taken as known, as is the carrier but for the Doppler of the train.

**Energy.** The pulse has unit energy over its samples and the symbols of both antennas together
unit mean energy. White noise of variance N0 per complex sample is therefore white noise of N0 per
symbol behind the matched filter, and with ``P = E|h|^2`` per pair of antennas

    Es/N0 = P / N0,    Eb/N0 = P / (N0 bits_per_symbol)     per receive branch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.arrays import ComplexArray, FloatArray

from .assembly import assemble_bursts
from .pilot_estimation import wiener_estimator
from .pilot_pattern import PilotPattern
from .pulse import matched_filter, root_raised_cosine, shape_pulses
from .reception import LARGEST, LEAST_NOISE, receive_bursts
from .space_time_block import Scheme
from .symbol_mapping import BitArray, Constellation, check_bits


def noise_variance(
    eb_n0_db: float,
    bits_per_symbol: int,
    *,
    channel_power: float = 1.0,
    pilot_fraction: float = 0.0,
) -> float:
    """Noise variance N0 per complex sample of each receive antenna for a given Eb/N0.

    Parameters
    ----------
    eb_n0_db
        Energy per bit over noise density, per receive branch [dB], total transmit power fixed.
    bits_per_symbol
        Bits per data symbol.
    channel_power
        Mean power P of the gain between two antennas.
    pilot_fraction
        0 if Eb counts the energy of data symbols alone, `PilotPattern.pilot_share` if the energy
        of the pilots is shared out among the bits.

    Examples
    --------
    >>> noise_variance(10.0, 2)
    0.05
    """
    if not math.isfinite(eb_n0_db):
        raise ValueError(f"eb_n0_db must be finite, got {eb_n0_db!r}")
    if bits_per_symbol < 1:
        raise ValueError(f"bits_per_symbol must be 1 or more, got {bits_per_symbol!r}")
    if not (math.isfinite(channel_power) and channel_power > 0):
        raise ValueError(f"channel_power must be finite and above zero, got {channel_power!r}")
    if not 0 <= pilot_fraction < 1:
        raise ValueError(f"pilot_share must lie from 0 to below 1, got {pilot_fraction!r}")
    energy_per_bit = channel_power / (bits_per_symbol * (1 - pilot_fraction))
    return float(energy_per_bit / 10 ** (eb_n0_db / 10))


@dataclass(frozen=True)
class RadioBurstFormat:
    """What a burst is made of, and its lengths.

    Parameters
    ----------
    scheme
        Antennas and space-time code.
    constellation
        Of the data; pilots are +-1.
    data_bits
        Bits carried; filled up with zeros to whole symbols and pairs.
    symbol_rate_hz
        Symbols per second [Hz].
    samples_per_symbol
        Complex samples per symbol.
    rolloff
        Roll-off of the root-raised-cosine pulse.
    span_symbols
        Symbols after which the pulse is cut off, to either side. With 6 and the roll-off of
        0.35 what neighbours leave on a symbol lies 50 dB below it.
    pilot_period, pilot_block
        See `PilotPattern`.

    Examples
    --------
    >>> from rail_signals.train_radio.space_time_block import scheme
    >>> from rail_signals.train_radio.symbol_mapping import constellation
    >>> burst = RadioBurstFormat(scheme("alamouti_2x2"), constellation("qpsk"), data_bits=200)
    >>> burst.pattern.data_symbols, burst.pattern.symbols, burst.samples, burst.duration_s
    (100, 118, 520, 0.0013)
    """

    scheme: Scheme
    constellation: Constellation
    data_bits: int
    symbol_rate_hz: float = 100e3
    samples_per_symbol: int = 4
    rolloff: float = 0.35
    span_symbols: int = 6
    pilot_period: int = 16
    pilot_block: int = 2

    def __post_init__(self) -> None:
        """Validate every field."""
        if self.data_bits < 1:
            raise ValueError(f"data_bits must be 1 or more, got {self.data_bits!r}")
        if not (math.isfinite(self.symbol_rate_hz) and self.symbol_rate_hz > 0):
            raise ValueError(
                f"symbol_rate_hz must be finite and above zero, got {self.symbol_rate_hz!r}"
            )
        _ = self.pattern, self.pulse

    @cached_property
    def pattern(self) -> PilotPattern:
        """Places of pilots and data."""
        block = self.constellation.bits_per_symbol * self.scheme.transmit
        symbols = -(-self.data_bits // block) * self.scheme.transmit
        return PilotPattern(symbols, self.scheme.transmit, self.pilot_period, self.pilot_block)

    @cached_property
    def pulse(self) -> FloatArray:
        """Pulse of unit energy, float64 [2 span samples_per_symbol + 1]."""
        return root_raised_cosine(self.rolloff, self.samples_per_symbol, self.span_symbols)

    @cached_property
    def rows(self) -> tuple[int, int, int]:
        """Shape of the parts of a wave, a row per symbol time [row, samples_per_symbol, 2]."""
        return self.pattern.symbols + 2 * self.span_symbols, self.samples_per_symbol, 2

    @cached_property
    def samples(self) -> int:
        """Samples of a burst, the tails of its pulses included."""
        return (self.pattern.symbols + 2 * self.span_symbols) * self.samples_per_symbol

    @property
    def sample_rate_hz(self) -> float:
        """Complex sample rate [Hz]."""
        return self.symbol_rate_hz * self.samples_per_symbol

    @property
    def duration_s(self) -> float:
        """Length of a burst [s]."""
        return self.samples / self.sample_rate_hz

    @cached_property
    def symbol_samples(self) -> NDArray[np.intp]:
        """Sample at the middle of each symbol, intp [symbols]."""
        middle = np.arange(self.pattern.symbols) + self.span_symbols
        return np.asarray(middle * self.samples_per_symbol)

    def transmit(self, bits: ArrayLike) -> ComplexArray:
        """Waveform of a burst.

        Parameters
        ----------
        bits : uint8 or bool [..., data_bits]

        Returns
        -------
        complex128 [..., tx, samples]

        Raises
        ------
        ValueError
            If the shape or a bit is wrong.
        """
        values = np.asarray(bits)
        if values.ndim == 0 or values.shape[-1] != self.data_bits:
            raise ValueError(f"bits must be [..., {self.data_bits}], got shape {values.shape}")
        rows = check_bits(values).reshape(-1, self.data_bits)
        burst = np.empty(
            (len(rows), self.scheme.transmit, self.pattern.symbols), dtype=np.complex128
        )
        assemble_bursts(
            rows,
            self.constellation.points,
            self.constellation.bits_per_symbol,
            self.pattern.data_positions,
            self.pattern.pilot_positions,
            self.pattern.pilots,
            burst,
        )
        wave = np.empty(
            (*values.shape[:-1], self.scheme.transmit, self.samples), dtype=np.complex128
        )
        shape_pulses(_parts(burst), self.pulse, self._rows(wave))
        return wave

    def symbols_of(self, samples: ComplexArray) -> ComplexArray:
        """Matched filter, sampled at the symbols.

        Parameters
        ----------
        samples : complex [..., samples]

        Returns
        -------
        complex128 [..., symbols]
        """
        x = np.ascontiguousarray(samples, dtype=np.complex128)
        symbols = np.empty((*x.shape[:-1], self.pattern.symbols), dtype=np.complex128)
        matched_filter(self._rows(x), self.pulse, _parts(symbols))
        return symbols

    def _rows(self, waves: ComplexArray) -> FloatArray:
        """Parts of waves, a row per symbol time: a view [wave, row, samples_per_symbol, 2]."""
        return _parts(waves).reshape(-1, *self.rows)


@dataclass(frozen=True)
class ReceivedBurst:
    """What a receiver made of each burst. Leading axes are those of the samples.

    Where no carrier was detected bits, snr and channel are zero: look at `detected` first.

    Attributes
    ----------
    bits : uint8 [..., data_bits]
    snr : float64 [..., data_symbols]
        Estimated Es/N0 of each data symbol behind the combining (linear), the error of the
        channel estimate counted as noise.
    channel : complex128 [..., rx, tx, symbols]
        Gains used, at pilots and data.
    noise_variance : float64 [...]
        Estimated noise variance per symbol and receive antenna.
    detected : bool [...]
        Whether the pilots are there.
    """

    bits: BitArray
    snr: FloatArray
    channel: ComplexArray
    noise_variance: FloatArray
    detected: NDArray[np.bool_]


class RadioBurstReceiver:
    """Receiver of bursts of one format.

    Parameters
    ----------
    burst
        The format.
    false_alarm
        Bound on the probability that noise alone counts as a burst; 1 takes whatever comes.

    Examples
    --------
    >>> from rail_signals.train_radio.space_time_block import scheme
    >>> from rail_signals.train_radio.symbol_mapping import constellation
    >>> burst = RadioBurstFormat(scheme("mrc"), constellation("bpsk"), data_bits=4)
    >>> wave = burst.transmit([1, 0, 0, 1])
    >>> found = RadioBurstReceiver(burst).receive([[0.1], [0.2j]] * wave)
    >>> found.bits.tolist(), bool(found.detected)
    ([1, 0, 0, 1], True)
    """

    def __init__(self, burst: RadioBurstFormat, *, false_alarm: float = 1e-4) -> None:
        if not 0 < false_alarm <= 1:
            raise ValueError(f"false_alarm must lie above 0 and up to 1, got {false_alarm!r}")
        self.burst = burst
        self._least_evidence = -math.log(false_alarm)

    def receive(
        self, samples: ArrayLike, *, doppler_hz: float = 0.0, channel: ArrayLike | None = None
    ) -> ReceivedBurst:
        """Receive bursts.

        Parameters
        ----------
        samples : complex [..., rx, samples]
            Received waves, the first sample being that of the transmitter. Bursts that are zero
            or not finite on any antenna count as not detected.
        doppler_hz
            Largest Doppler shift to follow [Hz].
        channel : complex [..., rx, tx, symbols], optional
            The channel at each symbol, if it is known: nothing is estimated but the noise, and
            every burst that is not zero counts as detected.

        Raises
        ------
        ValueError
            If a shape is wrong or the Doppler out of range.
        """
        burst, plan = self.burst, self.burst.scheme
        x = np.ascontiguousarray(samples, dtype=np.complex128)
        if x.ndim < 2 or x.shape[-2:] != (plan.receive, burst.samples):
            raise ValueError(
                f"samples must be [..., {plan.receive}, {burst.samples}], got shape {x.shape}"
            )
        if channel is None:
            return self._receive(x, doppler_hz)
        return self._receive_through(x, np.asarray(channel, dtype=np.complex128))

    def _receive(self, x: ComplexArray, doppler_hz: float) -> ReceivedBurst:
        """Receive bursts through a channel that their pilots tell."""
        burst, plan, pattern = self.burst, self.burst.scheme, self.burst.pattern
        estimator = wiener_estimator(pattern, doppler_hz / burst.symbol_rate_hz)
        parts = _whole(x)
        count = len(parts)
        bits = np.zeros((count, burst.data_bits), dtype=np.uint8)
        snr = np.zeros((count, pattern.data_symbols))
        h = np.zeros((count, plan.receive, plan.transmit, pattern.symbols), dtype=np.complex128)
        noise, detected = np.zeros(count), np.zeros(count, dtype=np.bool_)
        receive_bursts(
            parts,
            parts.reshape(count, plan.receive, *burst.rows),
            burst.pulse,
            pattern.pilot_positions,
            pattern.data_positions,
            burst.constellation.bits_per_symbol,
            self._least_evidence,
            *estimator.tables,
            bits,
            snr,
            h,
            h.view(np.float64).reshape(count, plan.receive, 2 * plan.transmit * pattern.symbols),
            noise,
            detected,
        )
        lead = x.shape[:-2]
        return ReceivedBurst(
            bits.reshape(*lead, burst.data_bits),
            snr.reshape(*lead, pattern.data_symbols),
            h.reshape(*lead, *h.shape[1:]),
            noise.reshape(lead),
            detected.reshape(lead),
        )

    def _receive_through(self, x: ComplexArray, h: ComplexArray) -> ReceivedBurst:
        """Receive bursts through a known channel."""
        burst, plan, pattern = self.burst, self.burst.scheme, self.burst.pattern
        shape = (plan.receive, plan.transmit, pattern.symbols)
        if h.ndim < 3 or h.shape[-3:] != shape:
            raise ValueError(f"channel must be [..., {shape}], got shape {h.shape}")
        h = np.broadcast_to(h, (*x.shape[:-2], *shape))
        parts = _whole(x)
        usable = (np.abs(parts) < LARGEST).all(axis=-1) & parts.any(axis=-1)
        detected = np.asarray(usable.reshape(x.shape[:-2]))
        y = burst.symbols_of(np.where(detected[..., None, None], x, 0))
        sent = np.sum(h[..., pattern.pilot_positions] * pattern.pilots, axis=-2)
        left = np.abs(y[..., pattern.pilot_positions] - sent) ** 2
        noise = np.asarray(np.mean(left, axis=(-2, -1)))
        # Pilots too: blocks of the code stand in one piece, and all of them are cheaper than some.
        symbols, gain = plan.combine(y, h)
        floor = np.maximum(noise, LEAST_NOISE * np.mean(np.abs(y) ** 2, axis=(-2, -1)))
        snr = np.zeros_like(gain)
        np.divide(gain, floor[..., None], out=snr, where=detected[..., None])
        data = pattern.data_positions
        bits = burst.constellation.decide(symbols[..., data])[..., : burst.data_bits]
        return ReceivedBurst(
            bits=np.asarray(bits * detected[..., None], dtype=np.uint8),
            snr=snr[..., data],
            channel=h * detected[..., None, None, None],
            noise_variance=noise,
            detected=detected,
        )


def _whole(values: ComplexArray) -> FloatArray:
    """Parts of each burst [..., rx, n]: a view [burst, 2 rx n]."""
    return values.view(np.float64).reshape(-1, 2 * values.shape[-2] * values.shape[-1])


def _parts(values: ComplexArray) -> FloatArray:
    """Real and imaginary parts alternating: a view [rows, 2 columns]."""
    return values.view(np.float64).reshape(-1, 2 * values.shape[-1])
