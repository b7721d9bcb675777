"""What of a topic ``rail echo`` shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .filters import Filter
from .usage import UsageError

Format = Literal["text", "csv", "json"]


@dataclass(frozen=True)
class Selection:
    """What of a topic is shown.

    Parameters
    ----------
    fields : tuple of str
        Names; everything if empty.
    row : str, optional
        Of a table: this row alone.
    where : Filter, optional
        Only messages, or rows of them, for which it holds.
    every : int
        Each so many-th of those.
    count : int, optional
        End after so many messages shown.
    format : 'text', 'csv' or 'json'
    raw : bool
        Whether the message is shown, not its view.
    """

    fields: tuple[str, ...] = ()
    row: str | None = None
    where: Filter | None = None
    every: int = 1
    count: int | None = None
    format: Format = "text"
    raw: bool = False


def field_names_in(text: str) -> tuple[str, ...]:
    """Names in the text of an option, as ``a,b``; UsageError if one is empty."""
    names = tuple(name.strip() for name in text.split(","))
    if not all(names):
        raise UsageError(f"--field: {text!r}: must be names with commas between")
    return names
