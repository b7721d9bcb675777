"""Gains of one link of the CBTC radio, sample by sample.

    h_{r,a} = (f_{r,a}(s) + sqrt(K) exp(j (theta_{r,a} - 2 pi d / lambda))) / sqrt(K + 1)

| symbol | meaning | unit |
|---|---|---|
| f | Rayleigh field along the way s of the train, by `MimoFading` | 1 |
| d | distance from mast to train: the line of sight turns as the train passes the mast | m |
| theta | of rank one: one phase per receive and one per transmit antenna | rad |
| K | Rician factor | 1 |

They are formed at Chebyshev nodes of a stretch of samples and continued between by the
polynomial through them (Trefethen, *Approximation Theory and Approximation Practice*, 2013,
ch. 8). With ``x = pi |s1 - s0| / lambda`` over the stretch, m nodes err by less than
``4 sum_{k >= m} |J_k(x)|`` of a wave's amplitude; m is such that this is below 1e-3 (-60 dB).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.phasors import cis
from rail_signals.train_radio.mimo_fading import MimoFading

from .links import Run


class LinkFading:
    """One draw of the channel between two groups of antennas.

    Parameters
    ----------
    rng
        Draws phases, angles, in the constructor alone.
    receive, transmit : int
        Counts of antennas.
    carrier_hz : float
    rician_factor : float
        K (linear); 0 = Rayleigh.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        receive: int,
        transmit: int,
        carrier_hz: float,
        rician_factor: float = 0.0,
    ) -> None:
        self._turns_per_m = carrier_hz / SPEED_OF_LIGHT_M_PER_S
        turns = rng.uniform(size=(receive, 1)) + rng.uniform(size=transmit)
        self._direct = math.sqrt(rician_factor) * cis(2.0 * math.pi * turns)[..., None]
        self._scale = 1.0 / math.sqrt(1.0 + rician_factor)
        self._rician = rician_factor > 0.0
        self._field = MimoFading(rng, receive, transmit, 1.0 / self._turns_per_m)

    def gains(self, run: Run, start_s: float, stop_s: float, count: int) -> NDArray[np.complex64]:
        """Amplitude gains, path loss included, at evenly spaced moments.

        Parameters
        ----------
        run : Run
        start_s, stop_s : float
            First and last moment, from the begin of the tick [s].
        count : int

        Returns
        -------
        complex64 [rx, tx, count]
        """
        first_m, last_m = run.moved_m(np.array([start_s, stop_s])).tolist()
        nodes = node_count(math.pi * self._turns_per_m * abs(last_m - first_m))
        time_s = start_s + 0.5 * (stop_s - start_s) * (1.0 + _zeros(nodes))
        moved_m = run.moved_m(time_s)
        h = self._field.at_few(run.path_m + moved_m)
        if self._rician:
            turns = self._turns_per_m * run.distance_after(moved_m)
            h += self._direct * cis(-2.0 * math.pi * (turns - np.rint(turns)))
        h *= self._scale * run.gain(time_s)
        between = _interpolation(nodes, count)
        gain = np.empty((*h.shape[:2], count), dtype=np.complex64)
        gain.real = h.real.astype(np.float32) @ between
        gain.imag = h.imag.astype(np.float32) @ between
        return gain


def node_count(x: float) -> int:
    """Nodes for ``exp(j x u)``, -1 <= u <= 1: a fit to the bound above from its upper side.

    >>> node_count(0.0), node_count(math.pi)
    (1, 10)
    """
    return 1 if x == 0.0 else math.ceil(x + 3.25 * x ** (1.0 / 3.0) + 2.0)


@lru_cache(maxsize=256)
def _zeros(nodes: int) -> FloatArray:
    """Zeros of the Chebyshev polynomial [node]."""
    return np.asarray(np.cos(math.pi * (np.arange(nodes) + 0.5) / nodes))


@lru_cache(maxsize=256)
def _interpolation(nodes: int, count: int) -> NDArray[np.float32]:
    """From values at the nodes to ``count`` places from -1 to 1 [node, place]."""
    weights = chebyshev.chebvander(_zeros(nodes), nodes - 1) * (2.0 / nodes)
    weights[:, 0] *= 0.5
    places = chebyshev.chebvander(np.linspace(-1.0, 1.0, count), nodes - 1)
    return np.asarray(weights @ places.T, dtype=np.float32)
