"""The fast way to the kind of a topic is the kind that the equipment says."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from rail_corridor.cli import topic_kinds
from rail_corridor.equipment import registry


def test_every_topic_of_the_corridor_is_of_its_kind() -> None:
    for topic in registry.topics():
        name = re.sub(r"<(\w+)>", r"a_\1", topic.pattern)
        assert topic_kinds.kind_of(name) is registry.kind_of(name) is not None
    assert topic_kinds.kind_of("/rosout") is None


def test_equipment_is_asked_where_others_have_some(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(topic_kinds, "_others_have_equipment", lambda: True)
    monkeypatch.setattr(registry, "kind_of", lambda name: f"kind of {name}")
    assert topic_kinds.kind_of("/dp1/passages") == "kind of /dp1/passages"


def test_no_equipment_is_loaded_to_list_topics() -> None:
    code = (
        "import sys, rail_corridor.cli.live_tools, rail_corridor.cli.echo;"
        "print('rail_corridor.equipment.registry' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
