"""What equipment adds to the map of the corridor."""

from __future__ import annotations

from .description_base import Description


class Mast(Description):
    """Something that stands at a place of the map [m], under its name."""

    name: str
    position_m: tuple[float, float, float]


class Stretch(Description):
    """A part of a track; those of one group have one colour."""

    name: str
    track: str
    start_m: float
    end_m: float
    group: int


class Drawing(Description):
    """Masts and stretches."""

    masts: tuple[Mast, ...] = ()
    stretches: tuple[Stretch, ...] = ()
