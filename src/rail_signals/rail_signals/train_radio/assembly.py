"""Compiled assembly of bursts: from bits to the symbols of every antenna, pilots among them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.compiled import compiled

from .space_time_block import _encoded
from .symbol_mapping import BitArray


@compiled
def assemble_bursts(
    bits: BitArray,
    points: ComplexArray,
    bits_per_symbol: int,
    data: NDArray[np.intp],
    pilots: NDArray[np.intp],
    pilot_values: FloatArray,
    bursts: ComplexArray,
) -> None:
    """Symbols of bursts.

    Parameters
    ----------
    bits : uint8 [burst, bit]
        Zeros and ones; zeros fill up the last symbols.
    points, bits_per_symbol
        Of a `Constellation`.
    data, pilots : intp
        Places of data and pilots in a burst.
    pilot_values : float64 [tx, pilot]
    bursts : complex128 [burst, tx, symbol]
        Result.
    """
    antennas, count = bursts.shape[1], len(data)
    symbols = np.empty((1, count), dtype=np.complex128)
    coded = np.empty((1, 2, count), dtype=np.complex128)
    for burst in range(len(bits)):
        for i in range(count):
            label = 0
            for bit in range(i * bits_per_symbol, (i + 1) * bits_per_symbol):
                label *= 2
                if bit < bits.shape[1]:
                    label += bits[burst, bit]
            symbols[0, i] = points[label]
        if antennas == 1:
            coded[0, 0] = symbols[0]
        else:
            _encoded(symbols, coded)
        for antenna in range(antennas):
            sent = bursts[burst, antenna]
            for i in range(count):
                sent[data[i]] = coded[0, antenna, i]
            for i in range(len(pilots)):
                sent[pilots[i]] = pilot_values[antenna, i]
