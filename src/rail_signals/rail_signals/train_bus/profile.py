"""What the cable of a car, or a kind of train bus, has to be: limits and constants as data.

Profiles are read from JSON files of the package and never changed. Three are the tables of
Choi, Lee and Lim (S2, Fig 6) with their limits put right: a length or an impedance fails below
the lower **or** above the upper limit, and an attenuation of exactly the limit fails. What no
source tells is named in `BusProfile.unconfirmed`.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from .cable import Cable


@dataclass(frozen=True)
class BusProfile:
    """Limits of a cable run, and the kind of cable.

    Parameters
    ----------
    name, description
        Name, and what it is for.
    cable
        The kind of cable; its impedance and velocity are those without loss.
    length_m
        Length as drawn [m], the middle of the limits; where there is none, an example.
    length_limits_m
        Shortest and longest that pass [m]; None where the length is free.
    impedance_limits_ohm
        Least and largest that pass [ohm].
    attenuation_limit_db
        An attenuation of a run that fails, as all above it do [dB]; None where
        `attenuation_limit_db_per_km` counts.
    attenuation_limit_db_per_km
        The same per kilometre [dB/km]; here the limit itself passes, being that of the cable's
        data sheet. None where `attenuation_limit_db` counts.
    attenuation_frequency_hz
        At which frequency [Hz].
    termination_ohm
        Resistor that ends the bus [ohm].
    longest_bus_m, most_nodes
        Of the whole bus; None where unknown.
    source
        Where the figures are from.
    unconfirmed
        What is from memory or chosen here, one sentence each.

    Raises
    ------
    ValueError
        If a field is out of range; the message names the field and quotes the value.
    """

    name: str
    description: str
    cable: Cable
    length_m: float
    length_limits_m: tuple[float, float] | None
    impedance_limits_ohm: tuple[float, float]
    attenuation_limit_db: float | None
    attenuation_limit_db_per_km: float | None
    attenuation_frequency_hz: float
    termination_ohm: float
    longest_bus_m: float | None
    most_nodes: int | None
    source: str
    unconfirmed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Coerce sequences to tuples and validate every field."""
        object.__setattr__(self, "unconfirmed", tuple(str(u) for u in self.unconfirmed))
        for name in ("length_limits_m", "impedance_limits_ohm"):
            limits = getattr(self, name)
            if limits is None and name == "length_limits_m":
                continue
            if not _is_interval(limits):
                raise ValueError(f"{name} must be two rising values above 0, got {limits!r}")
            object.__setattr__(self, name, (float(limits[0]), float(limits[1])))
        for name in ("length_m", "attenuation_frequency_hz", "termination_ohm"):
            if not _is_positive(getattr(self, name)):
                raise ValueError(f"{name} must be above 0, got {getattr(self, name)!r}")
        for name in ("attenuation_limit_db", "attenuation_limit_db_per_km", "longest_bus_m"):
            value = getattr(self, name)
            if value is not None and not _is_positive(value):
                raise ValueError(f"{name} must be above 0 or nothing, got {value!r}")
        if (self.attenuation_limit_db is None) == (self.attenuation_limit_db_per_km is None):
            raise ValueError(
                "attenuation_limit_db or attenuation_limit_db_per_km must be given, not both,"
                f" got {self.attenuation_limit_db!r} and {self.attenuation_limit_db_per_km!r}"
            )
        nodes = self.most_nodes
        if nodes is not None and (not isinstance(nodes, int) or nodes < 2):
            raise ValueError(f"most_nodes must be 2 or more, got {nodes!r}")
        low, high = self.impedance_limits_ohm
        if not low <= self.cable.impedance_ohm <= high:
            raise ValueError(
                f"cable must have an impedance within {low:g} and {high:g} ohm,"
                f" got {self.cable.impedance_ohm:g}"
            )
        if self.length_limits_m is not None and not (
            self.length_limits_m[0] <= self.length_m <= self.length_limits_m[1]
        ):
            raise ValueError(f"length_m must lie within its limits, got {self.length_m!r}")


def bus_profile_names() -> tuple[str, ...]:
    """Names of the profiles of the package, in alphabetical order.

    Examples
    --------
    >>> bus_profile_names()
    ('cm2', 'cm3', 'cm4', 'example', 'polyethylene', 'wtb')
    """
    entries = (files("rail_signals.train_bus") / "profiles").iterdir()
    return tuple(sorted(e.name[: -len(".json")] for e in entries if e.name.endswith(".json")))


def load_bus_profile(name: str) -> BusProfile:
    """Read one profile of the package; capitals do not matter.

    Raises
    ------
    ValueError
        If there is no profile of that name.

    Examples
    --------
    >>> load_bus_profile("CM4").length_limits_m
    (24.3, 29.7)
    """
    lower = name.lower()
    if lower not in bus_profile_names():
        raise ValueError(f"name must be one of {bus_profile_names()}, got {name!r}")
    path = files("rail_signals.train_bus") / "profiles" / f"{lower}.json"
    values: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return BusProfile(**{**values, "cable": _cable(values["cable"])})


def _cable(values: dict[str, float]) -> Cable:
    """A cable by impedance and velocity factor, or by impedance and capacitance."""
    losses = {
        name: float(values.get(name, 0.0))
        for name in ("resistance_ohm_per_m", "conductance_s_per_m", "skin_ohm_per_m_sqrt_hz")
    }
    impedance = float(values["impedance_ohm"])
    if "velocity_factor" in values:
        return Cable.from_impedance(impedance, float(values["velocity_factor"]), **losses)
    capacitance = float(values["capacitance_f_per_m"])
    return Cable(impedance**2 * capacitance, capacitance, **losses)


def _is_positive(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and value > 0


def _is_interval(value: object) -> bool:
    return (
        isinstance(value, list | tuple)
        and len(value) == 2
        and all(_is_positive(v) for v in value)
        and value[0] < value[1]
    )
