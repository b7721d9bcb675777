"""Scenarios: one situation per YAML file, validated whole before anything starts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any, Final, NamedTuple, get_args

from pydantic import BaseModel, Field, ValidationError, model_validator

from rail_corridor.equipment.doppler.placement import Reference, place_references
from rail_corridor.equipment.doppler.section import LocalizerPlan, ReferencePlan
from rail_corridor.equipment.ranging.layout import Layout, place_stations
from rail_corridor.equipment.track_code.placement import Circuit, place_circuits
from rail_corridor.equipment.train_bus.section import BusPlan
from rail_corridor.equipment.train_radio.placement import Base, place_bases
from rail_corridor.equipment.train_radio.section import CbtcPlan
from rail_corridor.errors import InputError, from_validation
from rail_world.line.description import (
    Description,
    JunctionDescription,
    Name,
    Number,
    TrackDescription,
    TrainDescription,
)
from rail_world.line.network import Network, build_network

from .checks import check_scenario
from .fault_sections import Fault
from .overrides import Overrides, apply_overrides, blame_override, turned_round
from .section_fields import Whole
from .sections import (
    ChannelPlan,
    RadioPlan,
    RangingPlan,
    StationPlan,
    TrackCircuitPlan,
    TransponderPlan,
)
from .timetable import Timetable
from .yaml_file import load_yaml


class Supervision(NamedTuple):
    """Supervision on board: node, whether drivers see what it permits, error of the wheels."""

    node: str
    cab_signals: bool
    odometer_error: float


_SCENARIOS: Final = Path(str(resources.files("rail_corridor.scenario"))) / "builtin"
_MOST_TICKS: Final = 10_000_000


class Scenario(Description):
    """One situation: tracks, stations, radio, trains, faults and the seed of every draw."""

    name: Name = Field(description="name of the scenario")
    description: str = Field(default="", max_length=1000, description="one line about it")
    seed: Whole = Field(default=1, ge=0, le=2**63 - 1, description="seed of every random draw")
    duration_s: Number = Field(gt=0.0, le=1e5, description="simulated time [s]")
    end_when_arrived: bool = Field(
        default=False, description="end earlier, when every train has arrived"
    )
    tick_s: Number = Field(default=0.1, ge=0.01, le=1.0, description="time of one tick [s]")
    tracks: dict[Name, TrackDescription] = Field(max_length=100, description="tracks by name")
    junctions: tuple[JunctionDescription, ...] = Field(
        default=(), max_length=100, description="facing points that join the tracks"
    )
    stations: StationPlan = Field(description="the wayside ranging stations")
    channels: ChannelPlan = Field(default=ChannelPlan(), description="radio channels")
    ranging: RangingPlan = Field(default=RangingPlan(), description="ranging signal")
    radio: RadioPlan = Field(default=RadioPlan(), description="radio link")
    transponder: TransponderPlan = Field(default=TransponderPlan(), description="on board")
    track_circuits: TrackCircuitPlan | None = Field(
        default=None, description="codes in the rails, which trains obey; null = none"
    )
    cbtc: CbtcPlan | None = Field(
        default=None, description="train control by radio, which trains obey; null = none"
    )
    references: ReferencePlan | None = Field(
        default=None, description="stations for positions by Doppler shifts; null = none"
    )
    localizer: LocalizerPlan | None = Field(
        default=None, description="position on board from all sensors; null = none"
    )
    train_bus: BusPlan | None = Field(
        default=None, description="the bus in the trains and what watches it; null = none"
    )
    trains: tuple[TrainDescription, ...] = Field(
        default=(), max_length=100, description="trains one by one"
    )
    timetable: Timetable | None = Field(
        default=None, description="trains alike; they become part of trains on loading"
    )
    faults: tuple[Fault, ...] = Field(
        default=(), max_length=1000, description="what goes wrong, and when"
    )

    @model_validator(mode="after")
    def _agrees(self) -> Scenario:
        if math.ceil(self.duration_s / self.tick_s - 1e-9) > _MOST_TICKS:
            raise ValueError(f"duration_s: is more than ten million ticks of {self.tick_s:g} s")
        if self.ranging.signal.duration_s > self.tick_s:
            raise ValueError(
                f"ranging.samples: last {self.ranging.signal.duration_s:g} s,"
                f" longer than a tick of {self.tick_s:g} s"
            )
        return self

    @property
    def ticks(self) -> int:
        """Number of ticks that cover the duration."""
        return math.ceil(self.duration_s / self.tick_s - 1e-9)

    @cached_property
    def network(self) -> Network:
        """The tracks in the map frame; WorldDataError if they do not fit together."""
        return build_network(self.tracks, self.junctions)

    @cached_property
    def layout(self) -> Layout:
        """Stations and zones; InputError if they cannot be placed."""
        return place_stations(self.network, self.stations, self.channels)

    @cached_property
    def circuits(self) -> tuple[Circuit, ...]:
        """Track circuits in the order of the tracks; none without a plan for them."""
        plan = self.track_circuits
        if plan is None:
            return ()
        longest_m = max((train.vehicle.length_m for train in self.trains), default=0.0)
        return place_circuits(self.network, plan, longest_m)

    @cached_property
    def bases(self) -> tuple[Base, ...]:
        """Base stations of the train radio in the order of the tracks; none without a plan."""
        return () if self.cbtc is None else place_bases(self.network, self.cbtc)

    @cached_property
    def reference_stations(self) -> tuple[Reference, ...]:
        """Reference stations in the order of the tracks; none without a plan."""
        return () if self.references is None else place_references(self.network, self.references)

    @property
    def odometer_error(self) -> float:
        """Standard deviation of the wheels' error; 0 where nobody listens to them."""
        if self.supervision is not None:
            return self.supervision.odometer_error
        return 0.0 if self.localizer is None else self.localizer.odometer_error

    @property
    def with_odometer(self) -> tuple[str, ...]:
        """Trains whose wheels are listened to."""
        listened = self.supervision is not None or self.localizer is not None
        return tuple(train.name for train in self.trains) if listened else ()

    @property
    def supervision(self) -> Supervision | None:
        """What trains obey, None if they run by themselves."""
        if self.cbtc is not None:
            return Supervision("atp", self.cbtc.cab_signals, self.cbtc.odometer_error)
        circuits = self.track_circuits
        if circuits is not None:
            return Supervision("code_supervision", circuits.cab_signals, circuits.odometer_error)
        return None

    @property
    def supervised(self) -> tuple[str, ...]:
        """Trains that obey what they receive."""
        return () if self.supervision is None else tuple(train.name for train in self.trains)

    def to_json(self) -> str:
        """Return the scenario as JSON, for another process or a recording."""
        return self.model_dump_json(exclude_unset=True)

    @classmethod
    def from_json(cls, text: str) -> Scenario:
        """Return the scenario that ``to_json`` wrote."""
        return cls.model_validate_json(text)


def builtin_scenarios() -> dict[str, Path]:
    """Return the scenarios that come with the package, name to file."""
    return {path.stem: path for path in sorted(_SCENARIOS.glob("*.yaml"))}


def load_scenario(name_or_path: str | Path, *, overrides: Overrides | None = None) -> Scenario:
    """Load a scenario and see that everything in it fits together.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a built-in scenario, or a YAML file.
    overrides : Overrides, optional
        What to change in it first.

    Returns
    -------
    Scenario
        Complete in itself: names of track files are absolute, trains of a timetable are listed.

    Raises
    ------
    InputError
        One line that names the file (or the command line), the field and the value.
    """
    path = _find(name_or_path)
    data = load_yaml(path)
    overrides = overrides or Overrides()
    origins = apply_overrides(data, overrides)
    try:
        return scenario_from_data(data, directory=path.parent, reverse=overrides.reverse)
    except InputError as error:
        raise blame_override(error, overrides, origins).located(str(path)) from None


def scenario_from_data(
    data: Mapping[str, Any], *, directory: Path, reverse: bool = False
) -> Scenario:
    """Make a scenario from plain data, as they stand in a file.

    Parameters
    ----------
    data : mapping
        The top level of the file.
    directory : Path
        Where relative names of track files start from.
    reverse : bool
        Whether trains run the other way, from the other end of their track.

    Raises
    ------
    InputError
        Names the field and the value; the file is left to the caller.
    """
    try:
        scenario = Scenario.model_validate(data)
    except ValidationError as error:
        raise from_validation(error, data, _field_names()) from None
    except RecursionError:
        raise InputError("is nested too deeply") from None
    except OverflowError:
        raise InputError("holds a number beyond all bounds") from None
    if not scenario.tracks:
        raise InputError(
            "at least one track is needed; describe one, or give a line with --track FILE.json",
            field="tracks",
            value={},
        )
    fields = [f"trains.{index}" for index in range(len(scenario.trains))]
    trains = scenario.trains
    if scenario.timetable is not None:
        trains += scenario.timetable.trains()
        fields += ["timetable.train"] * scenario.timetable.count
    tracks = {
        name: track
        if track.ttobench is None
        else track.model_copy(update={"ttobench": str((directory / track.ttobench).absolute())})
        for name, track in scenario.tracks.items()
    }
    scenario = scenario.model_copy(update={"trains": trains, "timetable": None, "tracks": tracks})
    check_scenario(scenario, fields)
    if reverse:
        trains = turned_round(trains, scenario.network)
        scenario = scenario.model_copy(update={"trains": trains})
        check_scenario(scenario, fields)
    return scenario


def _find(name_or_path: str | Path) -> Path:
    known = builtin_scenarios()
    if str(name_or_path) in known:
        return known[str(name_or_path)]
    path = Path(name_or_path)
    try:
        there = path.exists()
    except (OSError, ValueError):
        there = False
    if not there and path.suffix not in (".yaml", ".yml"):
        raise InputError(
            f"there is no such file, and no built-in scenario of that name ({', '.join(known)})",
            file=str(name_or_path),
        )
    return path


def _field_names() -> set[str]:
    """Return the name of every field a scenario may hold, for suggestions."""
    return {name for model in models_of(Scenario) for name in model.model_fields}


def models_of(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """Yield a model and the models of its fields, each once, in the order of the file."""
    waiting, seen = [model], {model}
    while waiting:
        model = waiting.pop(0)
        yield model
        for field in model.model_fields.values():
            for found in _models_in(field.annotation):
                if found not in seen:
                    seen.add(found)
                    waiting.append(found)


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)
