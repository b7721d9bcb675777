"""Plain simulation of code blocks, as the equations are written; also for 16-QAM.

The slow and obvious counterpart of `rail_signals.train_radio.ber.link`: complex128, NumPy's own
normal deviates, one array per symbol of An, Kim and Jeong's eqs 1-9 (corrected: the sign of eq 4,
the terms of eq 6 and the divisor of eq 9).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.random import BitGenerator, Generator
from numpy.typing import NDArray

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.train_radio.space_time_block import Scheme


class PlainLink:
    """A scheme at one signal-to-noise ratio; `step` simulates some code blocks.

    Parameters
    ----------
    bits_per_symbol
        1 (BPSK), 2 (Gray QPSK) or 4 (Gray 16-QAM).
    scheme, eb_n0, code_blocks
        As of :class:`rail_signals.train_radio.ber.link.DiversityLink`.

    Examples
    --------
    >>> from rail_signals.train_radio.ber.closed_form import ALAMOUTI_2X2
    >>> PlainLink(ALAMOUTI_2X2, math.inf, bits_per_symbol=4).step(np.random.PCG64(1))
    (0, 0)
    """

    def __init__(
        self, scheme: Scheme, eb_n0: float, *, bits_per_symbol: int = 2, code_blocks: int = 4096
    ) -> None:
        if not eb_n0 > 0:
            raise ValueError(f"eb_n0 must be positive, got {eb_n0!r}")
        if bits_per_symbol not in (1, 2, 4):
            raise ValueError(f"bits_per_symbol must be 1, 2 or 4, got {bits_per_symbol!r}")
        self.scheme = scheme
        self.bits_per_symbol = bits_per_symbol
        self.bits_per_step = 2 * bits_per_symbol * code_blocks
        self._blocks = code_blocks
        # Energy of a symbol with levels +-1 (and +-3) in each of its parts.
        energy = {1: 1.0, 2: 2.0, 4: 10.0}[bits_per_symbol]
        noise = energy / bits_per_symbol * scheme.transmit / eb_n0
        self._sigma = math.sqrt(noise / 2)

    def step(self, generator: BitGenerator) -> tuple[int, int]:
        """Wrong bits, and the sum over code blocks of the square of their number."""
        rng = Generator(generator)
        rx, tx, n = self.scheme.receive, self.scheme.transmit, self._blocks
        bits = rng.integers(0, 2, (self.bits_per_symbol, 2, n), dtype=np.uint8)
        x1, x2 = self._modulate(bits)
        h = _normal(rng, tx, rx, n) * math.sqrt(0.5)
        z1, z2 = _normal(rng, 2, rx, n) * self._sigma
        if tx == 1:
            (h1,) = h
            y1, y2 = h1 * x1 + z1, h1 * x2 + z2
            sums = (h1.conj() * y1).sum(axis=0), (h1.conj() * y2).sum(axis=0)
        else:
            h1, h2 = h
            y1 = h1 * x1 + h2 * x2 + z1
            y2 = -h1 * x2.conj() + h2 * x1.conj() + z2
            sums = (
                (h1.conj() * y1 + h2 * y2.conj()).sum(axis=0),
                (h2.conj() * y1 - h1 * y2.conj()).sum(axis=0),
            )
        energy = (h.real**2 + h.imag**2).sum(axis=(0, 1)) if self.bits_per_symbol == 4 else 1.0
        wrong = self._decide(np.stack(sums), energy) != bits
        errors = int(np.count_nonzero(wrong))
        per_block = wrong.sum(axis=(0, 1), dtype=np.int64) if errors else np.zeros(1, np.int64)
        return errors, int(per_block @ per_block)

    def _modulate(self, bits: NDArray[np.uint8]) -> ComplexArray:
        """Bits [bit, symbol, block] to symbols [symbol, block]: sign bits, then outer bits."""
        signs = 1.0 - 2.0 * bits
        if self.bits_per_symbol == 1:
            return np.asarray(signs[0], dtype=np.complex128)
        if self.bits_per_symbol == 4:
            signs = signs[:2] * (1.0 + 2.0 * bits[2:])
        return np.asarray(signs[0] + 1j * signs[1])

    def _decide(self, sums: ComplexArray, energy: FloatArray | float) -> NDArray[np.bool_]:
        """Sums [symbol, block] of the combiner to bits; `energy` is the divisor of eq 9."""
        if self.bits_per_symbol == 1:
            return (sums.real < 0)[None]
        parts = np.stack([sums.real, sums.imag])
        if self.bits_per_symbol == 2:
            return parts < 0
        return np.concatenate([parts < 0, np.abs(parts) > 2 * energy])


def _normal(rng: Generator, *shape: int) -> ComplexArray:
    """Complex normal deviates, each part of unit power."""
    return np.asarray(rng.standard_normal((*shape, 2)).view(np.complex128)[..., 0])
