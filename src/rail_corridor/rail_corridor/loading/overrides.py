"""What the command line changes in a scenario."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from rail_corridor.equipment.registry import subsystems
from rail_corridor.equipment.subsystem import SectionOption
from rail_corridor.errors import InputError
from rail_world.line.network import Network
from rail_world.trains.description import TrainDescription

COMMAND_LINE: Final = "command line"


@dataclass(frozen=True)
class Overrides:
    """What the command line changes in a scenario; None leaves it as it is.

    Parameters
    ----------
    seed : int, optional
        Seed of every draw.
    duration_s : float, optional
        Simulated time [s].
    track : str or Path, optional
        TTOBench file that takes the place of the first track.
    trains : int, optional
        Number of trains: that many of a timetable, or the first ones of a list.
    sections : mapping
        Fields of sections of equipment by their option, as ``{"--zone-length": 200.0}``; None
        leaves one as it is. See `rail_corridor.equipment.subsystem.SectionOption`.
    reverse : bool
        Trains run the other way, from the other end of their track.
    """

    seed: int | None = None
    duration_s: float | None = None
    track: str | Path | None = None
    trains: int | None = None
    sections: Mapping[str, float | None] = field(default_factory=dict)
    reverse: bool = False


_OPTIONS: Final[Mapping[str, str]] = {
    "seed": "--seed",
    "duration_s": "--duration",
    "track": "--track",
    "trains": "--trains",
}


def apply_overrides(data: dict[str, Any], overrides: Overrides) -> dict[str, str]:
    """Change the data as asked; return which field came from which override."""
    origins: dict[str, str] = {}
    if overrides.seed is not None:
        data["seed"] = overrides.seed
        origins["seed"] = "seed"
    if overrides.duration_s is not None:
        data["duration_s"] = overrides.duration_s
        origins["duration_s"] = "duration_s"
    if overrides.track is not None:
        tracks = data.get("tracks")
        name = next(iter(tracks), "main") if isinstance(tracks, dict) else "main"
        data["tracks"] = {
            **(tracks if isinstance(tracks, dict) else {}),
            name: {"ttobench": str(Path(overrides.track).absolute())},
        }
        origins[f"tracks.{name}"] = "track"
    known = {each.option: each for subsystem in subsystems() for each in subsystem.options}
    for option, value in overrides.sections.items():
        if value is not None:
            _set_field(data, known[option], value)
            origins[known[option].path] = option
    if overrides.trains is not None:
        _apply_train_count(data, overrides.trains)
        origins["timetable.count"] = "trains"
    return origins


def _set_field(data: dict[str, Any], option: SectionOption, value: float) -> None:
    section = data.get(option.section)
    kept = section if isinstance(section, dict) else {}
    kept = {key: kept[key] for key in kept if key not in option.replaces}
    data[option.section] = {**kept, option.field: value}


def _apply_train_count(data: dict[str, Any], count: int) -> None:
    listed = data.get("trains")
    listed = listed if isinstance(listed, list) else []
    timetable = data.get("timetable")
    if not isinstance(timetable, dict):
        if not 1 <= count <= len(listed):
            raise InputError(
                f"the scenario lists {len(listed)} trains and has no timetable to make more",
                file=COMMAND_LINE,
                field=_OPTIONS["trains"],
                value=count,
            )
        data["trains"] = listed[:count]
    elif 1 <= count <= len(listed):
        data["trains"] = listed[:count]
        data["timetable"] = None
    else:
        data["timetable"] = {**timetable, "count": count - len(listed)}


def turned_round(
    trains: Iterable[TrainDescription], network: Network
) -> tuple[TrainDescription, ...]:
    """Trains that run the other way, as far from the other end of their track.

    Raises
    ------
    InputError
        For a train that runs over more than one track, or turns back by itself.
    """
    reversed_trains = []
    for train in trains:
        if len(train.route) > 1 or train.reverse_at:
            raise InputError(
                f"{train.name} runs over junctions or turns back",
                file=COMMAND_LINE,
                field="--reverse",
                value=True,
            )
        length_m = network.tracks[train.route[0]].length_m
        turned = {"direction": -train.direction, "start_m": length_m - train.start_m}
        reversed_trains.append(train.model_copy(update=turned))
    return tuple(reversed_trains)


def blame_override(
    error: InputError, overrides: Overrides, origins: Mapping[str, str]
) -> InputError:
    """Return the error as one of the command line, if the field it names came from there."""
    for prefix, name in origins.items():
        if not error.file and (error.field == prefix or error.field.startswith(f"{prefix}.")):
            if name in overrides.sections:
                value: Any = overrides.sections[name]
            else:
                value = getattr(overrides, name)
            field = _OPTIONS.get(name, name)
            return InputError(error.reason, file=COMMAND_LINE, field=field, value=value)
    return error
