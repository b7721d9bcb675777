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
    stations: Any,
    trains: Any,
    patterns: Any,
    exponent: Any,
    least_m: Any,
    links: Any,
    in_coverage: Any,
) -> Any:
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

    Returns
    -------
    int
        Number of links.
    """
    count = 0
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
            count += 1
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
    return count


@compiled
def _delay(spectrum: Any, delay_turns: Any, gain: Any, carrier_turns: Any, out: Any) -> None:
    """Multiply bin k by ``gain exp(-j 2 pi (carrier_turns + k delay_turns))``, k signed."""
    period = len(out)
    low = (period + 1) // 2
    step_rad = -2.0 * math.pi * (delay_turns % 1.0)
    step = complex(math.cos(step_rad), math.sin(step_rad))
    carrier_rad = -2.0 * math.pi * (carrier_turns % 1.0)
    factor = gain * complex(math.cos(carrier_rad), math.sin(carrier_rad))
    for k in range(low):
        out[k] = spectrum[k] * factor
        factor *= step
    first_rad = carrier_rad - 2.0 * math.pi * ((delay_turns * (low - period)) % 1.0)
    factor = gain * complex(math.cos(first_rad), math.sin(first_rad))
    for k in range(low, period):
        out[k] = spectrum[k] * factor
        factor *= step


@compiled
def carry(
    uplink: Any,
    sent: Any,
    stations: Any,
    trains: Any,
    channels: Any,
    paths: Any,
    limits: Any,
    links: Any,
) -> Any:
    """What is sent, over every link on which it is audible.

    Parameters
    ----------
    uplink : bool
    sent : tuple
        Row of each sender in what follows, -1 = silent, int64 [sender]; its channel, int64
        [sender]; periods int64 [row]; mean powers float64 [row] [mW]; transforms complex128
        [row, longest period].
    stations : tuple
        Channel on which a station sends or hears, int64 [station]; whether it is alive, bool
        [station]; offset of its oscillator, float64 [station].
    trains : float64 [train]
        Offset of its oscillator.
    channels : tuple
        By channel number: carrier [Hz], loss at 1 m [dB].
    paths : tuple
        ``in_coverage``, distance [m], closing speed [m/s], gain [dB], all [station, train].
    limits : float, float, float
        Least audible power [mW], speed of light [m/s], sample rate [Hz].
    links : tuple
        Written, a row for each link: int64 [link, 5] port, station, train, period and whether it
        is the strongest of its port; float64 [link, 2] power [mW] and shift [cycles/sample];
        complex128 [link, longest period] transform of what arrives.

    Returns
    -------
    int, int
        Number of links and of ports. A port is a receiver and its channel.
    """
    row_of, channel_of, periods, sent_mw, spectra = sent
    station_channel, alive, station_offset = stations
    carrier_hz, loss_db = channels
    in_coverage, distance_m, closing_mps, gain_db = paths
    least_mw, c_mps, rate_hz = limits
    table, values, arriving = links
    # The port of a receiver on each channel, and the strongest link of a port.
    receivers = in_coverage.shape[0] if uplink else in_coverage.shape[1]
    port_of = np.full((receivers, len(carrier_hz)), -1)
    strongest = np.empty(len(table), np.int64)
    count = ports = 0
    for s in range(in_coverage.shape[0]):
        channel = station_channel[s]
        for t in range(in_coverage.shape[1]):
            sender = t if uplink else s
            row = row_of[sender]
            if row < 0 or channel_of[sender] != channel or not (in_coverage[s, t] and alive[s]):
                continue
            gain = gain_db[s, t] - loss_db[channel]
            power_mw = sent_mw[row] * 10.0 ** (gain / 10.0)
            if power_mw < least_mw:
                continue
            receiver = s if uplink else t
            port = port_of[receiver, channel]
            if port < 0:
                port = port_of[receiver, channel] = ports
                ports += 1
                strongest[port] = count
            elif power_mw > values[strongest[port], 0]:
                strongest[port] = count
            offset = station_offset[s] - trains[t]
            shift_hz = carrier_hz[channel] * (
                closing_mps[s, t] / c_mps + (-offset if uplink else offset)
            )
            period = periods[row]
            table[count, 0], table[count, 1], table[count, 2] = port, s, t
            table[count, 3], table[count, 4] = period, 0
            values[count, 0], values[count, 1] = power_mw, shift_hz / rate_hz
            delay_s = distance_m[s, t] / c_mps
            turns = delay_s * rate_hz / period
            carried = arriving[count, :period]
            amplitude = 10.0 ** (gain / 20.0)
            _delay(spectra[row], turns, amplitude, carrier_hz[channel] * delay_s, carried)
            count += 1
    for port in range(ports):
        table[strongest[port], 4] = 1
    return count, ports


@compiled
def add_links(table: Any, values: Any, arrived: Any, heard: Any) -> None:
    """Add what arrives over links, shifted in frequency, to what is heard.

    The shift leaves the phase at the middle of the block alone.

    Parameters
    ----------
    table, values
        Of the links, as of `carry`.
    arrived : float64 [link, 2 period]
        One period, real and imaginary parts in turn.
    heard : float32 [port, 2 sample]
    """
    samples = heard.shape[1] // 2
    cosine, sine = np.empty(samples, np.float32), np.empty(samples, np.float32)
    one = np.empty(arrived.shape[1], np.float32)
    for link in range(len(table)):
        row, period, cycles = table[link, 0], table[link, 3], values[link, 1]
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
