"""Definitions of message types: complete, and what the classes and an independent reader say."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from rclpy.serialization import serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from rail_corridor.equipment.registry import topics
from rail_msgs_py.message_definition import message_class, message_definition, type_name

TYPES = sorted({type_name(topic.type) for topic in topics()})


def parsed(name: str) -> dict[str, Any]:
    """Fields of a type and of all in it, as the independent reader understands the text."""
    return {
        found: dict(fields)
        for found, (_, fields) in get_types_from_msg(message_definition(name), name).items()
    }


def written(kind: Any) -> str:
    """A type of the independent reader in the words of the Python classes."""
    node, detail = kind
    if node.name == "BASE":
        word = str(detail[0])
        return {"bool": "boolean", "byte": "octet", "float64": "double", "float32": "float"}.get(
            word, word
        )
    if node.name == "NAME":
        package, _, name = str(detail).split("/")
        return f"{package}/{name}"
    inner, size = detail
    return f"sequence<{written(inner)}>" if node.name == "SEQUENCE" else f"{written(inner)}[{size}]"


@pytest.mark.parametrize("name", TYPES)
def test_the_text_says_the_same_as_the_classes(name: str) -> None:
    types = parsed(name)
    assert name in types
    for found, fields in types.items():
        wanted = message_class(found).get_fields_and_field_types()
        assert {field: written(kind) for field, kind in fields.items()} == wanted
        assert list(fields) == list(wanted)


@pytest.mark.parametrize("name", TYPES)
def test_every_type_in_it_is_there_once(name: str) -> None:
    text = message_definition(name)
    heads = [line for line in text.splitlines() if line.startswith("MSG: ")]
    assert len(heads) == len({*heads}) == len(parsed(name)) - 1
    before = [a for a, b in pairwise(text.splitlines()) if b in heads]
    assert {*before} <= {"=" * 80}


def test_a_reader_that_knows_only_the_text_reads_a_message() -> None:
    name = type_name(Float64MultiArray)
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(message_definition(name), name))
    message = Float64MultiArray(data=[1.5, -2.0, 1e300])
    message.layout.dim = [MultiArrayDimension(label="sample", size=2, stride=2)]
    message.layout.data_offset = 1
    read: Any = store.deserialize_cdr(serialize_message(message), name)
    assert read.data.tolist() == [1.5, -2.0, 1e300]
    assert (read.layout.dim[0].label, read.layout.data_offset) == ("sample", 1)


@pytest.mark.parametrize(
    "name",
    [
        *(
            "",
            "Header",
            "std_msgs/Header",
            "std_msgs/msg/Nothing",
            "os/msg/Path",
            "no_such/msg/Type",
        ),
        *("../etc/msg/Passwd", "std_msgs/msg/header", "std_msgs/msg/_Header", "sys/msg/Exit"),
    ],
)
def test_a_type_that_is_not_there_is_told(name: str) -> None:
    with pytest.raises(LookupError, match="no message type"):
        message_class(name)
