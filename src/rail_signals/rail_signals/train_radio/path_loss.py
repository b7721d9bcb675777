"""Loss of a radio link [dB]: log-distance law, cuttings and tunnels.

    L(d) = 20 log10(4 pi d0 / lambda) + 10 n log10(d / d0)

with free space up to the reference distance d0 and the exponent n from there. Cuttings and
tunnels are stretches of chainage that add loss where the link passes their edges; all functions
are reciprocal: mast and train may change places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S


def path_loss_db(
    distance_m: ArrayLike,
    carrier_hz: ArrayLike,
    *,
    exponent: float = 2.0,
    reference_m: float = 10.0,
) -> FloatArray:
    """Log-distance path loss.

    Parameters
    ----------
    distance_m : [...]
        Length of the path [m]; up to `reference_m` the loss is that of free space.
    carrier_hz : [...]
        Carrier frequency [Hz]; broadcasts against the distances.
    exponent
        Exponent n of power over distance beyond the reference; 2 is free space.
    reference_m
        Reference distance d0 [m].

    Returns
    -------
    float64 [...]
        Loss [dB], not below 0: nearer than about a twelfth of a wavelength the law fails.

    Raises
    ------
    ValueError
        If an argument is negative or not finite; the message quotes it.

    Examples
    --------
    >>> path_loss_db([10.0, 1000.0], 2.4e9, exponent=3.0).round(2).tolist()
    [60.05, 120.05]
    """
    for name, value in (("exponent", exponent), ("reference_m", reference_m)):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be finite and above zero, got {value!r}")
    carrier = np.asarray(carrier_hz, dtype=np.float64)
    if not (np.isfinite(carrier) & (carrier > 0)).all():
        raise ValueError(f"carrier_hz must be finite and above zero, got {carrier_hz!r}")
    distance = np.asarray(distance_m, dtype=np.float64)
    if not (np.isfinite(distance) & (distance >= 0)).all():
        raise ValueError(f"distance_m must be finite and not negative, got {distance_m!r}")
    turn = 4 * math.pi * carrier / SPEED_OF_LIGHT_M_PER_S
    near = np.clip(distance, 1 / turn, reference_m)
    beyond = np.maximum(distance / reference_m, 1.0)
    loss = 20 * np.log10(turn * near) + 10 * exponent * np.log10(beyond)
    return np.maximum(np.asarray(loss, dtype=np.float64), 0.0)


def amplitude_gain(loss_db: ArrayLike) -> FloatArray:
    """Factor of an amplitude under a loss [dB], float64 [...].

    Examples
    --------
    >>> amplitude_gain([0.0, 40.0]).tolist()
    [1.0, 0.01]
    """
    return np.asarray(10.0 ** (-np.asarray(loss_db, dtype=np.float64) / 20))


class PathLossSection(Protocol):
    """A stretch of line that adds to the loss of a link."""

    def loss_db(self, mast_m: ArrayLike, train_m: ArrayLike) -> FloatArray:
        """Extra loss [dB] between two chainages [m], float64 [...]."""
        ...


@dataclass(frozen=True)
class Cutting:
    """A cutting, whose walls shadow a train in it from a mast outside.

    Within the cutting, and right across it, they see each other.

    Parameters
    ----------
    start_m, end_m
        Chainages of its ends [m].
    wall_loss_db
        Loss between inside and outside [dB].
    edge_m
        Length over which the walls rise at either end [m], centred there; a raised cosine.

    Examples
    --------
    >>> cutting = Cutting(1000.0, 1400.0, wall_loss_db=12.0)
    >>> cutting.loss_db(0.0, [500.0, 1200.0, 2000.0]).tolist()
    [0.0, 12.0, 0.0]
    """

    start_m: float
    end_m: float
    wall_loss_db: float
    edge_m: float = 0.0

    def __post_init__(self) -> None:
        """Validate every field."""
        _check_stretch(self.start_m, self.end_m, self.edge_m)
        _check_loss("wall_loss_db", self.wall_loss_db)

    def loss_db(self, mast_m: ArrayLike, train_m: ArrayLike) -> FloatArray:
        """Extra loss [dB] of a link between two chainages [m], float64 [...]."""
        at = [
            _risen(x, self.start_m, self.edge_m) - _risen(x, self.end_m, self.edge_m)
            for x in (mast_m, train_m)
        ]
        return np.asarray(self.wall_loss_db * np.abs(at[1] - at[0]))


@dataclass(frozen=True)
class Tunnel:
    """A tunnel: a step at each portal the link passes, and loss per metre inside.

    Parameters
    ----------
    start_m, end_m
        Chainages of its portals [m].
    entry_loss_db
        Loss at a portal [dB].
    loss_db_per_m
        Loss per metre of the link's way inside [dB/m].
    edge_m
        Length over which the step rises [m], centred at the portal; a raised cosine.

    Examples
    --------
    >>> tunnel = Tunnel(1000.0, 1400.0, entry_loss_db=10.0, loss_db_per_m=0.05)
    >>> tunnel.loss_db(0.0, [500.0, 1200.0, 2000.0]).tolist()
    [0.0, 20.0, 40.0]
    """

    start_m: float
    end_m: float
    entry_loss_db: float
    loss_db_per_m: float
    edge_m: float = 0.0

    def __post_init__(self) -> None:
        """Validate every field."""
        _check_stretch(self.start_m, self.end_m, self.edge_m)
        _check_loss("entry_loss_db", self.entry_loss_db)
        _check_loss("loss_db_per_m", self.loss_db_per_m)

    def loss_db(self, mast_m: ArrayLike, train_m: ArrayLike) -> FloatArray:
        """Extra loss [dB] of a link between two chainages [m], float64 [...]."""
        passed = sum(
            np.abs(_risen(train_m, portal_m, self.edge_m) - _risen(mast_m, portal_m, self.edge_m))
            for portal_m in (self.start_m, self.end_m)
        )
        mast, train = (np.clip(_finite(x), self.start_m, self.end_m) for x in (mast_m, train_m))
        inside_m = np.abs(train - mast)
        return np.asarray(self.entry_loss_db * passed + self.loss_db_per_m * inside_m)


def section_loss_db(
    sections: Sequence[PathLossSection], mast_m: ArrayLike, train_m: ArrayLike
) -> FloatArray:
    """Sum of the losses of sections on a link.

    Parameters
    ----------
    sections
        Cuttings and tunnels; those that overlap add up.
    mast_m, train_m : [...]
        Chainages of the two ends [m]; broadcast.

    Returns
    -------
    float64 [...]
        Loss [dB].
    """
    total = np.zeros(np.broadcast_shapes(np.shape(mast_m), np.shape(train_m)))
    for section in sections:
        total = total + section.loss_db(mast_m, train_m)
    return total


def _risen(chainage_m: ArrayLike, edge_at_m: float, width_m: float) -> FloatArray:
    """Step from 0 to 1 at an edge: a raised cosine of the given width."""
    beyond = _finite(chainage_m) - edge_at_m
    if width_m == 0:
        return np.where(beyond >= 0, 1.0, 0.0)
    fraction = np.clip(beyond / width_m + 0.5, 0.0, 1.0)
    return np.asarray((1 - np.cos(math.pi * fraction)) / 2)


def _finite(chainage_m: ArrayLike) -> FloatArray:
    chainage = np.asarray(chainage_m, dtype=np.float64)
    if not np.isfinite(chainage).all():
        raise ValueError(f"chainages must be finite, got {chainage_m!r}")
    return chainage


def _check_stretch(start_m: float, end_m: float, edge_m: float) -> None:
    if not (math.isfinite(start_m) and math.isfinite(end_m) and start_m < end_m):
        raise ValueError(f"end_m must lie beyond start_m {start_m!r}, got {end_m!r}")
    if not 0 <= edge_m <= end_m - start_m:
        raise ValueError(f"edge_m must lie between 0 and {end_m - start_m:g}, got {edge_m!r}")


def _check_loss(name: str, value: float) -> None:
    if not (math.isfinite(value) and value >= 0):
        raise ValueError(f"{name} must be finite and not negative, got {value!r}")
