"""What bursts bring over fading links, compiled: all pieces of a leg in one call.

The equations are those of `rail_world.train_radio.fading`. A piece is a stretch of a burst on one
link. Its gains at the Chebyshev nodes become coefficients of Chebyshev polynomials, and those are
summed up sample by sample.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rail_signals.compiled import compiled
from rail_signals.single_precision import phasor_of_turns


@compiled
def node_count(x: float) -> int:
    """Nodes for ``exp(j x u)``, -1 <= u <= 1: a fit to the bound of `fading` from its upper side.

    >>> node_count(0.0), node_count(math.pi)
    (1, 10)
    """
    return 1 if x == 0.0 else math.ceil(x + 3.25 * x ** (1.0 / 3.0) + 2.0)


@compiled
def scattered(turns_per_m: Any, real: Any, imag: Any, place_m: Any, room: Any) -> Any:
    """Field of waves at a place, ``sum_k start_k exp(j 2 pi turns_k place)``.

    Less than a turn is left of each phase, so that single precision is good to 1e-6 of a wave.

    Parameters
    ----------
    turns_per_m, real, imag : float64 [wave]
        Turns of each wave in a metre, and its start.
    place_m : float
    room : float64 [2, wave]
        Overwritten.

    Returns
    -------
    float, float
        Real and imaginary part.
    """
    left = turns_per_m.shape[0]
    for wave in range(left):
        cosine, sine = phasor_of_turns(place_m * turns_per_m[wave])
        room[0, wave] = real[wave] * cosine - imag[wave] * sine
        room[1, wave] = real[wave] * sine + imag[wave] * cosine
    # Pairwise, which is done side by side.
    while left > 1:
        half = (left + 1) // 2
        for wave in range(left - half):
            room[0, wave] += room[0, wave + half]
            room[1, wave] += room[1, wave + half]
        left = half
    return room[0, 0], room[1, 0]


@compiled
def _to_coefficients(values: Any, zeros: Any, out: Any) -> None:
    """From ``values`` [pair, part, node] at the zeros to coefficients [pair, part, order]."""
    pairs, parts, nodes = values.shape
    orders = np.ones((nodes, nodes))
    for node in range(nodes):
        if nodes > 1:
            orders[1, node] = zeros[node]
        for order in range(2, nodes):
            last, before = orders[order - 1, node], orders[order - 2, node]
            orders[order, node] = 2.0 * zeros[node] * last - before
    for pair in range(pairs):
        for part in range(parts):
            for order in range(nodes):
                total = 0.0
                for node in range(nodes):
                    total += values[pair, part, node] * orders[order, node]
                out[pair, part, order] = total * ((2.0 if order else 1.0) / nodes)


@compiled
def add_pieces(
    pieces: Any,
    overlaps: Any,
    count: Any,
    clock: Any,
    ways: Any,
    sights: Any,
    amplitudes: Any,
    waves: Any,
    direct: Any,
    polynomials: Any,
    sent: Any,
    heard: Any,
) -> None:
    """Add what pieces of ``count`` samples bring to what is heard.

    Parameters
    ----------
    pieces : int64 [piece, 7]
        Slot of the link, base station, train, first sample in the tick, first column in ``sent``,
        rows of ``overlaps`` from and to.
    overlaps : int64 [overlap, 3]
        Samples of the piece from and to, and the column of ``heard`` of the first.
    count : int
    clock : float, float, float
        Length of a tick [s], samples in a second, least distance [m].
    ways : float64 [3, train]
        Way at the end of the tick [m], speed [m/s], acceleration [m/s^2].
    sights : float64 [2, base, train]
        Distance [m] and the cosine of the line of sight.
    amplitudes : float64 [2, base, train]
        Gains without fading at the begin and at the end of the tick.
    waves : float64 [slot, 3, pair, wave]
        Turns in a metre, real and imaginary part of the start; scaled.
    direct : float64 [slot, 1 + 2 pair]
        Turns of the carrier in a metre; real and imaginary parts of the line of sight; scaled.
    polynomials : float32 [order, count]
        Chebyshev polynomials from -1 to 1, as many as the largest number of nodes.
    sent : float32 [2, tx, column]
        Real and imaginary parts.
    heard : float32 [rx, 2 column]
        Real and imaginary parts in turn.
    """
    tick_s, rate_hz, least_m = clock
    transmit, receive = sent.shape[1], heard.shape[0]
    pairs = transmit * receive
    room = np.empty((2, waves.shape[3]))
    gain_real, gain_imag = np.empty(count, np.float32), np.empty(count, np.float32)
    sum_real, sum_imag = np.empty(count, np.float32), np.empty(count, np.float32)
    for piece in range(len(pieces)):
        slot, base, train = pieces[piece, 0], pieces[piece, 1], pieces[piece, 2]
        begin, sent_at = pieces[piece, 3], pieces[piece, 4]
        speed_mps, half_mps2 = ways[1, train], 0.5 * ways[2, train]
        carrier_turns = direct[slot, 0]
        start_s, stop_s = begin / rate_hz, (begin + count - 1) / rate_hz
        first_s, last_s = start_s - tick_s, stop_s - tick_s
        first_m = (speed_mps + half_mps2 * first_s) * first_s
        last_m = (speed_mps + half_mps2 * last_s) * last_s
        nodes = node_count(math.pi * carrier_turns * abs(last_m - first_m))
        values = np.empty((pairs, 2, nodes))
        zeros = np.empty(nodes)
        for node in range(nodes):
            zeros[node] = math.cos(math.pi * (node + 0.5) / nodes)
            time_s = start_s + 0.5 * (stop_s - start_s) * (1.0 + zeros[node])
            after_s = time_s - tick_s
            moved_m = (speed_mps + half_mps2 * after_s) * after_s
            away_m, sight = sights[0, base, train], sights[1, base, train]
            square = away_m * away_m + moved_m * (2.0 * away_m * sight + moved_m)
            distance_m = math.sqrt(max(square, least_m * least_m))
            cosine, minus_sine = phasor_of_turns(carrier_turns * distance_m)
            at_begin, at_end = amplitudes[0, base, train], amplitudes[1, base, train]
            amplitude = at_begin + (at_end - at_begin) * (time_s / tick_s)
            for pair in range(pairs):
                real, imag = scattered(
                    waves[slot, 0, pair],
                    waves[slot, 1, pair],
                    waves[slot, 2, pair],
                    ways[0, train] + moved_m,
                    room,
                )
                sight_real, sight_imag = direct[slot, 1 + 2 * pair], direct[slot, 2 + 2 * pair]
                real += sight_real * cosine + sight_imag * minus_sine
                imag += sight_imag * cosine - sight_real * minus_sine
                values[pair, 0, node] = amplitude * real
                values[pair, 1, node] = amplitude * imag
        coefficients = np.empty((pairs, 2, nodes), np.float32)
        _to_coefficients(values, zeros, coefficients)
        for rx in range(receive):
            for i in range(count):
                sum_real[i] = sum_imag[i] = np.float32(0.0)
            for tx in range(transmit):
                pair = rx * transmit + tx
                for i in range(count):
                    gain_real[i] = coefficients[pair, 0, 0]
                    gain_imag[i] = coefficients[pair, 1, 0]
                for order in range(1, nodes):
                    real, imag = coefficients[pair, 0, order], coefficients[pair, 1, order]
                    for i in range(count):
                        gain_real[i] += real * polynomials[order, i]
                        gain_imag[i] += imag * polynomials[order, i]
                for i in range(count):
                    x, y = sent[0, tx, sent_at + i], sent[1, tx, sent_at + i]
                    sum_real[i] += gain_real[i] * x - gain_imag[i] * y
                    sum_imag[i] += gain_real[i] * y + gain_imag[i] * x
            for overlap in range(pieces[piece, 5], pieces[piece, 6]):
                low, high, at = overlaps[overlap, 0], overlaps[overlap, 1], overlaps[overlap, 2]
                for i in range(high - low):
                    heard[rx, 2 * (at + i)] += sum_real[low + i]
                    heard[rx, 2 * (at + i) + 1] += sum_imag[low + i]
