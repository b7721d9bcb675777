"""Bits to points of the complex plane and back: BPSK, QPSK and 16-QAM with Gray labels.

All constellations have unit mean energy, so that Es/N0 is one over the noise variance. The bits of
a symbol alternate between the real and the imaginary axis; the first on an axis is its sign (0 is
positive), the second its size (0 is small). Neighbours differ in one bit:

======  ===============  =======================================================
name    bits per symbol  point
======  ===============  =======================================================
bpsk    1                ``1 - 2 b0``
qpsk    2                ``(1 - 2 b0 + j (1 - 2 b1)) / sqrt(2)``
16qam   4                ``((1 - 2 b0)(1 + 2 b2) + j (1 - 2 b1)(1 + 2 b3)) / sqrt(10)``
======  ===============  =======================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.arrays import ComplexArray, FloatArray

BitArray: TypeAlias = NDArray[np.uint8]


@dataclass(frozen=True)
class Constellation:
    """A Gray-labelled constellation of unit mean energy; take one from :func:`constellation`.

    Attributes
    ----------
    name
        Key of :func:`constellation`.
    bits_per_symbol
        1, 2 or 4.

    Examples
    --------
    >>> qpsk = constellation("qpsk")
    >>> symbols = qpsk.modulate([0, 0, 1, 0])
    >>> (symbols * 2**0.5).round(12).tolist(), qpsk.decide(symbols).tolist()
    ([(1+1j), (-1+1j)], [0, 0, 1, 0])
    """

    name: str
    bits_per_symbol: int

    @cached_property
    def points(self) -> ComplexArray:
        """Points complex128 [2 ** bits_per_symbol]; the first bit of a label weighs most."""
        labels = np.arange(1 << self.bits_per_symbol)
        weights = np.arange(self.bits_per_symbol - 1, -1, -1)
        bits = (labels[:, None] >> weights) & 1
        return np.asarray(self._axis(bits[:, 0::2]) + 1j * self._axis(bits[:, 1::2]))

    def modulate(self, bits: ArrayLike) -> ComplexArray:
        """Map bits to symbols.

        Parameters
        ----------
        bits : uint8 or bool [..., n bits_per_symbol]
            Zeros and ones.

        Returns
        -------
        complex128 [..., n]

        Raises
        ------
        ValueError
            If the last axis is not whole symbols or a bit is neither 0 nor 1.
        """
        values = np.asarray(bits)
        if values.ndim == 0 or values.shape[-1] % self.bits_per_symbol:
            raise ValueError(
                f"bits must have whole symbols of {self.bits_per_symbol} on their last axis,"
                f" got shape {values.shape}"
            )
        count = values.shape[-1] // self.bits_per_symbol
        groups = check_bits(values).reshape(*values.shape[:-1], count, self.bits_per_symbol)
        labels = groups[..., 0]
        for i in range(1, self.bits_per_symbol):
            labels = 2 * labels + groups[..., i]
        return np.asarray(self.points[labels])

    def decide(self, symbols: ArrayLike) -> BitArray:
        """Labels of the points nearest to `symbols`.

        BPSK looks at the real part alone. What lies on a border, and NaN, counts as 0.

        Parameters
        ----------
        symbols : complex [..., n]

        Returns
        -------
        uint8 [..., n bits_per_symbol]
        """
        z = np.asarray(symbols, dtype=np.complex128)
        if z.ndim == 0:
            raise ValueError(f"symbols must have an axis, got shape {z.shape}")
        width = self.bits_per_symbol
        # [..., axis], the axes that carry bits.
        parts = np.ascontiguousarray(z).view(np.float64).reshape(*z.shape, 2)[..., : min(width, 2)]
        out = np.empty((*z.shape, width), dtype=np.bool_)
        np.less(parts, 0, out=out[..., :2])
        if width == 4:
            np.greater(np.abs(parts), 2 / math.sqrt(10), out=out[..., 2:])
        return out.view(np.uint8).reshape(*z.shape[:-1], z.shape[-1] * width)

    def _axis(self, bits: NDArray[np.int_]) -> FloatArray:
        """Coordinate [points] of the bits [points, 0, 1 or 2] of one axis."""
        if bits.shape[1] == 0:
            return np.zeros(len(bits))
        energy = {1: 1, 2: 2, 4: 10}[self.bits_per_symbol]
        sized = (1.0 - 2 * bits[:, 0]) / math.sqrt(energy)
        return np.asarray(sized * (1 + 2 * bits[:, 1]) if bits.shape[1] == 2 else sized)


def check_bits(values: NDArray[Any]) -> BitArray:
    """The same as uint8.

    Raises
    ------
    ValueError
        If a value is neither 0 nor 1.
    """
    if values.dtype == np.uint8:
        sound = not values.size or values.max() <= 1
    else:
        sound = values.dtype == np.bool_ or bool(((values == 0) | (values == 1)).all())
    if not sound:
        wrong = values[(values != 0) & (values != 1)]
        raise ValueError(f"bits must be 0 or 1, got {wrong.flat[0]!r}")
    return np.ascontiguousarray(values, dtype=np.uint8)


_CONSTELLATIONS: Final = {
    c.name: c
    for c in (Constellation("bpsk", 1), Constellation("qpsk", 2), Constellation("16qam", 4))
}


def constellation(name: str) -> Constellation:
    """Look a constellation up: "bpsk", "qpsk" or "16qam".

    Raises
    ------
    ValueError
        If there is none of that name; the message quotes it.

    Examples
    --------
    >>> constellation("16qam").bits_per_symbol
    4
    """
    try:
        return _CONSTELLATIONS[name]
    except (KeyError, TypeError):
        known = ", ".join(_CONSTELLATIONS)
        raise ValueError(f"name must be one of {known}, got {name!r}") from None
