"""A recording in several files: how its parts are named and told apart.

The parts of ``run.mcap`` are ``run.mcap``, ``run_1.mcap``, ``run_2.mcap`` and so on. Each is a
file in itself: it begins with the scenario and with what is latched, so that any tool can open it
alone. Each but the last ends with a record that says that there is another one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

#: Names of the records of a part: at its beginning, and at its end if another one follows.
PART: Final = "rail_corridor.part"
NEXT: Final = "rail_corridor.next"


@dataclass(frozen=True)
class Split:
    """How a recording is divided.

    Parameters
    ----------
    path : Path
        Of the first part.
    most_bytes : int
        A part that has grown to so much is closed.
    recording : str
        Tells the recording from all others.
    """

    path: Path
    most_bytes: int
    recording: str

    def values(self, number: int) -> dict[str, str]:
        """Of the record at the beginning of a part."""
        return {"recording": self.recording, "number": str(number)}


def part_path(first: Path, number: int) -> Path:
    """Path of a part, counted from 0.

    >>> part_path(Path("runs/demo.mcap"), 2).name
    'demo_2.mcap'
    """
    return first.with_stem(f"{first.stem}_{number}") if number else first


def parts_of(first: Path) -> list[Path]:
    """Paths of the parts that there are, without a gap."""
    found = [first]
    while (path := part_path(first, len(found))).exists():
        found.append(path)
    return found
