"""Flat MIMO fading as a function of the distance the train has travelled.

The field of scattered waves stands along the track and the train moves through it: the gain from
transmit antenna a to receive antenna r depends on the place s alone,

    h_{r,a}(s) = sqrt(1 / (K + 1)) sum_k exp(j (2 pi s cos(alpha_k) / lambda + phi_k)) / sqrt(N)
               + sqrt(K / (K + 1)) exp(j (2 pi s c / lambda + theta_r + theta_a))

so that it runs on over ticks and bursts, changes of speed included, and a standing train has a
constant channel. At a speed v the scattered part has the spectrum of Jakes up to
``f_D = v / lambda`` and the autocorrelation ``J0(2 pi f_D tau) = J0(2 pi d / lambda)``.

========= ==============================================================================
s, d      distance travelled, difference of two [m]
lambda    wavelength [m]
N         scattered waves per pair of antennas
alpha_k   angle between wave k and the track: uniform within the k-th of N equal parts of
          the half-circle, so that the expectation is J0 exactly and one draw lies near it
K         Rician factor (linear): power of the line of sight over the scattered; 0 = Rayleigh
c         direction cosine of the line of sight, 1 straight ahead
========= ==============================================================================
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.phasors import cis

_CELLS_PER_WAVELENGTH = 8
_TERMS = 9


def maximum_doppler_hz(speed_mps: float, carrier_hz: float) -> float:
    """Largest Doppler shift ``f_D = v f / c`` [Hz] at a speed [m/s] and a carrier [Hz].

    Examples
    --------
    >>> round(maximum_doppler_hz(300 / 3.6, 2.4e9))
    667
    """
    return speed_mps * carrier_hz / SPEED_OF_LIGHT_M_PER_S


class MimoFading:
    """One draw of the field between two groups of antennas.

    Pairs of antennas fade independently, as with antennas many wavelengths apart. Of the line of
    sight the phases are those of a plane wave, ``theta_r + theta_a``: it has rank one.

    The sum of waves is formed at places an eighth of a wavelength apart and continued from the
    nearest by nine terms of its Taylor series. With ``x = pi / 8`` the error is below
    ``x^9 / 9! = 6e-10`` times the sum of the waves' amplitudes (sqrt(N)); rounding adds 1e-8 at
    1000 km. The places are fixed on the track: a result does not depend on what else is asked for.

    With N waves ``E|h|^4 = 2 - 1 / N`` in place of 2 of a Gaussian field.

    Parameters
    ----------
    rng
        Draws angles and phases, in the constructor alone.
    receive, transmit
        Counts of antennas.
    wavelength_m
        Wavelength of the carrier [m].
    rician_factor
        K (linear), not negative.
    waves
        Scattered waves N per pair, at least 8.
    line_of_sight_cosine
        Direction cosine c of the line of sight, -1 to 1.

    Raises
    ------
    ValueError
        If a parameter is out of range; the message quotes it.

    Examples
    --------
    >>> fading = MimoFading(np.random.default_rng(1), 2, 2, 0.125)
    >>> h = fading.at(np.linspace(0.0, 200.0, 2000))
    >>> h.shape, (abs(h) ** 2).mean(axis=-1).round(1).tolist()
    ((2, 2, 2000), [[1.0, 1.0], [1.0, 1.0]])
    """

    def __init__(
        self,
        rng: np.random.Generator,
        receive: int,
        transmit: int,
        wavelength_m: float,
        rician_factor: float = 0.0,
        waves: int = 32,
        line_of_sight_cosine: float = 1.0,
    ) -> None:
        for name, count, least in (
            ("receive", receive, 1),
            ("transmit", transmit, 1),
            ("waves", waves, 8),
        ):
            if isinstance(count, bool) or count != int(count) or count < least:
                raise ValueError(f"{name} must be an integer from {least}, got {count!r}")
        if not (math.isfinite(wavelength_m) and wavelength_m > 0):
            raise ValueError(f"wavelength_m must be finite and above zero, got {wavelength_m!r}")
        if not (math.isfinite(rician_factor) and rician_factor >= 0):
            raise ValueError(
                f"rician_factor must be finite and not negative, got {rician_factor!r}"
            )
        if not -1 <= line_of_sight_cosine <= 1:
            raise ValueError(
                f"line_of_sight_cosine must lie between -1 and 1, got {line_of_sight_cosine!r}"
            )
        self.receive = int(receive)
        self.transmit = int(transmit)
        self.wavelength_m = float(wavelength_m)
        pairs = (self.receive, self.transmit)
        angle = math.pi * (np.arange(waves) + rng.uniform(size=(*pairs, waves))) / waves
        phase = 2 * math.pi * rng.uniform(size=(*pairs, waves))
        of_rx, of_tx = rng.uniform(size=self.receive), rng.uniform(size=self.transmit)
        cosine = np.cos(angle)
        start: ComplexArray = cis(phase) / math.sqrt(waves * (rician_factor + 1))
        if rician_factor > 0:
            direct = math.sqrt(rician_factor / (rician_factor + 1))
            sight = direct * cis(2 * math.pi * (of_rx[:, None] + of_tx))
            start = np.concatenate([start, sight[..., None]], axis=-1)
            ahead = np.full((*pairs, 1), float(line_of_sight_cosine))
            cosine = np.concatenate([cosine, ahead], axis=-1)
        # [pairs, waves]: turns of a wave from one cell to the next, its start, Taylor terms.
        self._turns = cosine.reshape(-1, cosine.shape[-1]) / _CELLS_PER_WAVELENGTH
        slope = np.asarray(2j * math.pi * self._turns, dtype=np.complex128)
        term: ComplexArray = start.reshape(slope.shape)
        self._terms = [term]
        for m in range(1, _TERMS):
            term = term * slope / m
            self._terms.append(term)

    def at(self, distance_m: ArrayLike) -> ComplexArray:
        """Gains at places along the track, of unit mean power.

        Parameters
        ----------
        distance_m : [..., n]
            Distance travelled [m], in any order.

        Returns
        -------
        complex128 [..., rx, tx, n]

        Raises
        ------
        ValueError
            If there is no axis or a distance is not finite.
        """
        place = np.asarray(distance_m, dtype=np.float64)
        if place.ndim == 0:
            raise ValueError(f"distance_m must have an axis, got {distance_m!r}")
        if not np.isfinite(place).all():
            raise ValueError("distance_m must be finite")
        cells = place.ravel() * (_CELLS_PER_WAVELENGTH / self.wavelength_m)
        nearest = np.rint(cells)
        numbers, index = np.unique(nearest, return_inverse=True)
        offset = cells - nearest
        turns = numbers[:, None] * self._turns[:, None, :]
        # Sums over one axis of fixed length: to the last bit the same however many cells there are.
        waves = cis(2 * math.pi * (turns - np.rint(turns)))
        field = np.zeros((len(self._turns), offset.size), dtype=np.complex128)
        for term in reversed(self._terms):
            field *= offset
            field += np.take((waves * term[:, None, :]).sum(axis=-1), index, axis=1)
        shape = (self.receive, self.transmit, *place.shape)
        return np.ascontiguousarray(np.moveaxis(field.reshape(shape), (0, 1), (-3, -2)))

    @property
    def waves(self) -> tuple[FloatArray, ComplexArray]:
        """The waves themselves, for sums wave by wave at places far apart.

        Returns
        -------
        turns_per_m : float64 [rx, tx, wave]
            Turns of each wave along a metre of track.
        start : complex128 [rx, tx, wave]
            Each wave at the distance 0.
        """
        shape = (self.receive, self.transmit, -1)
        turns_per_m = self._turns * (_CELLS_PER_WAVELENGTH / self.wavelength_m)
        return turns_per_m.reshape(shape), self._terms[0].reshape(shape)
