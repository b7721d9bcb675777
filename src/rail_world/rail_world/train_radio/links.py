"""The links of the CBTC radio: where the trains are, and what the way to each mast costs.

All moments are counted from the end of a tick, to which the truth belongs: the way of a train
since then is ``v t + a t^2 / 2`` with t from minus a tick to 0. That is what the world
integrates, so that the begin of a tick is the end of the one before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray
from rail_signals.train_radio.path_loss import path_loss_db

from .description import CbtcDescription

DOWNLINK, UPLINK = 0, 1
# As ``STATE.columns``, which is not for modules without ROS.
COLUMNS = (
    *("path_m", "x_m", "y_m", "z_m", "heading_rad", "speed_mps", "acceleration_mps2"),
    *("track_index", "chainage_m", "on_line"),
)
MIN_DISTANCE_M = 1.0


@dataclass(frozen=True, eq=False)
class Links:
    """All links of one tick, the truth.

    ``distance_m`` and ``in_coverage`` [base, train] at the end of the tick; ``gain_db``
    [direction, moment, base, train], directions down and up, moments begin and end of the tick;
    ``sight`` [base, train] cosine between the way of the train and the line from the mast to it:
    -1 = it comes straight on; ``path_m``, ``speed_mps``, ``acceleration_mps2`` [train].
    """

    tick: int
    time_s: float
    tick_s: float
    distance_m: FloatArray
    in_coverage: NDArray[np.bool_]
    gain_db: FloatArray
    sight: FloatArray
    path_m: FloatArray
    speed_mps: FloatArray
    acceleration_mps2: FloatArray


class LinkGeometry:
    """Makes the links of a tick from the truth.

    Parameters
    ----------
    description : CbtcDescription
    tick_s : float
        Length of a tick [s].
    """

    def __init__(self, description: CbtcDescription, tick_s: float) -> None:
        self._radio, self._tick_s = description, tick_s
        masts = description.base_stations
        tracks = {name: index for index, name in enumerate(description.track_order)}
        self._position_m = np.array([mast.position_m for mast in masts])
        self._mast_m = np.array([mast.chainage_m for mast in masts])
        self._mast_track = np.array([tracks[mast.track] for mast in masts])
        self._carrier_hz = np.array(
            [
                [carriers_hz[mast.channel] for mast in masts]
                for carriers_hz in (description.downlink_hz, description.uplink_hz)
            ]
        )
        self._sections = [(tracks[s.track], s, s.section()) for s in description.sections]

    def links(self, tick: int, time_s: float, state: FloatArray) -> Links:
        """Geometry and gains of all links; see `rail_world.train_radio.medium.CbtcMedium.links`."""
        wanted = (len(self._radio.trains), len(COLUMNS))
        if state.shape != wanted:
            raise ValueError(f"state: {state.shape}, not {wanted}")
        table = dict(zip(COLUMNS, state.T.copy(), strict=True))
        position_m = np.stack((table["x_m"], table["y_m"], table["z_m"]), axis=1)
        line = position_m - self._position_m[:, None, :]
        distance_m = np.maximum(np.sqrt(np.einsum("btk,btk->bt", line, line)), MIN_DISTANCE_M)
        along = np.stack((np.cos(table["heading_rad"]), np.sin(table["heading_rad"])), axis=1)
        sight = np.einsum("btk,tk->bt", line[..., :2], along) / distance_m
        v, a = table["speed_mps"], table["acceleration_mps2"]
        start_m = _moved(v, a, -self._tick_s)
        gain_db = np.empty((2, 2, *distance_m.shape))
        for moment, moved_m in enumerate((start_m, np.zeros_like(v))):
            moved_to_m = _distance(distance_m, sight, moved_m)
            loss_db = self._sections_db(table["track_index"], table["chainage_m"] + moved_m)
            gain_db[:, moment] = self._radio.snr_offset_db - loss_db - self._path_db(moved_to_m)
        in_coverage = (distance_m <= self._radio.coverage_range_m) & (table["on_line"] > 0.0)
        return Links(
            *(tick, time_s, self._tick_s, distance_m, in_coverage, gain_db, sight),
            *(table["path_m"], v, a),
        )

    def _path_db(self, distance_m: FloatArray) -> FloatArray:
        """Path loss [direction, base, train]."""
        return path_loss_db(
            distance_m, self._carrier_hz[:, :, None], exponent=self._radio.path_loss_exponent
        )

    def _sections_db(self, track: FloatArray, chainage_m: FloatArray) -> FloatArray:
        """Loss in cuttings and tunnels [base, train].

        Chainages of different tracks cannot be compared: then an end that is in a section is as
        far from the other as from just outside the better end of the section.
        """
        total = np.zeros((len(self._mast_m), len(chainage_m)))
        for on, described, section in self._sections:
            clear_m = 1.0 + described.edge_m
            outside_m = described.from_m - clear_m, described.to_m + clear_m
            train_in = np.minimum(*(section.loss_db(x, chainage_m) for x in outside_m))
            mast_in = np.minimum(*(section.loss_db(x, self._mast_m) for x in outside_m))
            both = section.loss_db(self._mast_m[:, None], chainage_m)
            mast_on, train_on = (self._mast_track == on)[:, None], track == on
            apart = np.where(mast_on, mast_in[:, None], np.where(train_on, train_in, 0.0))
            total += np.where(mast_on & train_on, both, apart)
        return total


def _moved(speed_mps: Any, acceleration_mps2: Any, time_s: Any) -> FloatArray:
    """Way since the end of the tick [m]."""
    return np.asarray((speed_mps + 0.5 * acceleration_mps2 * time_s) * time_s)


def _distance(distance_m: Any, sight: Any, moved_m: FloatArray) -> FloatArray:
    """Distance from a mast [m] after a straight way along the heading."""
    square = distance_m * distance_m + moved_m * (2.0 * distance_m * sight + moved_m)
    return np.asarray(np.sqrt(np.maximum(square, MIN_DISTANCE_M**2)))
