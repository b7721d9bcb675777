"""Ways of moving antennas past reference stations, and the tones over them, compiled.

The equations are those of `rail_world.doppler.medium`; rows are links, sorted by train.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rail_signals.compiled import compiled
from rail_signals.single_precision import phasor_of_turns


@compiled
def distances(ways: Any, stations: Any, time_s: Any, least_m: Any, out: Any) -> None:
    """Distance at every sample ``out`` float64 [link, sample], at least ``least_m``.

    Parameters
    ----------
    ways : float64 [link, 8]
        Place of the antenna x, y, z [m], heading [rad], speed [m/s], acceleration [m/s^2],
        curvature [1/m] and slope [1] of the track, all at the time 0.
    stations : float64 [link, 3]
        Places [m].
    time_s : float64 [sample]
    least_m : float
    """
    for link in range(out.shape[0]):
        cosine, sine = math.cos(ways[link, 3]), math.sin(ways[link, 3])
        speed_mps, half_mps2 = ways[link, 4], 0.5 * ways[link, 5]
        half_per_m, slope = 0.5 * ways[link, 6], ways[link, 7]
        x_m = ways[link, 0] - stations[link, 0]
        y_m = ways[link, 1] - stations[link, 1]
        z_m = ways[link, 2] - stations[link, 2]
        least = least_m * least_m
        for i in range(out.shape[1]):
            path_m = (speed_mps + half_mps2 * time_s[i]) * time_s[i]
            bend_m = half_per_m * path_m * path_m
            x = x_m + (cosine * path_m - sine * bend_m)
            y = y_m + (sine * path_m + cosine * bend_m)
            z = z_m + slope * path_m
            square = x * x + y * y + z * z
            out[link, i] = math.sqrt(square if square > least else least)


@compiled
def add_tones(
    rows: Any,
    sources: Any,
    turns: Any,
    time_s: Any,
    distance_m: Any,
    amplitude: Any,
    envelope: Any,
    heard: Any,
) -> None:
    """Add the envelopes of all links, turned by their ways, to what the trains hear.

    Parameters
    ----------
    rows : int64 [link]
        Row of ``heard``.
    sources : int64 [link]
        Row of ``envelope``.
    turns : float64 [link, 4]
        Offset [Hz], turns of the carrier and of the mean of the envelope in a metre, and the way
        that the envelope is delayed by already.
    time_s : float64 [sample]
    distance_m, amplitude : float64 [link, sample]
    envelope : float64 [source, 2 sample]
        Real and imaginary parts in turn.
    heard : float32 [row, 2 sample]
    """
    samples = len(time_s)
    cosine, sine = np.empty(samples, np.float32), np.empty(samples, np.float32)
    for link in range(len(rows)):
        row, offset_hz = rows[link], turns[link, 0]
        carrier_per_m, envelope_per_m = turns[link, 1], turns[link, 2]
        delayed_m, parts = turns[link, 3], envelope[sources[link]]
        for i in range(samples):
            away_m = distance_m[link, i]
            turned = offset_hz * time_s[i] - carrier_per_m * away_m
            turned -= envelope_per_m * (away_m - delayed_m)
            cosine[i], sine[i] = phasor_of_turns(turned)
        for i in range(samples):
            x = amplitude[link, i] * parts[2 * i]
            y = amplitude[link, i] * parts[2 * i + 1]
            heard[row, 2 * i] += x * cosine[i] - y * sine[i]
            heard[row, 2 * i + 1] += x * sine[i] + y * cosine[i]
