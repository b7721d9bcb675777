"""Gains of the links of the CBTC radio, sample by sample.

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
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.phasors import cis
from rail_signals.train_radio.mimo_fading import MimoFading

from .fading_kernel import add_pieces, node_count
from .links import MIN_DISTANCE_M, Links

_FADING_STREAM = 7
_ORDERS_STEP = 16


class Piece(NamedTuple):
    """Samples of a burst on one link: ``begin`` in the tick, ``sent_at`` in what is sent.

    ``overlaps``: samples of the piece from and to, and where the first is heard.
    """

    base: int
    train: int
    begin: int
    sent_at: int
    overlaps: tuple[tuple[int, int, int], ...]


class FadingLinks:
    """The channels of all links in one direction, each drawn when it is first used.

    A draw depends on nothing but (seed, base station, train, direction).

    Parameters
    ----------
    seed, direction : int
    receive, transmit : int
        Counts of antennas.
    carriers_hz : sequence of float
        Of each base station.
    rician_factor : float
        K (linear); 0 = Rayleigh.
    rate_hz : float
        Samples in a second.
    """

    def __init__(
        self,
        seed: int,
        direction: int,
        receive: int,
        transmit: int,
        carriers_hz: Sequence[float],
        rician_factor: float,
        rate_hz: float,
    ) -> None:
        self._seed, self._direction = seed, direction
        self._receive, self._transmit = receive, transmit
        self._carriers_hz, self._rician_factor = carriers_hz, rician_factor
        self._rate_hz = rate_hz
        self._slots: dict[tuple[int, int], int] = {}
        # [slot, turns and start, pair, wave] and [slot, carrier and line of sight of the pairs].
        self._waves = np.empty((0, 3, receive * transmit, 0))
        self._direct = np.empty((0, 1 + 2 * receive * transmit))

    def add(
        self, links: Links, pieces: Sequence[Piece], count: int, sent: NDArray[np.float32],
        heard: NDArray[np.complex64],
    ) -> None:  # fmt: skip
        """Add what pieces of equal length bring to what is heard.

        Parameters
        ----------
        links : Links
        pieces : sequence of Piece
        count : int
            Samples of each.
        sent : float32 [2, tx, column]
            Real and imaginary parts of all that is sent.
        heard : complex64 [rx, column]
        """
        slots = [self._slot(piece.base, piece.train) for piece in pieces]
        ends = np.cumsum([len(piece.overlaps) for piece in pieces]).tolist()
        table = [
            (
                slot,
                piece.base,
                piece.train,
                piece.begin,
                piece.sent_at,
                end - len(piece.overlaps),
                end,
            )
            for slot, piece, end in zip(slots, pieces, ends, strict=True)
        ]
        overlaps = [overlap for piece in pieces for overlap in piece.overlaps]
        ways = np.array((links.path_m, links.speed_mps, links.acceleration_mps2))
        # The way of a stretch is longest at the highest speed that a train has in the tick.
        fastest_mps = np.abs(ways[1]) + np.abs(ways[2]) * links.tick_s
        longest_m = float(fastest_mps.max()) * (count - 1) / self._rate_hz
        turns_per_m = max(self._carriers_hz) / SPEED_OF_LIGHT_M_PER_S
        add_pieces(
            np.array(table, dtype=np.int64),
            np.array(overlaps, dtype=np.int64),
            count,
            (links.tick_s, self._rate_hz, MIN_DISTANCE_M),
            ways,
            np.array((links.distance_m, links.sight)),
            10.0 ** (links.gain_db[self._direction] / 20.0),
            self._waves,
            self._direct,
            _polynomials(node_count(math.pi * turns_per_m * longest_m), count),
            sent,
            heard.view(np.float32),
        )

    def _slot(self, base: int, train: int) -> int:
        """Row of a link in the tables."""
        slot = self._slots.get((base, train))
        if slot is None:
            waves, direct = self._draw(base, train)
            slot = self._slots[base, train] = len(self._slots)
            if slot >= len(self._waves):
                rows = 2 * slot + 8
                grown = np.zeros((rows, *waves.shape)), np.zeros((rows, *direct.shape))
                if slot:
                    grown[0][:slot], grown[1][:slot] = self._waves[:slot], self._direct[:slot]
                self._waves, self._direct = grown
            self._waves[slot], self._direct[slot] = waves, direct
        return slot

    def _draw(self, base: int, train: int) -> tuple[FloatArray, FloatArray]:
        """The one draw of a link, rows of the tables of `fading_kernel.add_pieces`."""
        key = [self._seed, _FADING_STREAM, base, train, self._direction]
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(key)))
        turns_per_m = self._carriers_hz[base] / SPEED_OF_LIGHT_M_PER_S
        turns = rng.uniform(size=(self._receive, 1)) + rng.uniform(size=self._transmit)
        scale = 1.0 / math.sqrt(1.0 + self._rician_factor)
        sight = scale * math.sqrt(self._rician_factor) * cis(2.0 * math.pi * turns)
        field = MimoFading(rng, self._receive, self._transmit, 1.0 / turns_per_m)
        wave_turns, start = (part.reshape(-1, part.shape[-1]) for part in field.waves)
        direct = np.concatenate(([turns_per_m], sight.ravel().view(np.float64)))
        return np.stack((wave_turns.real, scale * start.real, scale * start.imag)), direct


def _polynomials(orders: int, count: int) -> NDArray[np.float32]:
    """Chebyshev polynomials of at least so many orders at ``count`` places from -1 to 1."""
    return _table(-(-orders // _ORDERS_STEP) * _ORDERS_STEP, count)


@lru_cache(maxsize=64)
def _table(orders: int, count: int) -> NDArray[np.float32]:
    places = chebyshev.chebvander(np.linspace(-1.0, 1.0, count), orders - 1)
    return np.ascontiguousarray(places.T, dtype=np.float32)
