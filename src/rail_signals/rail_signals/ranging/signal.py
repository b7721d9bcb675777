"""The ranging signal: one or two tones, frequency-modulated on one carrier.

Symbols, used throughout the phase-ranging modules:

====================  ==========================================================
``f_i``               frequency of ranging tone i [Hz]; 375 kHz in the source
``beta_i``            FM index of tone i: peak deviation / tone frequency [rad]
``theta_i``           phase lag of tone i [rad]; grows with delay: 2 pi f_i tau
``fs``, ``N``         complex sample rate [Hz], samples in one burst
``P``                 period [samples]: smallest count with whole periods of all tones
``gamma``             carrier-to-noise ratio per complex sample (linear)
====================  ==========================================================

A wayside station sends ``exp(j sum_i beta_i sin(2 pi f_i t))``; whoever receives it
finds each tone delayed in phase (Jeong et al., eqs 7-10).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import jv

from rail_signals.arrays import ComplexArray, FloatArray

ALIASED_POWER_LIMIT = 1e-8
"""Largest fraction of the FM power that may lie past the Nyquist frequency."""

_MAX_ORDER = 40


@dataclass(frozen=True)
class RangingSignal:
    """Tones, deviations and burst length of a ranging transmission.

    Parameters
    ----------
    tones_hz
        One or two tone frequencies [Hz], highest first.
    deviations_hz
        Peak frequency deviation of each tone [Hz].
    sample_rate_hz
        Complex sample rate [Hz].
    samples
        Samples in one burst; must hold whole periods of every tone.

    Raises
    ------
    ValueError
        If a field is out of range; the message names the field and quotes the value.

    Examples
    --------
    >>> RangingSignal().period_samples, RangingSignal().indices
    (32, (1.0,))
    >>> RangingSignal(samples=1000)
    Traceback (most recent call last):
    ...
    ValueError: samples must be a multiple of 32 (whole periods of every tone), got 1000
    """

    tones_hz: tuple[float, ...] = (375e3,)
    deviations_hz: tuple[float, ...] = (375e3,)
    sample_rate_hz: float = 4e6
    samples: int = 960

    def __post_init__(self) -> None:
        """Coerce sequences to tuples and validate every field."""
        object.__setattr__(self, "tones_hz", tuple(float(f) for f in self.tones_hz))
        object.__setattr__(self, "deviations_hz", tuple(float(d) for d in self.deviations_hz))
        _require_positive("sample_rate_hz", self.sample_rate_hz)
        if len(self.tones_hz) not in (1, 2):
            raise ValueError(f"tones_hz must hold one or two tones, got {self.tones_hz}")
        if len(self.deviations_hz) != len(self.tones_hz):
            raise ValueError(
                f"deviations_hz must hold one value per tone ({len(self.tones_hz)}),"
                f" got {self.deviations_hz}"
            )
        for tone, deviation in zip(self.tones_hz, self.deviations_hz, strict=True):
            _require_positive("tones_hz", tone)
            _require_positive("deviations_hz", deviation)
        if list(self.tones_hz) != sorted(set(self.tones_hz), reverse=True):
            raise ValueError(f"tones_hz must fall from the highest, got {self.tones_hz}")
        if isinstance(self.samples, bool) or self.samples != int(self.samples) or self.samples < 1:
            raise ValueError(f"samples must be a positive integer, got {self.samples!r}")
        object.__setattr__(self, "samples", int(self.samples))
        period = self.period_samples
        if self.samples % period:
            raise ValueError(
                f"samples must be a multiple of {period} (whole periods of every tone),"
                f" got {self.samples}"
            )
        if max(self.indices) > _MAX_ORDER / 2:
            raise ValueError(
                f"deviations_hz must stay below {_MAX_ORDER // 2} times the tone,"
                f" got {self.deviations_hz}"
            )
        aliased = self._aliased_power()
        if aliased > ALIASED_POWER_LIMIT:
            raise ValueError(
                f"sample_rate_hz must carry the FM spectrum of deviations_hz {self.deviations_hz}:"
                f" {aliased:.1e} of the power would alias, got {self.sample_rate_hz}"
            )

    @cached_property
    def indices(self) -> tuple[float, ...]:
        """FM index beta of each tone [rad]."""
        return tuple(d / f for d, f in zip(self.deviations_hz, self.tones_hz, strict=True))

    @property
    def duration_s(self) -> float:
        """Length of one burst [s]."""
        return self.samples / self.sample_rate_hz

    @cached_property
    def period_samples(self) -> int:
        """Smallest number of samples with whole periods of every tone."""
        for period in range(1, self.samples + 1):
            cycles = [f * period / self.sample_rate_hz for f in self.tones_hz]
            if all(c > 0.5 and abs(c - round(c)) < 1e-9 * max(c, 1.0) for c in cycles):
                return period
        raise ValueError(
            f"samples must hold whole periods of tones_hz {self.tones_hz}"
            f" at sample_rate_hz {self.sample_rate_hz}, got {self.samples}"
        )

    @cached_property
    def cycles_per_period(self) -> tuple[int, ...]:
        """Whole cycles of each tone in `period_samples`."""
        return tuple(round(f * self.period_samples / self.sample_rate_hz) for f in self.tones_hz)

    def _aliased_power(self) -> float:
        """Fraction of the power in Bessel components at or past the Nyquist frequency."""
        order = np.arange(-_MAX_ORDER, _MAX_ORDER + 1)
        frequency = np.zeros(1)
        power = np.ones(1)
        for f, beta in zip(self.tones_hz, self.indices, strict=True):
            frequency = (frequency[:, None] + f * order).ravel()
            components = np.asarray(jv(order, beta), dtype=np.float64)
            power = (power[:, None] * components**2).ravel()
        return float(power[np.abs(frequency) >= self.sample_rate_hz / 2].sum())


def modulate(signal: RangingSignal, phase_lag_rad: ArrayLike) -> ComplexArray:
    """Synthesise unit-amplitude FM bursts whose tones lag by the given phases.

    Implements ``exp(j sum_i beta_i sin(2 pi f_i t_n - theta_i))`` with ``t_n = n / fs``
    (the modulator of Jeong et al., section 2.1). One period is computed and repeated.

    Parameters
    ----------
    signal
        Tones, indices and sampling.
    phase_lag_rad : [..., tones]
        Phase lag of each tone [rad].

    Returns
    -------
    complex128 [..., samples]
        Complex envelope.

    Examples
    --------
    >>> burst = modulate(RangingSignal(), [0.5])
    >>> burst.shape, bool(np.allclose(abs(burst), 1.0))
    ((960,), True)
    """
    lag = np.asarray(phase_lag_rad, dtype=np.float64)
    tones = len(signal.tones_hz)
    if lag.ndim == 0 or lag.shape[-1] != tones:
        raise ValueError(f"phase_lag_rad must have {tones} tones last, got shape {lag.shape}")
    period = signal.period_samples
    sample = np.arange(period)
    phase = np.zeros((*lag.shape[:-1], period))
    for i, (cycles, beta) in enumerate(zip(signal.cycles_per_period, signal.indices, strict=True)):
        # The integer remainder keeps the argument exact over the whole period.
        turn = (2 * math.pi / period) * ((cycles * sample) % period)
        phase += beta * np.sin(turn - lag[..., i, None])
    one = np.empty(phase.shape, dtype=np.complex128)
    np.cos(phase, out=one.real)
    np.sin(phase, out=one.imag)
    repeats = signal.samples // period
    out = np.empty((*lag.shape[:-1], repeats, period), dtype=np.complex128)
    out[...] = one[..., None, :]
    return out.reshape(*lag.shape[:-1], signal.samples)


def discriminate(signal: RangingSignal, bursts: ArrayLike) -> FloatArray:
    """Demodulate FM by the classical discriminator: the phase step of each sample.

    The source's receiver. It has the FM threshold: below about 10 dB of
    carrier-to-noise ratio per sample its error leaves the bound (see `FmToneReceiver`).

    Parameters
    ----------
    signal
        Sampling of the bursts.
    bursts : complex [..., samples]
        Received complex envelope.

    Returns
    -------
    float64 [..., samples]
        Instantaneous frequency [Hz], averaged over the sample interval that ends at
        each sample (half a sample late). The first sample has no predecessor: the value
        one period later, where a steady signal is the same, stands in for it.
    """
    x = _as_bursts(signal, bursts)
    out = np.empty(x.shape, dtype=np.float64)
    step = x[..., 1:] * np.conj(x[..., :-1])
    np.arctan2(step.imag, step.real, out=out[..., 1:])
    period = signal.period_samples
    if period < signal.samples:
        out[..., 0] = out[..., period]
    else:
        out[..., 0] = np.angle(x[..., 0] * np.conj(x[..., -1]))
    out *= signal.sample_rate_hz / (2 * math.pi)
    return out


def tone_of(signal: RangingSignal, demodulated: ArrayLike, tone: int = 0) -> FloatArray:
    """Phase lag of one tone in the waveform of `discriminate`, by correlation.

    The half sample by which the discriminator is late is removed.

    Parameters
    ----------
    signal
        Tones and sampling.
    demodulated : float [..., samples]
        Demodulated waveform [Hz].
    tone
        Index into ``signal.tones_hz``.

    Returns
    -------
    float64 [...]
        Phase lag [rad] in [0, 2 pi).

    Examples
    --------
    >>> signal = RangingSignal()
    >>> round(float(tone_of(signal, discriminate(signal, modulate(signal, [0.5])))), 9)
    0.5
    """
    wave = np.asarray(demodulated, dtype=np.float64)
    if wave.ndim == 0 or wave.shape[-1] != signal.samples:
        raise ValueError(f"demodulated must have {signal.samples} samples, got shape {wave.shape}")
    period = signal.period_samples
    folded = wave.reshape(*wave.shape[:-1], -1, period).sum(axis=-2)
    # FM: frequency = deviation * cos(2 pi f t - lag), so the correlation turns by -lag.
    turn = (2 * math.pi / period) * signal.cycles_per_period[tone] * (np.arange(period) - 0.5)
    in_phase = (folded * np.cos(turn)).sum(axis=-1)
    quadrature = (folded * np.sin(turn)).sum(axis=-1)
    return wrap_to_turn(np.arctan2(quadrature, in_phase))


def wrap_to_turn(phase_rad: ArrayLike) -> FloatArray:
    """Phase [rad] wrapped to [0, 2 pi), never 2 pi itself.

    Examples
    --------
    >>> wrap_to_turn([-1e-20, 7.0]).round(4).tolist()
    [0.0, 0.7168]
    """
    phase = np.asarray(phase_rad, dtype=np.float64)
    wrapped = phase - 2 * math.pi * np.floor(phase / (2 * math.pi))
    return np.asarray(np.where(wrapped >= 2 * math.pi, 0.0, wrapped), dtype=np.float64)


def _as_bursts(signal: RangingSignal, bursts: ArrayLike) -> ComplexArray:
    """Bursts as complex128 [..., samples], or a ValueError that quotes the shape."""
    x = np.asarray(bursts, dtype=np.complex128)
    if x.ndim == 0 or x.shape[-1] != signal.samples:
        raise ValueError(f"bursts must have {signal.samples} samples, got shape {x.shape}")
    return x


def _require_positive(name: str, value: float) -> None:
    """Reject what is not a finite number above zero."""
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{name} must be finite and above zero, got {value!r}")
