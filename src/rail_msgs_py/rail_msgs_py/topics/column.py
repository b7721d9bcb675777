"""A column of a table: its name, its unit, what it means."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

#: Ending of a name, and the unit that it stands for; the longer before those that it ends in.
_UNITS: Final = {
    "_per_s": "1/s",
    "_m2ps2": "m²/s²",
    "_m2ps": "m²/s",
    "_mps2": "m/s²",
    "_mps": "m/s",
    "_m2": "m²",
    "_m": "m",
    "_s": "s",
    "_hz": "Hz",
    "_rad": "rad",
    "_dbm": "dBm",
    "_db": "dB",
    "_ohm": "Ω",
}


@dataclass(frozen=True)
class Column:
    """One column.

    Parameters
    ----------
    name : str
        Ends in the unit. ``{placeholders}`` stand for columns of which a message has as many as
        the scenario says.
    text : str
        What the values are, with the unit in words where the name has none, every value of an
        enumeration, and the values that mean "there is none".

    Raises
    ------
    ValueError
        If the name or the text is empty.

    Examples
    --------
    >>> Column("speed_mps", "of the train").unit, Column("valid", "1 if it is").unit
    ('m/s', '')
    """

    name: str
    text: str

    def __post_init__(self) -> None:
        if not self.name or not self.text:
            raise ValueError(f"column {self.name!r}: needs a name and a text, got {self.text!r}")

    @property
    def unit(self) -> str:
        """Unit by the ending of the name, empty if it has none."""
        return next((unit for end, unit in _UNITS.items() if self.name.endswith(end)), "")
