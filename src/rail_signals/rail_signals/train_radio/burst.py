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
from scipy.signal import upfirdn

from rail_signals.arrays import ComplexArray, FloatArray

from .pilot_estimation import PilotPattern, wiener_estimator
from .space_time_block import Scheme
from .symbol_mapping import BitArray, Constellation


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


def root_raised_cosine(rolloff: float, samples_per_symbol: int, span_symbols: int) -> FloatArray:
    """Root-raised-cosine pulse of unit energy, cut off at `span_symbols` to either side.

    Returns
    -------
    float64 [2 span_symbols samples_per_symbol + 1]

    Examples
    --------
    >>> pulse = root_raised_cosine(0.35, 4, 6)
    >>> len(pulse), round(float(pulse @ pulse), 12)
    (49, 1.0)
    """
    if not 0 < rolloff <= 1:
        raise ValueError(f"rolloff must lie above 0 and up to 1, got {rolloff!r}")
    if samples_per_symbol < 2:
        raise ValueError(f"samples_per_symbol must be 2 or more, got {samples_per_symbol!r}")
    if span_symbols < 1:
        raise ValueError(f"span_symbols must be 1 or more, got {span_symbols!r}")
    half_span = span_symbols * samples_per_symbol
    t = np.arange(-half_span, half_span + 1) / samples_per_symbol
    # The closed form is 0 / 0 at the middle and at a quarter of 1 / rolloff: limits there.
    pole = np.abs(np.abs(4 * rolloff * t) - 1) < 1e-9
    safe = np.where(pole | (t == 0), 0.123, t)
    pulse = np.sin(math.pi * safe * (1 - rolloff))
    pulse += 4 * rolloff * safe * np.cos(math.pi * safe * (1 + rolloff))
    pulse /= math.pi * safe * (1 - (4 * rolloff * safe) ** 2)
    pulse[t == 0] = 1 + rolloff * (4 / math.pi - 1)
    corner = math.pi / (4 * rolloff)
    edge = (1 + 2 / math.pi) * math.sin(corner) + (1 - 2 / math.pi) * math.cos(corner)
    pulse[pole] = rolloff / math.sqrt(2) * edge
    return np.asarray(pulse / math.sqrt(pulse @ pulse))


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

    @property
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
        room = self.pattern.data_symbols * self.constellation.bits_per_symbol
        fill = np.zeros((*values.shape[:-1], room - self.data_bits), dtype=values.dtype)
        symbols = self.constellation.modulate(np.concatenate([values, fill], axis=-1))
        burst = self.pattern.insert(self.scheme.encode(symbols))
        wave = np.zeros((*burst.shape[:-1], self.samples), dtype=np.complex128)
        if wave.size:
            shaped = upfirdn(self.pulse, burst, up=self.samples_per_symbol, axis=-1)
            wave[..., : shaped.shape[-1]] = shaped
        return wave

    def symbols_of(self, samples: ComplexArray) -> ComplexArray:
        """Matched filter, sampled at the symbols: complex128 [..., rx, symbols]."""
        if not samples.size:
            return np.zeros((*samples.shape[:-1], self.pattern.symbols), dtype=np.complex128)
        filtered = upfirdn(self.pulse, samples, down=self.samples_per_symbol, axis=-1)
        first = 2 * self.span_symbols
        return np.asarray(filtered[..., first : first + self.pattern.symbols])


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
        burst, plan, pattern = self.burst, self.burst.scheme, self.burst.pattern
        x = np.asarray(samples, dtype=np.complex128)
        if x.ndim < 2 or x.shape[-2:] != (plan.receive, burst.samples):
            raise ValueError(
                f"samples must be [..., {plan.receive}, {burst.samples}], got shape {x.shape}"
            )
        size = np.abs(x)
        # A comparison with NaN is false.
        sound = np.asarray((size < _LARGEST).all(axis=(-2, -1)) & (size > 0).any(axis=(-2, -1)))
        y = burst.symbols_of(np.where(sound[..., None, None], x, 0))
        pilots = y[..., pattern.pilot_positions]
        if channel is None:
            estimator = wiener_estimator(pattern, doppler_hz / burst.symbol_rate_hz)
            level = estimator.level(pilots)
            detected = sound & (level.evidence >= self._least_evidence)
            h = estimator.estimate(pilots, level.snr)
            noise = level.noise_variance
            error = estimator.error_variance(level.snr)[..., pattern.data_positions]
            excess = 1 + level.snr[..., None] * error.mean(axis=-2)
        else:
            h = np.asarray(channel, dtype=np.complex128)
            shape = (plan.receive, plan.transmit, pattern.symbols)
            if h.ndim < 3 or h.shape[-3:] != shape:
                raise ValueError(f"channel must be [..., {shape}], got shape {h.shape}")
            h = np.broadcast_to(h, (*x.shape[:-2], *shape))
            sent = np.sum(h[..., pattern.pilot_positions] * pattern.pilots, axis=-2)
            noise = np.mean(np.abs(pilots - sent) ** 2, axis=(-2, -1))
            detected = sound
            excess = np.ones((*x.shape[:-2], 1))
        data = pattern.data_positions
        symbols, gain = plan.combine(y[..., data], h[..., data])
        floor = np.maximum(noise, _LEAST_NOISE * np.mean(np.abs(y) ** 2, axis=(-2, -1)))
        snr = np.divide(
            gain, floor[..., None] * excess, out=np.zeros_like(gain), where=detected[..., None]
        )
        bits = burst.constellation.decide(symbols)[..., : burst.data_bits]
        return ReceivedBurst(
            bits=np.asarray(bits * detected[..., None], dtype=np.uint8),
            snr=snr,
            channel=h * detected[..., None, None, None],
            noise_variance=noise,
            detected=np.asarray(detected),
        )


_LARGEST = 1e100
"""Samples beyond it would overflow when squared."""

_LEAST_NOISE = 1e-9
"""Least fraction of the power that counts as noise, so that no SNR is infinite."""
