"""A train's bus put together from the profiles of its cars.

What joins the cars is in no profile and in no source at hand. It is chosen here: every car has a
node at the far end of its run, on a stub of 0.3 m - within the 1 m of metro cars and KTX, past
the 166 mm of the rule of thumb (Choi, Lee and Lim, S2, equation 22) - with 10 kohm and 30 pF;
a coupler has 20 mohm and 50 nH.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from .bus_line import CableSection, Coupler, Stub, Termination
from .consist import CarRun, Consist
from .profile import BusProfile, load_bus_profile

STUB_M: Final = 0.3
"""Length of the stub of a node [m]."""
NODE_LOAD: Final = Termination(10e3)
"""Input resistance of a node."""
NODE_CAPACITANCE_F: Final = 30e-12
"""Input capacitance of a node [F]."""
COUPLER: Final = Coupler(0.02, 50e-9)
"""A coupler between two cars."""


def train_profiles(cars: Sequence[str]) -> tuple[BusProfile, ...]:
    """Profiles of cars by name.

    Raises
    ------
    ValueError
        If there is no car, or no profile of a name.
    """
    if not cars:
        raise ValueError("cars must name one profile or more, got none")
    return tuple(load_bus_profile(name) for name in cars)


def train_consist(cars: Sequence[str]) -> Consist:
    """Drawing of a train: nodes, couplers, and the terminator of the first car's profile.

    Parameters
    ----------
    cars
        Profile of the cable in each car, from the head.

    Examples
    --------
    >>> train_consist(("CM2", "CM3", "CM4")).length_m
    121.0
    """
    profiles = train_profiles(cars)
    node = Stub(CableSection(profiles[0].cable, STUB_M), NODE_LOAD, NODE_CAPACITANCE_F)
    return Consist(_runs(profiles), node, COUPLER, Termination(profiles[0].termination_ohm))


def cable_consist(car: str) -> Consist:
    """Drawing of one car's cable alone, without a node: as it lies in the workshop."""
    (profile,) = train_profiles((car,))
    return Consist(_runs((profile,)), None, COUPLER, Termination(profile.termination_ohm))


def _runs(profiles: Sequence[BusProfile]) -> tuple[CarRun, ...]:
    return tuple(CarRun(profile.cable, profile.length_m) for profile in profiles)
