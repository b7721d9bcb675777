"""White Gaussian noise for every antenna, each block drawn at a place of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

WORD = np.float32(2.0**-32)
TURN = np.float32(2.0 * math.pi * 2.0**-32)


class PlacedWords:
    """Random words that depend on nothing but (seed, stream, stage, port, tick).

    A counter-based generator is set to a place of its own for each block, so that neither the
    order of the blocks nor a missing one changes any other.

    Parameters
    ----------
    seed, stream : int
    """

    def __init__(self, seed: int, stream: int) -> None:
        self._bits = np.random.Philox(np.random.SeedSequence([seed, stream]))
        self._state = self._bits.state

    def draw(self, stage: int, ports: Sequence[int], tick: int, count: int) -> NDArray[np.uint64]:
        """Words [port, word]."""
        state = self._state
        words = np.empty((len(ports), count), dtype=np.uint64)
        for row, port in zip(words, ports, strict=True):
            state["state"]["counter"][:] = (0, stage, port, tick)
            state["buffer_pos"] = 4
            self._bits.state = state
            row[:] = self._bits.random_raw(count)
        return words


class NoiseSource:
    """Complex noise that depends on nothing but (seed, stage, port, tick).

    One 64-bit word makes one complex
    number (Box and Muller, 1958), in single precision: twice as fast as the generator's own
    normals, and white noise has no use for more digits. The tails reach to 4.7 sigma of the
    amplitude's 1 / sqrt(2) parts, 6.6 sigma of a part.

    Parameters
    ----------
    seed : int
    samples : int
        Length of a block.
    """

    def __init__(self, seed: int, samples: int) -> None:
        self._words = PlacedWords(seed, 1)
        self._samples = samples

    def blocks(self, stage: int, ports: Sequence[int], tick: int) -> NDArray[np.complex64]:
        """Noise [port, sample] with a mean power of 1."""
        samples = self._samples
        words = self._words.draw(stage, ports, tick, samples)
        halves = words.view(np.uint32).astype(np.float32)
        # From (0, 2^32]: a logarithm of zero would be infinite.
        radius = halves[:, :samples]
        radius += np.float32(0.5)
        radius *= WORD
        radius = np.sqrt(-np.log(radius))
        angle = halves[:, samples:] * TURN
        noise = np.empty(words.shape, dtype=np.complex64)
        np.multiply(radius, np.cos(angle), out=noise.real)
        np.multiply(radius, np.sin(angle), out=noise.imag)
        return noise
