"""Compiled look-ups of stations: the nearest in each slot, and what is known of those received."""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray
from rail_signals.compiled import compiled


@compiled
def nearest_stations(
    asked: NDArray[np.int64], slots: NDArray[np.int64], feet_m: FloatArray, near_m: float
) -> NDArray[np.int64]:
    """Of the stations in each slot the nearest to a chainage, the first of two; -1 if none."""
    stations = np.full(len(asked), -1)
    for i in range(len(asked)):
        nearest_m = inf
        for station in range(len(slots)):
            if slots[station] == asked[i] and abs(feet_m[station] - near_m) < nearest_m:
                stations[i], nearest_m = station, abs(feet_m[station] - near_m)
    return stations


@compiled
def gather_received(
    number: NDArray[np.int64],
    shift_hz: FloatArray,
    variance_hz2: FloatArray,
    stations_m: FloatArray,
    effects: FloatArray,
    received: FloatArray,
) -> bool:
    """Rows of stations as `rail_signals.doppler.shift_kernel` takes them.

    Parameters
    ----------
    number : int64 [n]
        Numbers of the stations received.
    shift_hz, variance_hz2 : float64 [n]
    stations_m, effects : float64 [station, 3], [station, 2]
        Places, and shift per rate and speed and share of the offset.
    received : float64 [n, 7]
        Result.

    Returns
    -------
    bool
        Whether there are all the stations, all shifts and variances are finite, and the variances
        above zero.
    """
    for i in range(len(number)):
        z, variance = shift_hz[i], variance_hz2[i]
        if not (abs(z) < inf and 0.0 < variance < inf and 0 <= number[i] < len(effects)):
            return False
        row, station = received[i], number[i]
        for axis in range(3):
            row[axis] = stations_m[station, axis]
        row[3], row[4] = z, 1.0 / variance
        row[5], row[6] = effects[station, 0], effects[station, 1]
    return True
