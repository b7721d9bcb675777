"""Compiled reception of bursts: from samples to decisions, burst after burst.

The same steps as one by one in `burst`, `pilot_estimation` and `space_time_block`, without the
calls and the arrays between them, and without those that a burst does not need: one that holds
nothing but noise is left alone once its pilots have told so.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import BoolArray, ComplexArray, FloatArray
from rail_signals.compiled import compiled

from .pilot_estimation import EstimatorTables, _channels, _levels
from .pulse import matched_filter
from .space_time_block import _combined
from .symbol_mapping import BitArray

LARGEST = 1e100
"""Samples beyond it would overflow when squared."""

LEAST_NOISE = 1e-9
"""Least fraction of the power that counts as noise, so that no SNR is infinite."""

_LARGE = 2 / math.sqrt(10)


@compiled
def receive_bursts(
    parts: FloatArray,
    waves: FloatArray,
    pulse: FloatArray,
    pilots: NDArray[np.intp],
    data: NDArray[np.intp],
    bits_per_symbol: int,
    least_evidence: float,
    estimator: EstimatorTables,
    mean_errors: FloatArray,
    bits: BitArray,
    snr: FloatArray,
    channel: ComplexArray,
    channel_parts: FloatArray,
    noise: FloatArray,
    detected: BoolArray,
) -> None:
    """Receive bursts.

    Parameters
    ----------
    parts : float64 [burst, parts of samples]
        Received samples of all antennas.
    waves : float64 [burst, rx, row, samples_per_symbol, 2]
        The same, a row per symbol time.
    pulse : float64
        See `matched_filter`.
    pilots, data : intp
        Places of the pilots and of the data symbols in a burst.
    bits_per_symbol, least_evidence
        Of the constellation; log-likelihood ratio from which a burst is there.
    estimator : EstimatorTables
    mean_errors : float64 [level, symbol]
        Mean error variance of the estimator.
    bits, snr, channel, noise, detected
        As of `ReceivedBurst`; result, given as zeros.
    channel_parts : float64 [burst, rx, 2 tx symbols]
        The memory of `channel`.
    """
    levels, values, vectors, shrink, penalty, rows = estimator
    bursts, antennas = waves.shape[0], waves.shape[1]
    symbols, count = channel.shape[3], len(pilots)
    y = np.empty((1, antennas, symbols), dtype=np.complex128)
    filtered = np.empty((antennas, 2 * symbols))
    known, weight = np.empty((1, antennas, 2 * count)), np.empty((1, count))
    step, level = np.empty(1, dtype=np.intp), np.empty((2, 1))
    found = np.empty((1, symbols), dtype=np.complex128)
    gain = np.empty((1, symbols))
    for burst in range(bursts):
        if not _sound(parts[burst]):
            continue
        matched_filter(waves[burst], pulse, filtered)
        for antenna in range(antennas):
            for i in range(count):
                known[0, antenna, 2 * i] = filtered[antenna, 2 * pilots[i]]
                known[0, antenna, 2 * i + 1] = filtered[antenna, 2 * pilots[i] + 1]
        _levels(known, vectors, shrink, penalty, step, level)
        noise[burst] = level[0, 0]
        if not level[1, 0] >= least_evidence:
            continue
        detected[burst] = True
        ratio = levels[step[0]]
        for k in range(count):
            weight[0, k] = ratio / (ratio * values[k] + 1)
        _channels(known, weight, vectors, rows, channel_parts[burst : burst + 1])
        power = 0.0
        for antenna in range(antennas):
            for i in range(symbols):
                real, imag = filtered[antenna, 2 * i], filtered[antenna, 2 * i + 1]
                power += real * real + imag * imag
                y[0, antenna, i] = complex(real, imag)
        power /= antennas * symbols
        _combined(y, channel[burst : burst + 1], found, gain)
        floor = max(noise[burst], LEAST_NOISE * power)
        for i in range(len(data)):
            at = data[i]
            snr[burst, i] = gain[0, at] / (floor * (1 + ratio * mean_errors[step[0], at]))
        _decide(found[0], data, bits_per_symbol, bits[burst])


@compiled
def _sound(parts: FloatArray) -> bool:
    """Whether a burst can be worked with: finite, not too large, and not zero altogether."""
    fit, some = 0, 0
    for value in parts:
        # A comparison with NaN is false.
        fit += abs(value) < LARGEST
        some += value != 0.0
    return fit == len(parts) and some > 0


@compiled
def _decide(
    symbols: ComplexArray, data: NDArray[np.intp], bits_per_symbol: int, bits: BitArray
) -> None:
    """Bits of the points nearest to the data symbols, as `Constellation.decide`."""
    for bit in range(len(bits)):
        symbol = symbols[data[bit // bits_per_symbol]]
        which = bit % bits_per_symbol
        part = symbol.imag if which % 2 else symbol.real
        bits[bit] = abs(part) > _LARGE if which >= 2 else part < 0.0
