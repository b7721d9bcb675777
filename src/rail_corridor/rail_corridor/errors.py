"""The one error that wrong input raises, and its one line."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from typing import Any, Final

from pydantic import ValidationError

from rail_world.errors import WorldDataError, shorten

_LONGEST_PART: Final = 300
_FIELD_IN_REASON: Final = re.compile(r"([a-z_]+(?:\.\w+)*): (.*)", re.DOTALL)


class _Missing:
    """Stands for a value that is not there."""

    def __repr__(self) -> str:
        return "(missing)"


MISSING: Final = _Missing()


def did_you_mean(name: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """The end of a sentence that tells of the known name nearest to a wrong one, if one is near.

    >>> did_you_mean("/wayside/wrs11", ["/wayside/wrs1", "/world"])
    ', did you mean /wayside/wrs1'
    >>> did_you_mean("frobnicate", ["/world"])
    ''
    """
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=cutoff)
    return f", did you mean {close[0]}" if close else ""


class InputError(Exception):
    """Input that cannot be used; its text is one line for the user.

    Parameters
    ----------
    reason : str
        What is wrong.
    file : str
        File, or the command line, the value stands in; empty if not known yet.
    field : str
        Dotted path of the field, for example ``trains.0.start_m``; empty for a whole file.
    value : object
        What stands there; only shown together with a field.

    Examples
    --------
    >>> print(InputError("must be positive", file="a.yaml", field="tick_s", value=-1))
    a.yaml: tick_s: -1: must be positive
    """

    def __init__(
        self, reason: str, *, file: str = "", field: str = "", value: object = MISSING
    ) -> None:
        self.reason = reason
        self.file = file
        self.field = field
        self.value = value
        parts = [_printable(file), _printable(field), shorten(value) if field else ""]
        super().__init__(": ".join(part for part in (*parts, _printable(reason)) if part))

    def located(self, file: str) -> InputError:
        """Return the same error with the file it is about, unless it names one."""
        if self.file:
            return self
        return InputError(self.reason, file=file, field=self.field, value=self.value)


def _printable(text: str) -> str:
    """Return text as one printable line of bounded length."""
    text = " ".join(text[: 2 * _LONGEST_PART].split())
    text = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
    return text if len(text) <= _LONGEST_PART else text[: _LONGEST_PART - 3] + "..."


def from_world(error: WorldDataError) -> InputError:
    """Return an error about the world as an input error."""
    return InputError(error.reason, file=error.file or "", field=error.field, value=error.value)


def from_validation(
    error: ValidationError, data: object, known_names: Iterable[str] = ()
) -> InputError:
    """Return the first complaint of a validation as an input error.

    Parameters
    ----------
    error : ValidationError
        What pydantic found.
    data : object
        What was validated: it tells field names from the names of alternatives in the path.
    known_names : iterable of str
        Field names to suggest for an unknown one.
    """
    first = error.errors(include_url=False, include_context=False)[0]
    reason = first["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
    if first["type"] == "missing":
        path = [*_real_path(first["loc"][:-1], data), first["loc"][-1]]
        return InputError("a value is needed", field=_dotted(path))
    if first["type"] == "extra_forbidden":
        path = [*_real_path(first["loc"][:-1], data), first["loc"][-1]]
        reason = "there is no such field"
        reason += did_you_mean(str(path[-1])[:60], known_names, cutoff=0.75)
        return InputError(reason, field=_dotted(path), value=first["input"])
    path = _real_path(first["loc"], data)
    value = first["input"]
    inner = _FIELD_IN_REASON.fullmatch(reason) if first["type"] == "value_error" else None
    if inner:  # validators of whole models name the field they complain about
        inner_path = inner[1].split(".")
        location = _real_path(inner_path, value)
        if isinstance(value, dict):
            value = _value_at(value, location) if len(location) == len(inner_path) else MISSING
        path += inner_path
        reason = inner[2]
    reason = re.sub(r"^Input should be ", "must be ", reason)
    return InputError(reason, field=_dotted(path) or "(file)", value=value)


def _dotted(path: Iterable[object]) -> str:
    return ".".join(str(part)[:60] for part in path)


def _real_path(location: Iterable[Any], data: object) -> list[Any]:
    """Return the parts of an error location that are keys or indices of the data."""
    path: list[Any] = []
    for part in location:
        if isinstance(data, dict) and part in data:
            data = data[part]
            path.append(part)
        elif isinstance(data, list | tuple) and str(part).isdecimal() and int(part) < len(data):
            data = data[int(part)]
            path.append(part)
    return path


def _value_at(data: Any, path: Iterable[Any]) -> Any:
    for part in path:
        data = data[part] if isinstance(data, dict) else data[int(part)]
    return data
