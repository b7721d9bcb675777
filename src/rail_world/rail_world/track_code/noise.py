"""Real noise for every port on the rails, each block drawn at a place of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rail_world.noise_kernels import real_blocks
from rail_world.ranging.noise import PlacedWords, noise_key

_STREAM = 4


class RealNoiseSource:
    """Real noise that depends on nothing but (seed, stage, port, tick).

    The real sister of `rail_world.ranging.noise.NoiseSource`, on a stream of its own. One 64-bit
    word makes two normals (Box and Muller, 1958), in single precision; the tails reach to
    6.6 sigma.

    Parameters
    ----------
    seed : int
    samples : int
        Length of a block.
    """

    def __init__(self, seed: int, samples: int) -> None:
        self._words = PlacedWords(seed, _STREAM)
        self._key = noise_key(seed, _STREAM)
        self._samples = samples

    def blocks(self, stage: int, ports: Sequence[int], tick: int) -> NDArray[np.float32]:
        """White Gaussian noise [port, sample] with a variance of 1."""
        noise = np.empty((len(ports), self._samples), dtype=np.float32)
        real_blocks(self._key, stage, np.array(ports, dtype=np.int64), tick, noise)
        return noise

    def impulses(
        self, stage: int, ports: Sequence[int], tick: int, mean_count: float
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
        """Impulses of a Poisson process, each within one sample.

        Parameters
        ----------
        stage, tick : int
        ports : sequence of int
        mean_count : float
            Mean number in a block.

        Returns
        -------
        row, sample, height
            Index into ``ports``, sample and height of each impulse: either sign, and the
            magnitude exponential with a mean of 1.
        """
        # Eight sigma past the mean: more have no place, and do not come.
        most = math.ceil(mean_count + 8.0 * math.sqrt(mean_count)) + 8
        words = self._words.draw(stage, ports, tick, 2 * most)
        uniform = ((words >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53
        exponential = -np.log(uniform)
        at = np.cumsum(exponential[:, :most], axis=1) * (self._samples / mean_count)
        row, column = np.nonzero(at < self._samples)
        sign = np.where(words[row, most + column] & np.uint64(1), 1.0, -1.0)
        return row, at[row, column].astype(np.intp), sign * exponential[row, most + column]
