"""Fast simulation of code blocks of two BPSK or QPSK symbols through a fading link.

Each code block draws its bits, a channel for every pair of antennas and the noise of every
receiver and symbol; sends the symbols (eq 1), adds up what each receiver hears (eqs 4, 7,
corrected), combines it with the first symbol's channel (eqs 6, 8) and decides by the signs
(eq 9; the divisor is positive).

A compiled kernel does that in single precision for `LANES` code blocks at a time, in buffers that
stay in the first-level cache. Symbols have the parts +-1; G^H G is the identity times the
branches' energy by eq 2, but nothing here relies on that: what is decided is computed from what
was received.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import BitGenerator

from rail_signals.arrays import ComplexArray
from rail_signals.compiled import compiled
from rail_signals.train_radio.space_time_block import Scheme

from .deviates import SingleArray, WordArray, draw_words, normal_deviates, seeded_lanes

LANES = 512
"""Code blocks that are simulated side by side."""

_ONE = np.uint32(1)


class DiversityLink:
    """A scheme at one signal-to-noise ratio; `step` simulates some code blocks.

    Parameters
    ----------
    scheme
        Antennas; two transmitters send the code of Alamouti, one repeats nothing.
    eb_n0
        Energy per bit over noise density at each receiver (linear); infinity for none.
    bits_per_symbol
        1 (BPSK) or 2 (QPSK).
    correlation
        Of the channel between the two symbols; 1 if it is constant (eq 3).
    code_blocks
        Code blocks per step, a multiple of `LANES`.

    Raises
    ------
    ValueError
        If a parameter is out of range; the message quotes it.

    Examples
    --------
    >>> from rail_signals.train_radio.ber.closed_form import ALAMOUTI_2X2
    >>> link = DiversityLink(ALAMOUTI_2X2, float("inf"))
    >>> link.step(np.random.SFC64(1)), link.bits_per_step
    ((0, 0), 32768)
    """

    def __init__(
        self,
        scheme: Scheme,
        eb_n0: float,
        *,
        bits_per_symbol: int = 2,
        correlation: float = 1.0,
        code_blocks: int = 8192,
    ) -> None:
        if not eb_n0 > 0:
            raise ValueError(f"eb_n0 must be positive, got {eb_n0!r}")
        if bits_per_symbol not in (1, 2):
            raise ValueError(f"bits_per_symbol must be 1 or 2, got {bits_per_symbol!r}")
        if not 0 <= correlation <= 1:
            raise ValueError(f"correlation must be in [0, 1], got {correlation!r}")
        if code_blocks < LANES or code_blocks % LANES:
            raise ValueError(f"code_blocks must be a multiple of {LANES}, got {code_blocks!r}")
        self.scheme = scheme
        self.bits_per_symbol = bits_per_symbol
        self.correlation = correlation
        self.bits_per_step = 2 * bits_per_symbol * code_blocks
        self._tiles = code_blocks // LANES
        tx, rx = scheme.transmit, scheme.receive
        # A bit has energy 1 in all; the transmitters' shares are in the noise. Powers are negative
        # as the logarithm of a uniform deviate is.
        self._correlation = np.float32(correlation)
        self._innovation_power = np.float32(correlation**2 - 1)
        self._noise_power = np.float32(-tx / eb_n0)
        self._channel = np.zeros((1 + (correlation < 1), rx, tx, 2, LANES), dtype=np.float32)
        self._noise = np.zeros((rx, 2, 2, LANES), dtype=np.float32)
        self._sent = np.zeros((2, 2, LANES), dtype=np.float32)
        self._sums = np.zeros((2, 2, LANES), dtype=np.float32)

    def step(self, generator: BitGenerator) -> tuple[int, int]:
        """Simulate `code_blocks` blocks.

        Returns
        -------
        errors, squares
            Wrong bits, and the sum over code blocks of the square of their number: bits of a
            block share a channel, so that errors come in groups.
        """
        errors, squares = _simulate(
            self._tiles,
            seeded_lanes(generator, LANES),
            self.bits_per_symbol,
            (self._correlation, self._innovation_power, self._noise_power),
            self._channel,
            self._noise,
            self._sent,
            self._sums,
        )
        return int(errors), int(squares)

    def last(self) -> dict[str, Any]:
        """What was drawn and decided for the last `LANES` blocks, for a check by other means.

        Returns
        -------
        dict
            ``sent``, ``decided`` bool [symbol, part, block], true for a negative part;
            ``channel`` complex [time, receiver, transmitter, block]; ``noise`` complex
            [receiver, time, block], its power the mean of ``N_t / eb_n0``.
        """
        parts = self.bits_per_symbol
        return {
            "sent": self._sent[:, :parts] < 0,
            "decided": self._sums[:, :parts] < 0,
            "channel": _complex(self._channel[[0, -1]]),
            "noise": _complex(self._noise),
        }


@compiled
def _simulate(
    tiles: int,
    states: WordArray,
    bits_per_symbol: int,
    powers: tuple[np.float32, np.float32, np.float32],
    channel: SingleArray,
    noise: SingleArray,
    sent: SingleArray,
    sums: SingleArray,
) -> tuple[int, int]:
    """Errors of some tiles, and the sum over code blocks of their squares.

    Parameters
    ----------
    tiles
        Times `LANES` code blocks.
    states : uint32 [4, lanes]
        Generators, carried on.
    bits_per_symbol
        1 or 2.
    powers
        Correlation of the channel between both times; powers of what is new at the second, and of
        the noise, times -1.
    channel : float32 [time, rx, tx, part, lanes]
        One time if it is constant.
    noise : float32 [rx, time, part, lanes]
    sent : float32 [symbol, part, lanes]
        +-1; an imaginary part of BPSK is 0.
    sums : float32 [symbol, part, lanes]
        What the combiner makes of them. All four: results, of the last tile.
    """
    correlation, innovation, noise_power = powers
    _, receive, transmit, _, lanes = channel.shape
    word = np.empty(lanes, dtype=np.uint32)
    uniform, mantissa = np.empty(lanes, dtype=np.float32), np.empty(lanes, dtype=np.float32)
    buffers = uniform, uniform.view(np.int32), mantissa, mantissa.view(np.int32)
    unit = np.float32(-1.0)
    moves = channel.shape[0] == 2
    now, later = channel[0], channel[-1]
    errors, squares = 0, 0
    for _ in range(tiles):
        draw_words(states, word)
        _draw_symbols(word, bits_per_symbol, sent)
        for r in range(receive):
            for a in range(transmit):
                draw_words(states, word)
                normal_deviates(word, unit, *buffers, now[r, a])
                if moves:
                    draw_words(states, word)
                    normal_deviates(word, innovation, *buffers, later[r, a])
                    _move(now[r, a], correlation, later[r, a])
            for time in range(2):
                draw_words(states, word)
                normal_deviates(word, noise_power, *buffers, noise[r, time])
        sums[:] = np.float32(0.0)
        for r in range(receive):
            if transmit == 1:
                for time in range(2):
                    _single(
                        now[r, 0],
                        channel[time * moves, r, 0],
                        noise[r, time],
                        sent[time],
                        sums[time],
                    )
            else:
                _alamouti(now[r], later[r], noise[r], sent, sums)
        more, more_squares = _compare(bits_per_symbol, sent, sums)
        errors += more
        squares += more_squares
    return errors, squares


@compiled
def _draw_symbols(word: WordArray, bits_per_symbol: int, sent: SingleArray) -> None:
    """Parts +-1 [symbol, part, lanes] by the high bits of words."""
    for symbol in range(2):
        for part in range(bits_per_symbol):
            place = np.uint32(31 - 2 * symbol - part)
            row = sent[symbol, part]
            for i in range(len(word)):
                bit = np.int32((word[i] >> place) & _ONE)
                row[i] = np.float32(np.int32(np.int32(1) - np.int32(bit << np.int32(1))))


@compiled
def _move(now: SingleArray, correlation: np.float32, later: SingleArray) -> None:
    """Add to what is new at the second time what has stayed of the first; [part, lanes]."""
    for part in range(2):
        before, after = now[part], later[part]
        for i in range(len(before)):
            after[i] += correlation * before[i]


@compiled
def _single(
    known: SingleArray,
    channel: SingleArray,
    noise: SingleArray,
    sent: SingleArray,
    sums: SingleArray,
) -> None:
    """One transmitter: received, and combined with the known channel; all [part, lanes]."""
    for i in range(sent.shape[1]):
        real = channel[0, i] * sent[0, i] - channel[1, i] * sent[1, i] + noise[0, i]
        imag = channel[0, i] * sent[1, i] + channel[1, i] * sent[0, i] + noise[1, i]
        sums[0, i] += known[0, i] * real + known[1, i] * imag
        sums[1, i] += known[0, i] * imag - known[1, i] * real


@compiled
def _alamouti(
    now: SingleArray, later: SingleArray, noise: SingleArray, sent: SingleArray, sums: SingleArray
) -> None:
    """Two transmitters and one receiver, eqs 1 to 8.

    Parameters
    ----------
    now, later : float32 [tx, part, lanes]
        Channel at both times; the combiner knows the first.
    noise : float32 [time, part, lanes]
    sent, sums : float32 [symbol, part, lanes]
        Sums are added to.
    """
    for i in range(sent.shape[2]):
        a1, b1, a2, b2 = sent[0, 0, i], sent[0, 1, i], sent[1, 0, i], sent[1, 1, i]
        p1, q1, p2, q2 = now[0, 0, i], now[0, 1, i], now[1, 0, i], now[1, 1, i]
        r1, s1, r2, s2 = later[0, 0, i], later[0, 1, i], later[1, 0, i], later[1, 1, i]
        # y1 = h1 x1 + h2 x2 + z1; y2 = -h1 x2* + h2 x1* + z2
        y1 = p1 * a1 - q1 * b1 + p2 * a2 - q2 * b2 + noise[0, 0, i]
        y1_imag = p1 * b1 + q1 * a1 + p2 * b2 + q2 * a2 + noise[0, 1, i]
        y2 = r2 * a1 + s2 * b1 - r1 * a2 - s1 * b2 + noise[1, 0, i]
        y2_imag = s2 * a1 - r2 * b1 - s1 * a2 + r1 * b2 + noise[1, 1, i]
        # x1 = h1* y1 + h2 y2*; x2 = h2* y1 - h1 y2*
        sums[0, 0, i] += p1 * y1 + q1 * y1_imag + p2 * y2 + q2 * y2_imag
        sums[0, 1, i] += p1 * y1_imag - q1 * y1 + q2 * y2 - p2 * y2_imag
        sums[1, 0, i] += p2 * y1 + q2 * y1_imag - p1 * y2 - q1 * y2_imag
        sums[1, 1, i] += p2 * y1_imag - q2 * y1 - q1 * y2 + p1 * y2_imag


@compiled
def _compare(bits_per_symbol: int, sent: SingleArray, sums: SingleArray) -> tuple[int, int]:
    """Wrong bits, and the sum over code blocks of the square of their number."""
    errors, squares = 0, 0
    nothing = np.float32(0.0)
    for i in range(sent.shape[2]):
        wrong = np.int32((sums[0, 0, i] < nothing) != (sent[0, 0, i] < nothing))
        wrong += np.int32((sums[1, 0, i] < nothing) != (sent[1, 0, i] < nothing))
        if bits_per_symbol == 2:
            wrong += np.int32((sums[0, 1, i] < nothing) != (sent[0, 1, i] < nothing))
            wrong += np.int32((sums[1, 1, i] < nothing) != (sent[1, 1, i] < nothing))
        errors += wrong
        squares += wrong * wrong
    return errors, squares


def _complex(parts: SingleArray) -> ComplexArray:
    """[..., part, block] to complex [..., block]."""
    return parts[..., 0, :].astype(np.float64) + 1j * parts[..., 1, :].astype(np.float64)
