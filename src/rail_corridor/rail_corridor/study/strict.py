"""What the fields of study files and of their sources have in common."""

from __future__ import annotations

from collections.abc import Collection

from pydantic import BaseModel, ConfigDict

from rail_corridor.errors import did_you_mean


class Strict(BaseModel):
    """Base of models: frozen, no unknown field."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def one_of(known: Collection[str], value: str, what: str) -> str:
    """The value, if it is known.

    Raises
    ------
    ValueError
        If not: tells which are, and the nearest one.
    """
    if value not in known:
        near = did_you_mean(value, known)
        raise ValueError(f"there is no such {what}{near}; there are {', '.join(known)}")
    return value
