"""Root-raised-cosine pulses: their shape, a burst made of them, and the filter matched to it.

Both filters are polyphase: output after output of one phase, tap after tap, so that a compiled
loop runs over neighbouring outputs and no sum depends on how many bursts there are.
"""

from __future__ import annotations

import math

import numpy as np

from rail_signals.arrays import FloatArray
from rail_signals.compiled import compiled


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


@compiled
def shape_pulses(symbols: FloatArray, pulse: FloatArray, waves: FloatArray) -> None:
    """Add a pulse for every symbol to waves of zeros.

    Parameters
    ----------
    symbols : float64 [wave, 2 symbols]
        Real and imaginary parts alternating.
    pulse : float64 [2 span samples_per_symbol + 1]
    waves : float64 [wave, symbols + 2 span, samples_per_symbol, 2]
        Waves, one row per symbol time; result.
    """
    rows, steps = waves.shape[1], waves.shape[2]
    count = symbols.shape[1]
    total = np.empty(2 * rows)
    for wave in range(len(symbols)):
        symbol = symbols[wave]
        for phase in range(steps):
            total[:] = 0.0
            for late, tap in enumerate(pulse[phase::steps]):
                part = total[2 * late : 2 * late + count]
                for i in range(count):
                    part[i] += tap * symbol[i]
            for row in range(rows):
                waves[wave, row, phase, 0] = total[2 * row]
                waves[wave, row, phase, 1] = total[2 * row + 1]


@compiled
def matched_filter(waves: FloatArray, pulse: FloatArray, symbols: FloatArray) -> None:
    """Filter matched to the pulse, at the symbols.

    Parameters
    ----------
    waves : float64 [wave, symbols + 2 span, samples_per_symbol, 2]
        Received samples, real and imaginary parts, one row per symbol time.
    pulse : float64 [2 span samples_per_symbol + 1]
        Symmetric.
    symbols : float64 [wave, 2 symbols]
        Real and imaginary parts alternating; result.
    """
    rows, steps = waves.shape[1], waves.shape[2]
    count = symbols.shape[1]
    received = np.empty(2 * rows)
    for wave in range(len(waves)):
        total = symbols[wave]
        total[:] = 0.0
        for phase in range(steps):
            for row in range(rows):
                received[2 * row] = waves[wave, row, phase, 0]
                received[2 * row + 1] = waves[wave, row, phase, 1]
            for early, tap in enumerate(pulse[phase::steps]):
                part = received[2 * early : 2 * early + count]
                for i in range(count):
                    total[i] += tap * part[i]
