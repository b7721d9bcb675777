"""YAML files read strictly: plain data, each key once, scalars by the YAML 1.2 core schema.

No anchors, aliases, tags or further documents: a scenario needs none, and they are how a small
file becomes a large one. Numbers such as ``2.4e9`` are numbers here, ``on`` and ``1:30`` are text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import yaml

from .errors import InputError

LARGEST_FILE: Final = 10_000_000
DEEPEST_NEST: Final = 30
_LONGEST_KEY: Final = 200
_LONGEST_NUMBER: Final = 300
_PARSER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INTEGER: Final = re.compile(r"[-+]?[0-9]+")
_BASED: Final = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT: Final = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE: Final = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS: Final = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


def read_text_file(path: Path) -> str:
    """Read a UTF-8 text file of at most 10 MB; InputError says why it cannot be read."""
    name = str(path)
    try:
        if path.is_dir():
            raise InputError("is a directory", file=name)
        if not path.is_file():
            raise InputError(
                "is not a regular file" if path.exists() else "there is no such file", file=name
            )
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"is larger than {LARGEST_FILE // 10**6} MB", file=name)
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=name) from None
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text (byte {error.start})", file=name) from None
    except ValueError:  # a null byte in the name
        raise InputError("is no file name", file=name) from None
    if "\0" in text:
        raise InputError("has a null byte, it is not text", file=name)
    return text


def load_yaml(path: Path) -> dict[str, Any]:
    """Read a YAML file whose top level is a mapping; InputError is one line with the reason."""
    try:
        data = parse_yaml(read_text_file(path))
        if not isinstance(data, dict):
            raise InputError("the top level must be a mapping (field: value)")
    except InputError as error:
        raise error.located(str(path)) from None
    return data


def parse_yaml(text: str) -> Any:
    """Return the data of a YAML text: dict, list, str, int, float, bool, None.

    >>> parse_yaml("{tone_hz: 375e3, comparator: and, low_tone_hz: null}")
    {'tone_hz': 375000.0, 'comparator': 'and', 'low_tone_hz': None}
    """
    try:
        events = yaml.parse(text, Loader=_PARSER)
        first = next(events)
        assert isinstance(first, yaml.StreamStartEvent)
        if isinstance(next(events), yaml.StreamEndEvent):
            raise InputError("is empty")
        data = _node(next(events), events, 0)
        next(events)  # end of the document
        if not isinstance(next(events), yaml.StreamEndEvent):
            raise InputError("holds more than one document")
        return data
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"is not YAML: {error.problem or error.context}{where}") from None
    except (yaml.YAMLError, UnicodeError) as error:
        text = str(getattr(error, "reason", error))
        raise InputError(f"is not YAML: {text}") from None


def _node(event: yaml.Event, events: Iterator[yaml.Event], depth: int) -> Any:
    """Build the data that begins with an event."""
    line = _line(event)
    if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
        raise InputError(f"anchors and aliases are not allowed, line {line}")
    if depth > DEEPEST_NEST:
        raise InputError(f"is nested deeper than {DEEPEST_NEST} levels, line {line}")
    if getattr(event, "tag", None) not in (None, "!"):
        raise InputError(f"tags are not allowed, line {line}")
    if isinstance(event, yaml.ScalarEvent):
        return _scalar(event.value) if event.implicit[0] else event.value
    if isinstance(event, yaml.SequenceStartEvent):
        items = []
        while not isinstance(event := next(events), yaml.SequenceEndEvent):
            items.append(_node(event, events, depth + 1))
        return items
    mapping: dict[str, Any] = {}
    while not isinstance(event := next(events), yaml.MappingEndEvent):
        line = _line(event)
        key = _node(event, events, depth + 1)
        if not isinstance(key, str) or len(key) > _LONGEST_KEY:
            raise InputError(
                f"a field name must be text of at most {_LONGEST_KEY} characters, line {line}",
                field="(key)",
                value=key,
            )
        if key in mapping:
            raise InputError(f"the field comes twice, line {line}", field=key, value=key)
        mapping[key] = _node(next(events), events, depth + 1)
    return mapping


def _line(event: yaml.Event) -> int:
    return event.start_mark.line + 1 if event.start_mark else 0


def _scalar(text: str) -> Any:
    """Resolve a plain scalar by the core schema of YAML 1.2."""
    if text in _WORDS:
        return _WORDS[text]
    if len(text) > _LONGEST_NUMBER:  # beyond any float; the model says which field it is
        return text
    if _INTEGER.fullmatch(text):
        return int(text)
    if _BASED.fullmatch(text):
        return int(text, 0)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _NOT_FINITE.fullmatch(text):
        return float(text.replace(".", "", 1))
    return text
