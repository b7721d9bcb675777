"""The one error that wrong data about the world raises."""

from __future__ import annotations

_LONGEST_VALUE = 60


def shorten(value: object) -> str:
    r"""Return the value as one printable line of at most 60 characters.

    >>> shorten("two\nlines")
    "'two\\nlines'"
    """
    text = value[:200] if isinstance(value, str) else value
    try:
        shown = repr(text)
    except (ValueError, RecursionError):  # integers of more than 4300 digits, deep nests
        shown = f"<{type(value).__name__}>"
    shown = " ".join(shown.split())
    return shown if len(shown) <= _LONGEST_VALUE else shown[: _LONGEST_VALUE - 3] + "..."


class WorldDataError(ValueError):
    """Data that describe no possible world, said in one line.

    Attributes
    ----------
    field : str
        Dotted path of the field, for example ``junctions.0.at_m``.
    value : object
        What was found there.
    reason : str
        What is wrong with it.
    file : str or None
        The file it came from, if it came from one.
    """

    def __init__(self, field: str, value: object, reason: str, *, file: str | None = None) -> None:
        self.field = field
        self.value = value
        self.reason = " ".join(reason.split())
        self.file = file
        where = f"{file}: " if file else ""
        super().__init__(f"{where}{field}: {shorten(value)}: {self.reason}")
