"""Rails as a transmission line: what ballast and axles do to an audio-frequency current.

| symbol | meaning | unit |
|---|---|---|
| L | inductance of both rails | H/km |
| R | leakage resistance of the ballast | ohm km |
| r | resistance of the axles of a train from rail to rail | ohm |

At audio frequencies the reactance of the rails far exceeds their resistance, and the leakage of
the ballast its susceptance, so that with the constants of propagation and of impedance

    gamma = sqrt(j w L / R)        attenuation = Re gamma = sqrt(w L / (2 R))      [Np/km]
    Z     = sqrt(j w L R)                                                          [ohm]

and a resistance r across a line that goes on to both sides leaves 1 / |1 + Z / (2 r)|. The
inductance is a usual value; circuits with capacitors along the rails attenuate less than their
ballast alone would, and then have a higher equivalent R.
"""

from __future__ import annotations

import cmath
import math
from typing import Final

#: Inductance of a track [H/km].
INDUCTANCE_H_PER_KM: Final = 1.3e-3
_DB_PER_NEPER: Final = 20.0 / math.log(10.0)


def attenuation_db_per_km(ballast_ohm_km: float, frequency_hz: float) -> float:
    """Attenuation on ballast of a leakage resistance.

    Examples
    --------
    >>> round(attenuation_db_per_km(2.0, 2000.0), 1)
    17.6
    """
    reactance = 2.0 * math.pi * frequency_hz * INDUCTANCE_H_PER_KM
    return _DB_PER_NEPER * math.sqrt(0.5 * reactance / ballast_ohm_km)


def shunt_loss_db(shunt_ohm: float, attenuation_db_per_km: float, frequency_hz: float) -> float:
    """Loss past axles, on rails of an attenuation.

    Examples
    --------
    >>> [round(shunt_loss_db(ohm, 6.0, 2000.0)) for ohm in (0.026, 0.5, 10.0)]
    [50, 25, 5]
    """
    reactance = 2.0 * math.pi * frequency_hz * INDUCTANCE_H_PER_KM
    neper_per_km = max(attenuation_db_per_km, 1e-3) / _DB_PER_NEPER
    ballast_ohm_km = 0.5 * reactance / neper_per_km**2
    impedance = cmath.sqrt(1j * reactance * ballast_ohm_km)
    return 20.0 * math.log10(abs(1.0 + 0.5 * impedance / shunt_ohm))
