"""Fast simulation of code blocks of two BPSK or QPSK symbols through a fading link.

Each code block draws its bits, a channel for every pair of antennas and the noise of every
receiver and symbol; sends the symbols (eq 1), adds up what each receiver hears (eqs 4, 7,
corrected), combines it with the first symbol's channel (eqs 6, 8) and decides by the signs
(eq 9; the divisor is positive).

Speed comes from how it is computed. Values are float32, real and imaginary parts apart, in
buffers that stay in the cache. In real numbers both transmission and combining are products
with one matrix G of +-Re h and +-Im h per code block,

    y = G s + z,   s~ = G^T y,   s = (Re x1, Re x2, Im x2, Im x1),

in this order of s a *sliding window* over six rows, (h1, h2, -h1) and (j h2, j h1, -j h2):
one `einsum` each without a copy of G. G^T G is the identity times the branches' energy by
eq 2, but nothing here relies on that: s~ is computed from y.

Normal deviates are those of Box and Muller from one word of 32 bits w per pair: radius
``sqrt(-ln u)``, ``u = (w | 1) / 2^32``, direction by the low 8 bits of w. So the radius
reaches 6.7 standard deviations of one part; beyond 5.7 (probability 6e-8), where u has only 8
bits left, it depends on the direction. Means over 256 equal directions are the midpoint
rule for Craig's integral: Q(x) comes out within 1e-6 of itself up to x = 6.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.random import BitGenerator
from numpy.typing import NDArray

from rail_signals.arrays import ComplexArray
from rail_signals.train_radio.space_time_block import Scheme

SingleArray: TypeAlias = NDArray[np.float32]

_SCALE = np.float32(2.0**-32)
_TURN = np.float32(2 * math.pi / 256)
_BYTE = np.uint32(255)


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
        Code blocks per step, a multiple of 8.

    Raises
    ------
    ValueError
        If a parameter is out of range; the message quotes it.

    Examples
    --------
    >>> from rail_signals.train_radio.ber.closed_form import ALAMOUTI_2X2
    >>> link = DiversityLink(ALAMOUTI_2X2, math.inf)
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
        if code_blocks < 8 or code_blocks % 8:
            raise ValueError(f"code_blocks must be a multiple of 8, got {code_blocks!r}")
        self.scheme = scheme
        self.bits_per_symbol = bits_per_symbol
        self.correlation = correlation
        n, tx, rx, parts = code_blocks, scheme.transmit, scheme.receive, bits_per_symbol
        self.bits_per_step = 2 * parts * n
        self._blocks = n
        self._moves = correlation < 1
        links = tx * rx * (2 if self._moves else 1)
        self._links, self._pairs = links, links + 2 * rx
        # Powers by which each pair's squared radius is scaled, negative as log u is. A bit has
        # energy 1 in all; the transmitters' shares are in the noise.
        self._link_powers = np.full((links, 1), -1, dtype=np.float32)
        self._link_powers[tx * rx :] = correlation**2 - 1
        self._noise_power = np.float32(-tx / eb_n0)

        def buffer(*shape: int) -> SingleArray:
            return np.zeros((*shape, n), dtype=np.float32)

        self._word = np.empty((self._pairs, n), dtype=np.uint32)
        self._radius = buffer(self._pairs)
        self._direction = buffer(2, self._pairs)
        self._noise = buffer(rx, 2, 2)
        self._received, self._symbol, self._estimated = (
            buffer(rx, 2, 2),
            buffer(parts, 2),
            buffer(parts, 2),
        )
        self._rows = [buffer(rx, parts, 3 if tx == 2 else 1, 2) for _ in range(1 + self._moves)]
        self._matrices = [self._window(rows) for rows in self._rows]
        self._shift = (1 << np.arange(2 * parts)).astype(np.int8).reshape(parts, 2, 1)
        self._sign = np.empty((parts, 2, n), dtype=np.int8)
        self._sent = np.empty((parts, 2, n), dtype=np.bool_)
        self._decided = np.empty((parts, 2, n), dtype=np.bool_)
        self._wrong = np.empty((parts, 2, n), dtype=np.bool_)
        self._count = np.empty(n, dtype=np.uint8)
        self._squares = np.empty(n, dtype=np.float32)

    def step(self, generator: BitGenerator) -> tuple[int, int]:
        """Simulate `code_blocks` blocks.

        Returns
        -------
        errors, squares
            Wrong bits, and the sum over code blocks of the square of their number: bits of a
            block share a channel, so that errors come in groups.
        """
        # The generator's own arrays are the only memory taken; draws are used where they lie.
        self._draw_bits(generator.random_raw(self._blocks // 8).view(np.int8))
        self._draw_fading(generator.random_raw(self._pairs * self._blocks // 2).view(np.uint32))
        self._transmit()
        self._combine()
        return self._compare()

    def _draw_bits(self, octets: NDArray[np.int8]) -> None:
        # Bit 7 - k of an octet becomes the sign of row k; products are faster than shifts.
        np.multiply(octets, self._shift, out=self._sign)
        np.less(self._sign, 0, out=self._sent)
        np.right_shift(self._sign, 7, out=self._sign)
        np.bitwise_or(self._sign, 1, out=self._sign)
        np.copyto(self._symbol, self._sign)

    def _draw_fading(self, words: NDArray[np.uint32]) -> None:
        """Channels and noise: complex normal deviates by Box and Muller."""
        words = words.reshape(self._word.shape)
        radius, (cosine, sine), links = self._radius, self._direction, self._links
        np.bitwise_and(words, _BYTE, out=self._word)
        np.copyto(cosine, self._word, casting="unsafe")
        np.multiply(cosine, _TURN, out=cosine)
        np.sin(cosine, out=sine)
        np.cos(cosine, out=cosine)
        np.bitwise_or(words, np.uint32(1), out=self._word)  # never zero
        np.copyto(radius, self._word, casting="unsafe")
        np.multiply(radius, _SCALE, out=radius)
        np.log(radius, out=radius)
        np.multiply(radius[:links], self._link_powers, out=radius[:links])
        np.multiply(radius[links:], self._noise_power, out=radius[links:])
        np.sqrt(radius, out=radius)
        tx, rx, n = self.scheme.transmit, self.scheme.receive, self._blocks
        first = 0
        for rows in self._rows:
            some = slice(first, first + tx * rx)
            first += tx * rx
            shape = (rx, tx, 1, n)
            np.multiply(radius[some].reshape(shape), self._parts(some, rx, tx), out=rows[:, 0, :tx])
        np.multiply(
            radius[links:].reshape(rx, 2, 1, n),
            self._parts(slice(links, None), rx, 2),
            out=self._noise,
        )
        if self._moves:
            now, later = (rows[:, 0, :tx] for rows in self._rows)
            scaled = self._direction.reshape(-1)[: now.size].reshape(now.shape)  # not needed again
            np.multiply(now, np.float32(self.correlation), out=scaled)
            np.add(later, scaled, out=later)
        for rows in self._rows:
            self._complete(rows)

    def _parts(self, pairs: slice, *shape: int) -> SingleArray:
        """Cosine and sine of some pairs: a view [*shape, 2, code blocks]."""
        part = self._direction[:, pairs].reshape(2, *shape, self._blocks)
        return np.moveaxis(part, 0, -2)

    def _complete(self, rows: SingleArray) -> None:
        """Rows of the window from (h1, h2): -h1, and j times h2, h1, -h2."""
        alamouti = self.scheme.transmit == 2
        if alamouti:
            np.negative(rows[:, 0, 0], out=rows[:, 0, 2])
        if self.bits_per_symbol == 2:
            turned = rows[:, 0, 1::-1] if alamouti else rows[:, 0]
            np.copyto(rows[:, 1, : turned.shape[1], 1], turned[:, :, 0])
            np.negative(turned[:, :, 1], out=rows[:, 1, : turned.shape[1], 0])
            if alamouti:
                np.negative(rows[:, 1, 0], out=rows[:, 1, 2])

    def _window(self, rows: SingleArray) -> SingleArray:
        """G as a view of its rows: [receiver, part of s, symbol, (time,) part of y, block]."""
        if self.scheme.transmit == 1:
            return rows[:, :, 0]
        rx, parts, _, _, n = rows.shape
        r, q, slot, c, b = rows.strides
        return as_strided(rows, (rx, parts, 2, 2, 2, n), (r, q, slot, slot, c, b))

    def _transmit(self) -> None:
        received = self._received
        if self.scheme.transmit == 1:
            if self._moves:
                for t, matrix in enumerate(self._matrices):
                    np.einsum("rqcn,qn->rcn", matrix, self._symbol[:, t], out=received[:, t])
            else:
                np.einsum("rqcn,qtn->rtcn", self._matrices[0], self._symbol, out=received)
        elif self._moves:
            for t, matrix in enumerate(self._matrices):
                np.einsum("rqmcn,qmn->rcn", matrix[:, :, :, t], self._symbol, out=received[:, t])
        else:
            np.einsum("rqmtcn,qmn->rtcn", self._matrices[0], self._symbol, out=received)
        np.add(received, self._noise, out=received)

    def _combine(self) -> None:
        form = "rqcn,rtcn->qtn" if self.scheme.transmit == 1 else "rqmtcn,rtcn->qmn"
        np.einsum(form, self._matrices[0], self._received, out=self._estimated)

    def _compare(self) -> tuple[int, int]:
        np.less(self._estimated, 0, out=self._decided)
        np.not_equal(self._decided, self._sent, out=self._wrong)
        errors = int(np.count_nonzero(self._wrong))
        if not errors:
            return 0, 0
        octets = self._wrong.view(np.uint8).reshape(-1, self._blocks)
        np.add.reduce(octets, axis=0, dtype=np.uint8, out=self._count)
        np.copyto(self._squares, self._count)
        return errors, int(np.dot(self._squares, self._squares))

    def last(self) -> dict[str, Any]:
        """What the last step drew and decided, for a check by other means.

        Returns
        -------
        dict
            ``sent``, ``decided`` bool [symbol, part, block], true for a negative part;
            ``channel`` complex [time, receiver, transmitter, block]; ``noise`` complex
            [receiver, time, block], its power the mean of ``N_t / eb_n0``.
        """
        tx = self.scheme.transmit
        channels = [_complex(rows[:, 0, :tx]) for rows in self._rows]
        return {
            "sent": self._by_symbol(self._sent),
            "decided": self._by_symbol(self._decided),
            "channel": np.stack([channels[0], channels[-1]]),
            "noise": _complex(self._noise),
        }

    def _by_symbol(self, rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
        parts: NDArray[np.bool_] = rows.transpose(1, 0, 2).copy()
        if self.scheme.transmit == 2 and self.bits_per_symbol == 2:
            parts[:, 1] = parts[::-1, 1].copy()  # s ends with Im x2, Im x1
        return parts


def _complex(parts: SingleArray) -> ComplexArray:
    """[..., 2, block] to complex [..., block]."""
    return parts[..., 0, :].astype(np.float64) + 1j * parts[..., 1, :].astype(np.float64)
