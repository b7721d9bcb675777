"""Space-time schemes of the train radio: SISO, MRC 1x2, Alamouti 2x1 and 2x2.

An et al., equations 1-9, with their errata. Over two symbol times the antennas send (eq. 1)

    antenna 1:  x1, -x2*        antenna 2:  x2, x1*

and receive antenna r, with ``y_{t,r}`` (time, receiver) and ``h_{r,a}`` (receiver, antenna), gets

    y_{1,r} =  h_{r,1} x1  + h_{r,2} x2  + z_{1,r}
    y_{2,r} = -h_{r,1} x2* + h_{r,2} x1* + z_{2,r}        (4 and 7; eq. 4 prints +h1 x2*)

The matched filter, of which eq. 6 leaves the numerator undefined, is

    x~1 = sum_r h_{r,1}* y_{1,r} + h_{r,2} y_{2,r}*
    x~2 = sum_r h_{r,2}* y_{1,r} - h_{r,1} y_{2,r}*       (6 and 8)

and what is decided is ``x~ / sum_{r,a} |h_{r,a}|^2`` (9, which prints ``|h_22|^2`` twice for x1
where one must be ``|h_12|^2``).

**Power.** The total transmit power is the same in all schemes: with two antennas each sends
``1 / sqrt(2)`` of the amplitude. SNR, Es/N0 and Eb/N0 are per receive branch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.compiled import compiled


@dataclass(frozen=True)
class Scheme:
    """How symbols go over the antennas; take one from :func:`scheme`.

    Attributes
    ----------
    name
        Key of :func:`scheme`.
    transmit
        Transmit antennas, 1 (plain) or 2 (Alamouti).
    receive
        Receive antennas, combined to the largest ratio of signal to noise.

    Examples
    --------
    >>> (scheme("alamouti_2x1").encode([1, 2]) * 2**0.5).round(12).tolist()
    [[(1+0j), (-2+0j)], [(2+0j), (1+0j)]]
    """

    name: str
    transmit: int
    receive: int

    def __post_init__(self) -> None:
        """Validate the counts of antennas."""
        if self.transmit not in (1, 2):
            raise ValueError(f"transmit must be 1 or 2 antennas, got {self.transmit!r}")
        if self.receive < 1:
            raise ValueError(f"receive must be 1 antenna or more, got {self.receive!r}")

    @property
    def diversity(self) -> int:
        """Independent branches that carry each symbol."""
        return self.transmit * self.receive

    def encode(self, symbols: ArrayLike) -> ComplexArray:
        """Symbols of each antenna (eq. 1), the total power being that of `symbols`.

        Parameters
        ----------
        symbols : complex [..., n]
            n must be even with two antennas.

        Returns
        -------
        complex128 [..., tx, n]
        """
        x = np.asarray(symbols, dtype=np.complex128)
        self._check_length("symbols", x.shape)
        if self.transmit == 1:
            return np.array(x[..., None, :])
        sent = np.empty((*x.shape[:-1], 2, x.shape[-1]), dtype=np.complex128)
        _encoded(
            np.ascontiguousarray(x).reshape(-1, x.shape[-1]), sent.reshape(-1, *sent.shape[-2:])
        )
        return sent

    def combine(self, received: ArrayLike, channel: ArrayLike) -> tuple[ComplexArray, FloatArray]:
        """Matched filter of the scheme (eqs 6, 8, 9).

        Each received symbol is weighted with the channel of its own time. For a constant channel
        that is the paper's filter, the maximum-likelihood one. Where the channel differs between
        the two times of an Alamouti pair, x1 is estimated without bias but x2 leaks into it by
        ``sum_r (h_{r,1}*(t1) h_{r,2}(t1) - h_{r,1}*(t2) h_{r,2}(t2)) / (tx gain)``, and x1 into
        x2 by the conjugate over that symbol's gain.

        Parameters
        ----------
        received : complex [..., rx, n]
        channel : complex [..., rx, tx, n]
            Gains h, without the fraction of power of an antenna. Leading axes broadcast.

        Returns
        -------
        symbols : complex128 [..., n]
            Estimates; without noise and with a constant channel the symbols sent. 0 where the
            gain is 0.
        gain : float64 [..., n]
            ``sum |h|^2 / tx`` over the branches of a symbol: noise of variance N0 per receive
            antenna becomes ``N0 / gain`` in `symbols`.
        """
        y = np.ascontiguousarray(received, dtype=np.complex128)
        h = np.asarray(channel, dtype=np.complex128)
        self._check_length("received", y.shape)
        n = y.shape[-1]
        if y.ndim < 2 or y.shape[-2] != self.receive:
            raise ValueError(f"received must be [..., {self.receive}, n], got shape {y.shape}")
        if h.ndim < 3 or h.shape[-3:] != (self.receive, self.transmit, n):
            raise ValueError(
                f"channel must be [..., {self.receive}, {self.transmit}, {n}], got shape {h.shape}"
            )
        lead = y.shape[:-2]
        if h.shape[:-3] != lead:
            lead = np.broadcast_shapes(lead, h.shape[:-3])
            y = np.broadcast_to(y, (*lead, *y.shape[-2:]))
            h = np.broadcast_to(h, (*lead, *h.shape[-3:]))
        symbols = np.empty((*lead, n), dtype=np.complex128)
        gain = np.empty((*lead, n))
        _combined(
            np.ascontiguousarray(y).reshape(-1, self.receive, n),
            np.ascontiguousarray(h).reshape(-1, self.receive, self.transmit, n),
            symbols.reshape(-1, n),
            gain.reshape(-1, n),
        )
        return symbols, gain

    def _check_length(self, name: str, shape: tuple[int, ...]) -> None:
        if not shape or shape[-1] % self.transmit:
            raise ValueError(
                f"{name} must have whole blocks of {self.transmit} on its last axis,"
                f" got shape {shape}"
            )


@compiled
def _encoded(x: ComplexArray, sent: ComplexArray) -> None:
    """Code of eq. 1: symbols complex128 [burst, n] to the antennas' [burst, 2, n], the result."""
    amplitude = math.sqrt(0.5)
    for burst in range(len(x)):
        first, second = sent[burst]
        for i in range(0, x.shape[1], 2):
            a, b = x[burst, i] * amplitude, x[burst, i + 1] * amplitude
            first[i], first[i + 1] = a, -b.conjugate()
            second[i], second[i + 1] = b, a.conjugate()


@compiled
def _combined(y: ComplexArray, h: ComplexArray, symbols: ComplexArray, gain: FloatArray) -> None:
    """Sums of eq. 8 over the weights they carry.

    Parameters
    ----------
    y : complex128 [burst, rx, n]
    h : complex128 [burst, rx, tx, n]
    symbols : complex128 [burst, n]
        Result.
    gain : float64 [burst, n]
        Result.
    """
    bursts, receive, transmit, count = h.shape
    amplitude, power = math.sqrt(1.0 / transmit), 1.0 / transmit
    symbols[:] = 0.0
    gain[:] = 0.0
    for burst in range(bursts):
        x, g = symbols[burst], gain[burst]
        for r in range(receive):
            z, h1, h2 = y[burst, r], h[burst, r, 0], h[burst, r, transmit - 1]
            if transmit == 1:
                for i in range(count):
                    x[i] += h1[i].conjugate() * z[i]
                    g[i] += _power(h1[i])
            else:
                for i in range(0, count, 2):
                    early, late = z[i], z[i + 1].conjugate()
                    x[i] += h1[i].conjugate() * early + h2[i + 1] * late
                    x[i + 1] += h2[i].conjugate() * early - h1[i + 1] * late
                    g[i] += _power(h1[i]) + _power(h2[i + 1])
                    g[i + 1] += _power(h2[i]) + _power(h1[i + 1])
        for i in range(count):
            g[i] *= power
            scale = amplitude / g[i] if g[i] > 0.0 else 0.0
            x[i] = complex(x[i].real * scale, x[i].imag * scale)


@compiled
def _power(gain: complex) -> float:
    return gain.real**2 + gain.imag**2


_SCHEMES: Final = {
    s.name: s
    for s in (
        Scheme("siso", 1, 1),
        Scheme("mrc", 1, 2),
        Scheme("alamouti_2x1", 2, 1),
        Scheme("alamouti_2x2", 2, 2),
    )
}


def scheme(name: str) -> Scheme:
    """Look a scheme up: "siso", "mrc", "alamouti_2x1" or "alamouti_2x2".

    Raises
    ------
    ValueError
        If there is none of that name; the message quotes it.

    Examples
    --------
    >>> scheme("mrc").diversity, scheme("alamouti_2x2").diversity
    (2, 4)
    """
    try:
        return _SCHEMES[name]
    except (KeyError, TypeError):
        raise ValueError(f"name must be one of {', '.join(_SCHEMES)}, got {name!r}") from None
