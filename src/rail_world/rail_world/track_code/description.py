"""The validated description of the rails as a medium: track circuits, levels, noise, faults."""

from __future__ import annotations

import itertools
from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from rail_msgs_py.quantities import FAULT_BEGIN, FAULT_END
from rail_msgs_py.track_code import quantities
from rail_world.line.description_base import (
    Chainage,
    Description,
    Name,
    StrictFloat,
    range_of,
)

Decibels = Annotated[StrictFloat, Field(ge=0.0, le=200.0)]
Volts = Annotated[StrictFloat, Field(ge=0.0, le=1e4)]


class TrackCircuit(Description):
    """One block of rails: its transmitter stands at ``end_m``, its receiver at ``start_m``."""

    name: Name
    track: Name
    start_m: Chainage = Field(description="entry end [m]")
    end_m: Chainage = Field(description="exit end, that trains run towards [m]")
    carrier_hz: Annotated[StrictFloat, range_of(quantities.CARRIER)]

    @model_validator(mode="after")
    def _has_length(self) -> TrackCircuit:
        if self.end_m <= self.start_m:
            raise ValueError(f"end_m: {self.end_m:g} is not past start_m, {self.start_m:g}")
        return self


class Harmonic(Description):
    """A line of the traction current's spectrum, as heard at every antenna and receiver."""

    order: int = Field(ge=1, le=1000, description="multiple of the fundamental")
    amplitude_v: Volts = Field(description="amplitude [V]")


#: What each kind of fault befalls, and what it sets.
_FAULTS: Final[dict[str, tuple[frozenset[str], frozenset[str]]]] = {
    "sanding": (frozenset({"train", "loss_db"}), frozenset()),
    "poor_shunt": (frozenset({"train", "shunt_ohm"}), frozenset()),
    "broken_rail": (frozenset({"circuit", "loss_db"}), frozenset({"at_m"})),
    "failed_joint": (frozenset({"circuit", "loss_db"}), frozenset()),
    "wet_ballast": (frozenset({"track", "ballast_ohm_km"}), frozenset({"from_m", "to_m"})),
    "dead_transmitter": (frozenset({"circuit"}), frozenset()),
}


class RailFault(Description):
    """Something that goes wrong in the rails, from and to a simulated time.

    ``sanding``: ``train`` picks up ``loss_db`` less of what flows in the rails.
    ``poor_shunt``: the axles of ``train`` together have ``shunt_ohm`` from rail to rail.
    ``broken_rail``: what would pass ``at_m`` of ``circuit`` (its middle if not said) is
    weaker by ``loss_db``. ``failed_joint``: the joint at the exit end of ``circuit`` takes
    ``loss_db`` only. ``wet_ballast``: from ``from_m`` to ``to_m`` of ``track`` the ballast
    leaks. ``dead_transmitter``: that of ``circuit`` sends nothing.
    """

    kind: Literal[
        "sanding",
        "poor_shunt",
        "broken_rail",
        "failed_joint",
        "wet_ballast",
        "dead_transmitter",
    ]
    from_s: Annotated[StrictFloat, range_of(FAULT_BEGIN)]
    to_s: Annotated[StrictFloat, range_of(FAULT_END)]
    train: str | None = None
    circuit: str | None = None
    track: str | None = None
    at_m: Chainage | None = None
    from_m: Chainage | None = None
    to_m: Chainage | None = None
    loss_db: Annotated[StrictFloat, range_of(quantities.SANDING_LOSS)] | None = None
    shunt_ohm: Annotated[StrictFloat, range_of(quantities.SHUNT)] | None = None
    ballast_ohm_km: Annotated[StrictFloat, range_of(quantities.BALLAST)] | None = None

    @model_validator(mode="after")
    def _sets_what_its_kind_has(self) -> RailFault:
        needed, possible = _FAULTS[self.kind]
        for field in type(self).model_fields:
            if field in ("kind", "from_s", "to_s"):
                continue
            value = getattr(self, field)
            if (value is None and field in needed) or (
                value is not None and field not in needed | possible
            ):
                raise ValueError(f"{field}: {value} does not agree with {self.kind}")
        return self


class RailDescription(Description):
    """Everything the rail medium knows besides where the trains are.

    Levels are amplitudes referred to the terminals of an antenna over the rails, or of a
    receiver at them. What no scenario sets has a typical magnitude, assumed here.
    """

    circuits: tuple[TrackCircuit, ...] = Field(min_length=1, max_length=100_000)
    tracks: tuple[str, ...] = Field(
        default=(), description="order that counts the tracks; empty = as the circuits name them"
    )
    trains: tuple[str, ...] = ()
    sample_rate_hz: Annotated[StrictFloat, range_of(quantities.SAMPLE_RATE)]
    transmit_level_v: Volts = Field(
        default=1.0, description="amplitude that a transmitted sample of 1 has at its feed [V]"
    )
    attenuation_db_per_km: Annotated[StrictFloat, range_of(quantities.ATTENUATION)]
    joint_attenuation_db: Annotated[StrictFloat, range_of(quantities.JOINT_LOSS)]
    shunt_attenuation_db: Decibels = Field(default=50.0, description="past the axles of a train")
    white_noise_v: Volts = Field(description="rms of a sample [V]")
    impulse_rate_per_s: Annotated[StrictFloat, range_of(quantities.IMPULSE_RATE)]
    impulse_amplitude_v: Volts = Field(description="mean height of an impulse [V]")
    fundamental_hz: StrictFloat = Field(
        default=50.0, gt=0.0, le=1000.0, description="of the traction"
    )
    harmonics: tuple[Harmonic, ...] = ()
    faults: tuple[RailFault, ...] = ()

    @property
    def track_order(self) -> tuple[str, ...]:
        """Names of the tracks in the order that counts them."""
        return self.tracks or tuple(dict.fromkeys(circuit.track for circuit in self.circuits))

    @model_validator(mode="after")
    def _agrees(self) -> RailDescription:
        names = {circuit.name: circuit for circuit in self.circuits}
        if len(names) != len(self.circuits):
            raise ValueError("circuits: a name comes twice")
        for circuit in self.circuits:
            if circuit.track not in self.track_order:
                raise ValueError(f"circuits: {circuit.name}: there is no track {circuit.track}")
        along = sorted(self.circuits, key=lambda c: (c.track, c.start_m))
        for one, other in itertools.pairwise(along):
            if one.track == other.track and one.end_m != other.start_m:
                raise ValueError(
                    f"circuits: {other.name} starts at {other.start_m:g}, but {one.name} before it"
                    f" ends at {one.end_m:g}"
                )
        for fault in self.faults:
            if fault.train is not None and fault.train not in self.trains:
                raise ValueError(f"faults: there is no train {fault.train}")
            if fault.track is not None and fault.track not in self.track_order:
                raise ValueError(f"faults: there is no track {fault.track}")
            if fault.circuit is not None and fault.circuit not in names:
                raise ValueError(f"faults: there is no circuit {fault.circuit}")
            if fault.circuit is not None and fault.at_m is not None:
                circuit = names[fault.circuit]
                if not circuit.start_m <= fault.at_m <= circuit.end_m:
                    raise ValueError(f"faults: at_m {fault.at_m:g} is not in {fault.circuit}")
        nyquist_hz = 0.5 * self.sample_rate_hz
        highest_hz = max((h.order for h in self.harmonics), default=0) * self.fundamental_hz
        if highest_hz >= nyquist_hz:
            raise ValueError(f"harmonics: {highest_hz:g} Hz is not below {nyquist_hz:g} Hz")
        return self
