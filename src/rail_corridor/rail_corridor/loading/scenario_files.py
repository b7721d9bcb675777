"""A scenario as the files that a recording carries along, and back.

``scenario.yaml`` is what the run used: what the command line changed is in it, and it can be run
again. Tracks in TTOBench format are beside it as ``tracks/<name>.json``.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import yaml

from rail_corridor.errors import InputError
from rail_corridor.recording.frames import Attachment
from rail_corridor.scenario.model import Scenario
from rail_corridor.yaml_file import parse_yaml, read_text_file

from .loader import scenario_from_data

SCENARIO: Final = "scenario.yaml"
_TRACKS: Final = "tracks"


def files_of(scenario: Scenario) -> list[Attachment]:
    """The files of a scenario.

    Raises
    ------
    InputError
        If a file of a track cannot be read any longer.
    """
    data: dict[str, Any] = json.loads(scenario.to_json())
    files = []
    for name, track in data["tracks"].items():
        if track.get("ttobench") is not None:
            text = read_text_file(Path(track["ttobench"]))
            track["ttobench"] = f"{_TRACKS}/{name}.json"
            files.append(Attachment(track["ttobench"], "application/json", text.encode()))
    text = yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100)
    return [Attachment(SCENARIO, "application/yaml", text.encode()), *files]


def scenario_from(files: Iterable[Attachment], directory: Path) -> Scenario:
    """The scenario of such files.

    Parameters
    ----------
    files : iterable of Attachment
        Others than those of a scenario are left aside.
    directory : Path
        An empty one; files of tracks are put there, and must stay as long as the scenario is used.

    Raises
    ------
    InputError
        If there is none among them, or it is not valid.
    """
    by_name = {each.name: each.data for each in files}
    if SCENARIO not in by_name:
        raise InputError(f"holds no {SCENARIO}: it is no recording of a corridor")
    try:
        text = by_name[SCENARIO].decode("utf-8")
        data = parse_yaml(text)
        if not isinstance(data, dict):
            raise InputError("the top level must be a mapping (field: value)")
        (directory / _TRACKS).mkdir()
        tracks = data.get("tracks")
        for name in tracks if isinstance(tracks, dict) else ():
            file = f"{_TRACKS}/{name}.json"
            if file in by_name and "/" not in name:
                (directory / file).write_bytes(by_name[file])
        return scenario_from_data(data, directory=directory)
    except UnicodeDecodeError:
        raise InputError(f"{SCENARIO} is not UTF-8 text") from None
    except InputError as error:
        inside = f"in its {SCENARIO}: {error.reason}"
        raise InputError(inside, field=error.field, value=error.value) from None


class _Dumper(yaml.SafeDumper):
    """Quotes what the stricter reader of scenarios would take for something else."""


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.Node:
    try:
        plain = parse_yaml(text) == text
    except InputError:
        plain = False
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=None if plain else '"')


_Dumper.add_representer(str, _text)
