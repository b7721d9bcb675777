"""How a fault of a train's bus grows, as steps that are worth a new computation of the line.

With u running from 0 at ``from_s`` to 1 at ``to_s``, a fault has the fraction g of its size:

    linear        g = u
    exponential   g = (K^u - 1) / (K - 1),  K = 1000

A contact that frets is bad for long before it gets worse fast: that is the second law. Shares
are rounded to steps of 1 %, so that a line need not be computed anew for what nobody could
measure. Cuts and cables of another kind do not grow: they are there from ``from_s`` on.
"""

from __future__ import annotations

import math
from typing import Final, Literal

from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.faults import (
    BadSplice,
    BusFault,
    LooseConnector,
    MissingShieldGround,
    OpenCircuit,
    ShortCircuit,
    WaterIngress,
    WrongCable,
)

from .description import BusFaultDescription

Law = Literal["linear", "exponential"]

_K: Final = 1000.0
_STEP: Final = 0.01
_LEAST_FRACTION: Final = 1e-4
#: A contact that is not firm has another resistance every time; known to so many nepers.
_CONTACT_STEP: Final = 0.05


def growth_fraction(law: Law, from_s: float, to_s: float, time_s: float) -> float:
    """Share g of its size that a fault has at a time, 0 to 1.

    >>> share("linear", 10.0, 20.0, 15.0), share("exponential", 10.0, 20.0, 30.0)
    (0.5, 1.0)
    """
    u = min(max((time_s - from_s) / (to_s - from_s), 0.0), 1.0)
    return u if law == "linear" else (_K**u - 1.0) / (_K - 1.0)


def grown(fault: BusFaultDescription, time_s: float) -> float:
    """Fraction of its size that a fault has at a time, in steps; 0 where there is none yet."""
    if fault.fault in ("open", "wrong_cable"):
        return float(time_s >= fault.from_s)
    g = growth_fraction(fault.law, fault.from_s, fault.to_s, time_s)
    if g < _LEAST_FRACTION:
        return 0.0
    return math.exp(round(math.log(g) / _STEP) * _STEP)


def contact(spread: float, normal: float) -> float:
    """Factor on the resistance of a contact at one time, in steps.

    Parameters
    ----------
    spread
        Standard deviation of its logarithm.
    normal
        A standard normal number.
    """
    return math.exp(round(spread * normal / _CONTACT_STEP) * _CONTACT_STEP)


def fault_of(
    fault: BusFaultDescription, g: float, factor: float = 1.0, cable: Cable | None = None
) -> BusFault | None:
    """What a fault that has grown to a fraction does to the line, None where there is none.

    Parameters
    ----------
    fault
        The fault.
    g
        Its share.
    factor
        On the resistance of a contact, see :func:`contact`.
    cable
        The other cable that ``wrong_cable`` needs.
    """
    if g <= 0.0:
        return None
    kind, size, place_m = fault.fault, fault.size * g, fault.at_m
    if kind == "open":
        return OpenCircuit(place_m)
    if kind == "short":
        return ShortCircuit(place_m, fault.size / g)
    if kind == "water_ingress":
        conductance = fault.conductance_us_per_m * 1e-6 * g
        return WaterIngress(place_m, fault.length_m, size, conductance)
    if kind == "bad_splice":
        return BadSplice(place_m, size)
    if kind == "wrong_cable":
        if cable is None:
            raise ValueError(f"a cable is needed for {kind}, got None")
        return WrongCable(fault.car - 1, cable)
    if kind == "missing_shield_ground":
        noise = 1.0 + (fault.noise_factor - 1.0) * g
        return MissingShieldGround(fault.car - 1, size, size, noise)
    return LooseConnector(fault.coupler - 1, size * factor, 0.0, fault.spread)
