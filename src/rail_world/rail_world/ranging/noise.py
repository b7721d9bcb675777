"""White Gaussian noise for every antenna, each block drawn at a place of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray
from rail_world.noise_kernels import complex_blocks, complex_windows, words_at


def noise_key(seed: int, stream: int) -> NDArray[np.uint64]:
    """Key [2] of the counter-based generator of a stream."""
    bits = np.random.Philox(np.random.SeedSequence([seed, stream]))
    key: NDArray[np.uint64] = bits.state["state"]["key"].copy()
    return key


class PlacedWords:
    """Random words that depend on nothing but (seed, stream, stage, port, tick).

    A counter-based generator has a place of its own for each block, so that neither the
    order of the blocks nor a missing one changes any other.

    Parameters
    ----------
    seed, stream : int
    """

    def __init__(self, seed: int, stream: int) -> None:
        self._key = noise_key(seed, stream)

    def draw(self, stage: int, ports: Sequence[int], tick: int, count: int) -> NDArray[np.uint64]:
        """Words [port, word]."""
        words = np.empty((len(ports), -(-count // 4), 4), dtype=np.uint64)
        words_at(self._key, stage, np.array(ports, dtype=np.int64), tick, words)
        return words.reshape(len(ports), -1)[:, :count]


class NoiseSource:
    """Complex noise that depends on nothing but (seed, stage, port, tick).

    One 64-bit word makes one complex number (Box and Muller, 1958), in single precision: white
    noise has no use for more digits. The tails reach to 4.7 sigma of the amplitude's
    1 / sqrt(2) parts, 6.6 sigma of a part.

    Parameters
    ----------
    seed : int
    samples : int
        Length of a block.
    """

    def __init__(self, seed: int, samples: int) -> None:
        self._key = noise_key(seed, 1)
        self._samples = samples

    def blocks(
        self, stage: int, ports: Sequence[int], tick: int, power: FloatArray
    ) -> NDArray[np.complex64]:
        """Noise [port, sample] with a mean power [port]."""
        noise = np.empty((len(ports), self._samples), dtype=np.complex64)
        sigma = np.sqrt(power).astype(np.float32)
        out = noise.view(np.float32)
        complex_blocks(self._key, stage, np.array(ports, dtype=np.int64), tick, sigma, out)
        return noise

    def windows(
        self,
        stage: int,
        windows: NDArray[np.int64],
        tick: int,
        power: FloatArray,
        antennas: int,
    ) -> NDArray[np.complex64]:
        """Noise at several antennas in windows of a long stretch, one after the other.

        A sample is the same in whatever window it is. The stretch is a row of blocks, each of
        which belongs to all antennas in turn; the block after that of one port is that of the
        next port.

        Parameters
        ----------
        stage, tick : int
        windows : int64 [window, 3]
            Port of the first block of the stretch, first sample in the stretch, sample after the
            last.
        power : float64 [window]
            Mean power of a sample.
        antennas : int
            Divides the length of a block.

        Returns
        -------
        complex64 [antenna, sample], the samples of all windows side by side
        """
        lengths = windows[:, 2] - windows[:, 1]
        noise = np.empty((antennas, int(lengths.sum())), dtype=np.complex64)
        sigma = np.sqrt(power).astype(np.float32)
        each = self._samples // antennas
        complex_windows(self._key, stage, windows, tick, each, sigma, noise.view(np.float32))
        return noise
