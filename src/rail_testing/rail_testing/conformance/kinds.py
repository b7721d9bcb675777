"""The kinds that can be tested: every folder here that has a description."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import cast

from .kind import EquipmentKind

FOLDER = Path(__file__).parent
#: Tests of what is common to all kinds.
SHARED = FOLDER / "shared"


def kind_names() -> list[str]:
    """Names of all kinds.

    >>> kind_names()
    ['atp', 'localizer', 'track_code_receiver', 'vrs', 'zone_controller']
    """
    return sorted(path.parent.name for path in FOLDER.glob("*/kind.py"))


def load_kind(name: str) -> EquipmentKind:
    """The description of a kind; LookupError if there is none of that name."""
    if name not in kind_names():
        raise LookupError(name)
    return cast(EquipmentKind, import_module(f"{__package__}.{name}.kind").KIND)


def folder_of(kind: EquipmentKind) -> Path:
    """Where the tests are that a kind has of its own."""
    return FOLDER / kind.name
