"""Documents the topics and the parameters of all nodes, from the tables the nodes themselves use.

``python -m rail_corridor.cli.topic_docs [FILE]`` writes ``docs/topics.md``, or prints it without
FILE.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from pathlib import Path
from typing import Any, get_type_hints

from rail_corridor.equipment.registry import node_kinds, topics
from rail_msgs_py.message_definition import type_name
from rail_msgs_py.off_times import OffTimeParameters
from rail_msgs_py.quantity import Quantity, quantity_of
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.qos import ESTIMATE, LATCHED, OBSERVER_WINDOW_TICKS, STREAM, name_of
from rail_msgs_py.topics.tick import CLOCK, DONE, FAILED
from rail_msgs_py.topics.topic import Topic

_INTRODUCTION = """\
# Topics and parameters

Every message is of a standard type: any ROS 2 machine can echo, plot and record it. The names are
made of the sites, zones, tracks, trains and channels of the scenario. *View* is the class in
`rail_msgs_py` that turns a message into a typed, frozen object; `rail echo` uses it.

The tables are made from the code by `python docs/refresh.py`, or all of this file by
`python -m rail_corridor.cli.topic_docs docs/topics.md`; tests compare them with the code and with a
running graph.
"""

_COLUMNS = """\
## Columns of tables

A table is one row or more of numbers, in the order of these columns; their names travel in the
layout of each message (`rail_msgs_py/table.py`). A count is of what happened up to the stamp.
"""

_PARAMETERS = """\
## Parameters

Each node takes these as ROS parameters, on the command line or from a parameter file. They are read
once, when the node starts. A value of the wrong type or out of bounds ends the node with one line
and exit code 2. Bounds of an array hold for each of its numbers.
"""


def document() -> str:
    """Return the whole of ``docs/topics.md``."""
    # The marks are those of docs/refresh.py.
    begin = "<!-- generated: rail_corridor.cli.topic_docs:tables -->"
    return f"{_INTRODUCTION}\n{begin}\n{tables()}<!-- end of generated -->\n"


def tables() -> str:
    """Return the generated part: topics, columns, quality of service, parameters of nodes."""
    parts = [topic_table(), column_tables(), qos_table(), _PARAMETERS]
    parts += [parameter_table(kind, parameters_of(kind)) for kind in node_kinds()]
    return "\n".join([*parts, parameter_table("Every node but the world", OffTimeParameters)])


def parameters_of(kind: str) -> Any:
    """Parameters of a kind of node."""
    return node_kinds()[kind].load().parameter_type


def declared_by(kind: str) -> dict[str, dataclasses.Field[Any]]:
    """Every parameter that a kind of node declares, by its name."""
    parameters = [parameters_of(kind)]
    if issubclass(node_kinds()[kind].load(), EquipmentNode):
        parameters.append(OffTimeParameters)
    return {field.name: field for each in parameters for field in dataclasses.fields(each)}


def ends_of(topic: Topic) -> tuple[str, str]:
    """Who sends a topic, and who reads it.

    Of the topics of the tick itself, those kinds of nodes whose part in it says so; of the others
    also those that say it by themselves, see `NodeKind.reads`.
    """
    kinds = node_kinds().values()
    waiting = ", ".join(kind.name for kind in kinds if kind.waits)
    if topic is CLOCK:
        return topic.sender, ", ".join(kind.name for kind in kinds if kind.clocked)
    if topic is DONE:
        return ", ".join(kind.name for kind in kinds if kind.sink), topic.readers
    if topic is FAILED:
        return f"{topic.sender}: {waiting}", f"{waiting}, the report"
    readers = [kind.name for kind in kinds if any(topic is each for each in kind.reads)]
    return topic.sender, ", ".join(filter(None, (*readers, topic.readers)))


def topic_table() -> str:
    """Return the Markdown table of all topics."""
    rows = ["## Topics\n", "| Topic | Type | View | QoS | From | To |", "|---|---|---|---|---|---|"]
    table = topics()
    for topic in table:
        sender, readers = ends_of(topic)
        view = f"`{topic.view.__name__}`" if topic.view else ""
        rows.append(
            f"| `{_shown(topic.pattern)}` | `{type_name(topic.type)}` | {view}"
            f" | {name_of(topic.qos)} | {sender} | {readers} |"
        )
    rows.append("\nWhat they carry:\n")
    rows += [f"- `{_shown(topic.pattern)}`: {topic.text}" for topic in topics()]
    return "\n".join(rows) + "\n"


def column_tables() -> str:
    """Return a Markdown table of the columns of each topic that is a table."""
    parts = [_COLUMNS]
    for topic in topics():
        if topic.table:
            rows = [
                f"### `{_shown(topic.pattern)}`\n",
                "| Column | Unit | Meaning |",
                "|---|---|---|",
                *(f"| `{_shown(each.name)}` | {each.unit} | {each.text} |" for each in topic.table),
            ]
            parts.append("\n".join(rows) + "\n")
    return "\n".join(parts)


def _shown(name: str) -> str:
    """A name with its placeholders as the documents write them."""
    return name.replace("{", "<").replace("}", ">")


def qos_table() -> str:
    """Return the Markdown table of the quality-of-service profiles."""
    uses = {
        "stream": "blocks and readings of a tick, read by nodes that the tick waits for",
        "estimate": f"also read by the report, which may lag by {OBSERVER_WINDOW_TICKS} ticks",
        "latched": "state that late joiners must learn",
    }
    rows = [
        "## Quality of service\n",
        "| Profile | Reliability | Durability | History | For |",
        "|---|---|---|---|---|",
    ]
    for profile in (STREAM, ESTIMATE, LATCHED):
        reliability = profile.reliability.name.lower()
        durability = profile.durability.name.lower().replace("_", " ")
        history = f"{profile.history.name.lower().replace('_', ' ')} {profile.depth}"
        name = name_of(profile)
        rows.append(f"| {name} | {reliability} | {durability} | {history} | {uses[name]} |")
    return "\n".join(rows) + "\n"


def parameter_table(kind: str, parameters: Any) -> str:
    """Return the Markdown table of the parameters of a kind of node."""
    hints = get_type_hints(parameters)
    rows = [
        f"### {kind}\n",
        "| Parameter | Type | Default | Unit | Bounds | Meaning |",
        "|---|---|---|---|---|---|",
    ]
    for field in dataclasses.fields(parameters):
        about = quantity_of(field)
        rows.append(
            f"| `{field.name}` | {_type(hints[field.name])} | {_value(field.default)}"
            f" | {about.unit} | {_bounds(about)} | {about.text} |"
        )
    return "\n".join(rows) + "\n"


def _type(hint: Any) -> str:
    item = getattr(hint, "__args__", None)
    names = {float: "double", int: "integer", str: "string", bool: "bool"}
    return f"{names[item[0]]} array" if item else names[hint]


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(_value(item) for item in value)}]"
    if isinstance(value, float):
        return f"{value:.12g}" if 1e-3 <= abs(value) < 1e5 or value == 0.0 else f"{value:g}"
    return str(value) if value != "" else "empty"


def _bounds(quantity: Quantity[Any]) -> str:
    if quantity.choices:
        return f"one of {', '.join(map(str, quantity.choices))}"
    parts = []
    if math.isfinite(quantity.low):
        word = "above" if quantity.low_open else "from"
        parts.append(f"{word} {_value(float(quantity.low))}")
    if math.isfinite(quantity.high):
        parts.append(f"to {_value(float(quantity.high))}")
    return " ".join(parts)


def main(arguments: list[str]) -> int:
    """Write or print the document; return the exit code."""
    if len(arguments) > 1:
        print("usage: python -m rail_corridor.cli.topic_docs [FILE]", file=sys.stderr)
        return 2
    if arguments:
        Path(arguments[0]).write_text(document(), encoding="utf-8")
    else:
        print(document(), end="")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
