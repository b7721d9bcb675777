"""The journal of a study: every run that has ended, at once on the disk, so that it can go on.

One JSON object a line. The first tells the study that it belongs to; the others a run each, in
the order in which they came in. A line that was cut short, as by a crash, is forgotten.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from rail_corridor.errors import InputError

from .model import Study


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


def fingerprint(study: Study, version: str) -> str:
    """Of all that decides what a run gives: not of how many are wanted, or when it is enough."""
    content = study.model_dump(mode="json", exclude={"runs", "stop", "description", "group_by"})
    text = json.dumps([content, version], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Journal:
    """Writes and reads the journal of one study.

    Parameters
    ----------
    path : Path
    key : str
        Of `fingerprint`.
    resume : bool
        Whether to go on with what there is.

    Raises
    ------
    InputError
        If there is one, and it is not to be gone on with, or of another study.
    """

    def __init__(self, path: Path, key: str, *, resume: bool) -> None:
        self.path = path
        if path.exists():
            if not resume:
                reason = "there are runs already: go on with --resume, or name another --out"
                raise InputError(reason, field="--out", value=str(path.parent))
            kept = self._kept(key)
            with path.open("r+b") as file:
                file.truncate(kept)
        else:
            path.write_text(json.dumps({"study": key}) + "\n")
        self._file: TextIO = path.open("a")

    def _kept(self, key: str) -> int:
        """Length of the whole lines [byte]."""
        raw = self.path.read_bytes()
        whole = raw.rfind(b"\n") + 1
        try:
            found = json.loads(raw[: raw.index(b"\n")])["study"]
        except (ValueError, KeyError, TypeError):
            raise InputError("is no journal of a study", file=str(self.path)) from None
        if found != key:
            reason = "is of another study, or of another version: name another --out"
            raise InputError(reason, file=str(self.path))
        return whole

    def add(self, entry: Entry) -> None:
        """Write a run; it is on its way to the disk when this returns."""
        self._file.write(json.dumps(_plain(entry.__dict__)) + "\n")
        self._file.flush()

    def entries(self) -> Iterator[Entry]:
        """All runs so far, in the order in which they came in."""
        yield from entries_of(self.path)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def entries_of(path: Path) -> Iterator[Entry]:
    """Runs of a journal; of several tries of one the last counts, so it comes again."""
    with path.open() as file:
        next(file)
        for line in file:
            if line.endswith("\n"):
                yield Entry(**json.loads(line))


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
