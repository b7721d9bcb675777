"""Geometry and propagation of the ranging radio, compiled: one call for all links of a leg.

The equations are those of `rail_world.ranging.medium`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rail_signals.compiled import compiled
from rail_signals.single_precision import phasor_of_turns


@compiled
def off_axis_db(cos_angle: Any, beamwidth_deg: Any, front_to_back_db: Any) -> Any:
    """Gain off the axis less that on it [dB], ``-min(12 (angle / beamwidth)^2, front-to-back)``."""
    angle_deg = math.degrees(math.acos(min(max(cos_angle, -1.0), 1.0)))
    return -min(12.0 * (angle_deg / beamwidth_deg) ** 2, front_to_back_db)


@compiled
def links_in_coverage(
    stations: Any, trains: Any, patterns: Any, exponent: Any, least_m: Any, links: Any, in_coverage: Any
) -> None:
    """Fill ``links`` float64 [3, station, train] where a link exists.

    Parameters
    ----------
    stations : float64 [station, 7]
        Position [m], boresight, range of coverage [m].
    trains : float64 [train, 9]
        Position [m], axis of the antenna, velocity [m/s].
    patterns : float, ...
        Sum of the gains on the axes [dBi], beamwidth [deg] and front-to-back ratio [dB] of the
        stations, then of the trains.
    exponent, least_m : float
        Of the path loss; the least distance [m].
    links
        Distance [m], closing speed [m/s], gain [dB] without the loss at 1 m.
    in_coverage : bool [station, train]
    """
    gain_dbi, station_deg, station_db, train_deg, train_db = patterns
    for s in range(stations.shape[0]):
        for t in range(trains.shape[0]):
            x = trains[t, 0] - stations[s, 0]
            y = trains[t, 1] - stations[s, 1]
            z = trains[t, 2] - stations[s, 2]
            distance_m = max(math.sqrt(x * x + y * y + z * z), least_m)
            links[0, s, t] = distance_m
            in_coverage[s, t] = distance_m <= stations[s, 6]
            if not in_coverage[s, t]:
                links[1, s, t], links[2, s, t] = 0.0, -math.inf
                continue
            x, y, z = x / distance_m, y / distance_m, z / distance_m
            station_cos = x * stations[s, 3] + y * stations[s, 4] + z * stations[s, 5]
            train_cos = -(x * trains[t, 3] + y * trains[t, 4] + z * trains[t, 5])
            links[1, s, t] = -(x * trains[t, 6] + y * trains[t, 7] + z * trains[t, 8])
            links[2, s, t] = (
                gain_dbi
                + off_axis_db(station_cos, station_deg, station_db)
                + off_axis_db(train_cos, train_deg, train_db)
                - 10.0 * exponent * math.log10(distance_m)
            )


@compiled
def delayed_spectra(
    sent: Any, of_link: Any, periods: Any, delay_samples: Any, gain: Any, turns: Any, out: Any
) -> None:
    """Transforms ``out`` complex128 [link, period] of what arrives over each link.

    Each bin is multiplied by ``gain exp(-j 2 pi (turns + k d / N))`` over the signed bin
    numbers k; N is the period of the link.

    Parameters
    ----------
    sent : complex128 [sender, period]
    of_link, periods : int64 [link]
        Row of ``sent``, samples of its period.
    delay_samples, gain, turns : float64 [link]
        Delay, amplitude, turns of the carrier on the way.
    """
    for link in range(out.shape[0]):
        sender, period = of_link[link], periods[link]
        low = (period + 1) // 2
        turn = (delay_samples[link] % period) / period
        step_rad = -2.0 * math.pi * turn
        step = complex(math.cos(step_rad), math.sin(step_rad))
        carrier_rad = -2.0 * math.pi * (turns[link] % 1.0)
        factor = gain[link] * complex(math.cos(carrier_rad), math.sin(carrier_rad))
        for k in range(low):
            out[link, k] = sent[sender, k] * factor
            factor *= step
        first_rad = carrier_rad - 2.0 * math.pi * ((turn * (low - period)) % 1.0)
        factor = gain[link] * complex(math.cos(first_rad), math.sin(first_rad))
        for k in range(low, period):
            out[link, k] = sent[sender, k] * factor
            factor *= step


@compiled
def add_links(rows: Any, periods: Any, arrived: Any, cycles_per_sample: Any, heard: Any) -> None:
    """Add what arrives over links, shifted in frequency, to what is heard.

    The shift leaves the phase at the middle of the block alone.

    Parameters
    ----------
    rows, periods : int64 [link]
        Row of ``heard``, samples of a period.
    arrived : float64 [link, 2 period]
        One period, real and imaginary parts in turn.
    cycles_per_sample : float64 [link]
    heard : float32 [row, 2 sample]
    """
    samples = heard.shape[1] // 2
    cosine, sine = np.empty(samples, np.float32), np.empty(samples, np.float32)
    one = np.empty(arrived.shape[1], np.float32)
    for link in range(len(rows)):
        row, period, cycles = rows[link], periods[link], cycles_per_sample[link]
        for i in range(samples):
            cosine[i], sine[i] = phasor_of_turns(cycles * (i - 0.5 * (samples - 1)))
        for i in range(2 * period):
            one[i] = arrived[link, i]
        for begin in range(0, samples, period):
            for k in range(period):
                i = begin + k
                x, y = one[2 * k], one[2 * k + 1]
                heard[row, 2 * i] += x * cosine[i] - y * sine[i]
                heard[row, 2 * i + 1] += x * sine[i] + y * cosine[i]
