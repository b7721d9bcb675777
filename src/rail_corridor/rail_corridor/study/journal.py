"""The journal of a study: every run that has ended, at once on the disk, so that it can go on.

One JSON object a line. The first tells the study that it belongs to; the others a run each, in
the order in which they came in. A line that was cut short, as by a crash, is forgotten.
"""

from __future__ import annotations

import hashlib
import json
import math
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from rail_corridor.errors import InputError

from .cells import case_of, cells_of
from .model import Study
from .sources import Source

_Places = NDArray[np.int64]


@dataclass(frozen=True)
class Entry:
    """One run that has ended: its facts and figures, or why it failed."""

    cell: int
    run: int
    seed: int
    values: Mapping[str, Any]
    facts: Mapping[str, Any]
    figures: Mapping[str, float | None]
    failure: str | None
    wall_s: float

    @property
    def key(self) -> tuple[int, int]:
        """Which run it is."""
        return self.cell, self.run


class Header(NamedTuple):
    """First line of a journal: whose it is, and by what version of the code.

    Parameters
    ----------
    name : str
    fingerprint : str
        Of all that decides what a run gives: not of how many are wanted, or when it is enough.
    version : str
    """

    name: str
    fingerprint: str
    version: str

    @classmethod
    def of(cls, study: Study, source: Source, version: str) -> Header:
        """That of a study."""
        asked = study.model_dump(mode="json", exclude={"runs", "stop", "description", "group_by"})
        first = case_of(study, cells_of(study), 0, 0)
        text = json.dumps([asked, source.content(first.values, first.seed)], sort_keys=True)
        return cls(study.name, hashlib.sha256(text.encode()).hexdigest()[:16], version)


def header_of(path: Path) -> Header:
    """First line of a journal; InputError if it is none."""
    try:
        with path.open() as file:
            return Header(**json.loads(file.readline()))
    except (ValueError, TypeError):
        raise InputError("is no journal of a study", file=str(path)) from None


class Journal:
    """Writes the journal of one study; the file comes with its first run.

    Parameters
    ----------
    path : Path
    header : Header
    resume : bool
        Whether to go on with what there is.

    Raises
    ------
    InputError
        If there is one, and it is not to be gone on with, or of another study.
    """

    def __init__(self, path: Path, header: Header, *, resume: bool) -> None:
        self.path, self._header = path, header
        self._file: TextIO | None = None
        self._kept: int | None = None
        if path.exists() and path.stat().st_size:
            if not resume:
                reason = "there are runs already: go on with --resume, or name another --out"
                raise InputError(reason, field="--out", value=str(path.parent))
            _check_header(path, header)
            self._kept = path.read_bytes().rfind(b"\n") + 1

    def add(self, entry: Entry) -> None:
        """Write a run; it is on its way to the disk when this returns."""
        file = self._open() if self._file is None else self._file
        file.write(json.dumps(_plain(entry.__dict__)) + "\n")
        file.flush()

    def _open(self) -> TextIO:
        if self._kept is None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.write_text(json.dumps(self._header._asdict()) + "\n")
        else:
            with self.path.open("r+b") as file:
                file.truncate(self._kept)
        self._file = self.path.open("a")
        return self._file

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()


def _check_header(path: Path, wanted: Header) -> None:
    found = header_of(path)
    if found.fingerprint != wanted.fingerprint:
        reason = f"is of another study, {found.name}, or one in which figures or values were others"
        raise InputError(f"{reason}: name another --out", file=str(path))
    if found.version != wanted.version:
        reason = f"is of version {found.version}, and this is {wanted.version}"
        raise InputError(f"{reason}: name another --out", file=str(path))


class Entries:
    """The runs of a journal that count: the last try of each, by cells and seeds.

    They are read from the file again each time, so that any number of them can be gone through.

    Parameters
    ----------
    path : Path
        Of a journal; one that there is not has no runs.
    ended : mapping of int to int
        Runs after which cells have had enough; later ones do not count.

    Raises
    ------
    InputError
        If a line is none of a journal.
    """

    def __init__(self, path: Path, ended: Mapping[int, int] | None = None) -> None:
        self._path = path
        #: Names of what else was drawn, and of figures, in the order in which they came.
        self.facts: tuple[str, ...] = ()
        self.figures: tuple[str, ...] = ()
        keys, places = array("q"), array("q")
        facts: dict[str, None] = {}
        figures: dict[str, None] = {}
        for place, entry in _lines(path):
            keys.extend(entry.key)
            places.append(place)
            facts.update(dict.fromkeys(entry.facts))
            figures.update(dict.fromkeys(entry.figures))
        self.facts, self.figures = tuple(facts), tuple(figures)
        self._places = _counting(
            np.array(keys, dtype=np.int64).reshape(-1, 2),
            np.array(places, dtype=np.int64),
            ended or {},
        )

    def __len__(self) -> int:
        return int(self._places.size)

    def __iter__(self) -> Iterator[Entry]:
        if not len(self):
            return
        with self._path.open("rb") as file:
            for place in self._places.tolist():
                file.seek(place)
                yield Entry(**json.loads(file.readline()))


def _counting(keys: _Places, places: _Places, ended: Mapping[int, int]) -> _Places:
    """Places of the last line of each run, in the order of the runs."""
    order = np.lexsort((places, keys[:, 1], keys[:, 0]))
    keys, places = keys[order], places[order]
    last = np.ones(len(keys), dtype=bool)
    last[:-1] = (keys[1:] != keys[:-1]).any(axis=1)
    for cell, runs in ended.items():
        last &= (keys[:, 0] != cell) | (keys[:, 1] < runs)
    return np.asarray(places[last], dtype=np.int64)


def _lines(path: Path) -> Iterator[tuple[int, Entry]]:
    """Runs of a journal in the order in which they came in, with their places in the file."""
    if not path.exists():
        return
    with path.open("rb") as file:
        place = len(file.readline())
        for line in file:
            if line.endswith(b"\n"):
                try:
                    entry = _entry(json.loads(line))
                except (ValueError, TypeError):
                    reason = f"what stands at byte {place} is no run of a study"
                    raise InputError(reason, file=str(path)) from None
                yield place, entry
            place += len(line)


def _entry(data: Any) -> Entry:
    entry = Entry(**data)
    numbers = (entry.cell, entry.run, entry.seed)
    parts = (entry.values, entry.facts, entry.figures)
    if not all(type(n) is int and n >= 0 for n in numbers) or not all(
        isinstance(part, dict) for part in parts
    ):
        raise ValueError(data)
    return entry


def _plain(value: Any) -> Any:
    """As JSON has it: what is not known is null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
