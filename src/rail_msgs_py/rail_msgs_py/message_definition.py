"""Definitions of message types as text, for files that must explain themselves.

``ros2msg`` form: the ``.msg`` file of the type, then those of all types in it, each after a
line of 80 ``=`` and a line ``MSG: package/Name``.
"""

from __future__ import annotations

import importlib
import re
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

_DELIMITER: Final = "=" * 80
_TYPE_NAME: Final = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Z][A-Za-z0-9]*)")
_FIELD: Final = re.compile(r"([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]")
_PRIMITIVES: Final = {
    *("bool", "byte", "char", "float32", "float64", "string", "wstring"),
    *("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"),
}


def type_name(message: Any) -> str:
    """Return the ROS name of a message class.

    >>> from std_msgs.msg import Header
    >>> type_name(Header)
    'std_msgs/msg/Header'
    """
    package, kind, *_ = message.__module__.split(".")
    return f"{package}/{kind}/{message.__name__}"


def message_class(name: str) -> Any:
    """Return the message class of a ROS type name.

    Raises
    ------
    LookupError
        If there is none here.
    """
    matched = _TYPE_NAME.fullmatch(name)
    try:
        if matched is None:
            raise LookupError
        definitions = getattr(importlib.import_module(f"{matched[1]}.msg"), matched[2])
        definitions.get_fields_and_field_types  # noqa: B018, a class of another kind has none
    except (ImportError, AttributeError, LookupError):
        raise LookupError(f"no message type {name[:100]!r} is installed") from None
    return definitions


@lru_cache(maxsize=256)
def message_definition(name: str) -> str:
    """Complete definition of a type, in ``ros2msg`` form.

    Parameters
    ----------
    name : str
        As ``std_msgs/msg/Header``.

    Raises
    ------
    LookupError
        If the package of a type in it is not installed, or without its definitions.
    """
    texts: dict[str, str] = {}
    waiting = [name]
    while waiting:
        each = waiting.pop(0)
        if each not in texts:
            texts[each] = _file_of(each).read_text(encoding="utf-8")
            waiting += _types_in(texts[each], each.partition("/")[0])
    root = texts.pop(name)
    parts = (f"{_DELIMITER}\nMSG: {_short(each)}\n{text}" for each, text in texts.items())
    return "\n".join((root.rstrip("\n"), *(part.rstrip("\n") for part in parts))) + "\n"


def _short(name: str) -> str:
    package, _, kind = name.split("/")
    return f"{package}/{kind}"


def _types_in(text: str, package: str) -> list[str]:
    """Names of the types of the fields, primitives left out."""
    definitions = []
    for line in text.splitlines():
        field = _FIELD.match(line.partition("#")[0].strip())
        if field is None or field[1] in _PRIMITIVES:  # as those of constants are
            continue
        parts = field[1].split("/")
        definitions.append(f"{package if len(parts) == 1 else parts[0]}/msg/{parts[-1]}")
    return definitions


def _file_of(name: str) -> Path:
    """The ``.msg`` file: in ``share`` of the prefix that the Python package is installed below."""
    package, _, kind = name.split("/")
    message_class(name)
    module = Path(importlib.import_module(f"{package}.msg").__file__ or "")
    for prefix in module.parents:
        path = prefix / "share" / package / "msg" / f"{kind}.msg"
        if path.is_file():
            return path
    raise LookupError(f"the definition of {name} is not installed beside its package")
