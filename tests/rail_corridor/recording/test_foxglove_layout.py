"""The Foxglove layout: its panels are there, and its topics are the corridor's."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rail_corridor.equipment.registry import kind_of
from rail_corridor.loading.loader import load_scenario

LAYOUT = json.loads(
    (Path(__file__).resolve().parents[3] / "examples" / "foxglove_layout.json").read_text()
)


def panels(tree: Any) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
    else:
        assert tree["direction"] in ("row", "column")
        yield from panels(tree["first"])
        yield from panels(tree["second"])


def test_every_panel_is_placed_once() -> None:
    placed = list(panels(LAYOUT["layout"]))
    assert sorted(placed) == sorted(LAYOUT["configById"])


def test_its_topics_are_those_of_the_demo_corridor() -> None:
    demo = load_scenario("demo")
    names = {*demo.tracks, *(train.name for train in demo.trains)}
    panel = LAYOUT["configById"]
    paths = [
        *panel["3D!corridor"]["topics"],
        *(p["value"] for each in panel.values() for p in each.get("paths", ())),
        *(
            each[key]
            for each in panel.values()
            for key in ("topicPath", "topicToRender")
            if key in each
        ),
    ]
    assert len(paths) > 10
    for path in paths:
        topic, _, fields = path.partition(".")
        kind = kind_of(topic)
        assert kind is not None, path
        placeholders = re.findall(r"\{(train|track)\}", kind.pattern)
        found = re.fullmatch(re.sub(r"\{\w+\}", "([^/]+)", kind.pattern), topic)
        assert found
        assert placeholders == [] or set(found.groups()) <= names, path
        message = kind.type()
        for field in filter(None, re.sub(r"\[\d+\]", "", fields).split(".")):
            if not field.startswith("@"):
                message = getattr(message, field)
