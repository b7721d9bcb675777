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
    def antenna_power(self) -> float:
        """Fraction of the transmit power that each antenna sends."""
        return 1.0 / self.transmit

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
        first, second = x[..., 0::2], x[..., 1::2]
        sent[..., 0, 0::2] = first
        sent[..., 0, 1::2] = -second.conj()
        sent[..., 1, 0::2] = second
        sent[..., 1, 1::2] = first.conj()
        sent *= math.sqrt(self.antenna_power)
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
        y = np.asarray(received, dtype=np.complex128)
        h = np.asarray(channel, dtype=np.complex128)
        self._check_length("received", y.shape)
        n = y.shape[-1]
        if y.ndim < 2 or y.shape[-2] != self.receive:
            raise ValueError(f"received must be [..., {self.receive}, n], got shape {y.shape}")
        if h.ndim < 3 or h.shape[-3:] != (self.receive, self.transmit, n):
            raise ValueError(
                f"channel must be [..., {self.receive}, {self.transmit}, {n}], got shape {h.shape}"
            )
        power = h.real**2 + h.imag**2
        if self.transmit == 1:
            matched = np.sum(h[..., 0, :].conj() * y, axis=-2)
            gain = np.sum(power[..., 0, :], axis=-2)
        else:
            matched, gain = _alamouti(y, h, power)
        matched = matched * math.sqrt(self.antenna_power)
        gain = gain * self.antenna_power
        gain = np.broadcast_to(gain, matched.shape).copy()
        known = gain > 0
        symbols = np.divide(matched, gain, out=np.zeros_like(matched), where=known)
        return symbols, gain

    def _check_length(self, name: str, shape: tuple[int, ...]) -> None:
        if not shape or shape[-1] % self.transmit:
            raise ValueError(
                f"{name} must have whole blocks of {self.transmit} on its last axis,"
                f" got shape {shape}"
            )


def _alamouti(
    y: ComplexArray, h: ComplexArray, power: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Sums of eq. 8 [..., n] and the weights they carry, before the fraction of power."""
    y1, y2 = y[..., 0::2], y[..., 1::2].conj()
    early, late = h[..., 0::2], h[..., 1::2]
    x1 = np.sum(early[..., 0, :].conj() * y1 + late[..., 1, :] * y2, axis=-2)
    x2 = np.sum(early[..., 1, :].conj() * y1 - late[..., 0, :] * y2, axis=-2)
    matched = np.stack([x1, x2], axis=-1).reshape(*x1.shape[:-1], 2 * x1.shape[-1])
    early_power, late_power = power[..., 0::2], power[..., 1::2]
    g1 = np.sum(early_power[..., 0, :] + late_power[..., 1, :], axis=-2)
    g2 = np.sum(early_power[..., 1, :] + late_power[..., 0, :], axis=-2)
    return matched, np.stack([g1, g2], axis=-1).reshape(*g1.shape[:-1], 2 * g1.shape[-1])


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
