"""Subsystems of other distributions: found by their entry points, refused by one line."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import pytest
from std_msgs.msg import String

from rail_corridor.cli import decoded
from rail_corridor.cli.topic_docs import ends_of
from rail_corridor.equipment import registry
from rail_corridor.equipment.node_spec import NodeKind
from rail_corridor.equipment.subsystem import SectionOption, Subsystem
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import builtin_scenarios, load_scenario
from rail_corridor.scenario.faults import Fault
from rail_corridor.scenario.model import Section
from rail_msgs_py.topics.qos import STREAM
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import STATE

Install = Callable[..., Subsystem]
UNREAD = "what it declares cannot be read"


class _Entry:
    """An entry point as `importlib.metadata` gives it."""

    def __init__(self, name: str, value: str, loaded: Any) -> None:
        self.name, self.value, self._loaded = name, value, loaded

    def load(self) -> Any:
        if isinstance(self._loaded, BaseException):
            raise self._loaded
        return self._loaded


def ask_anew() -> None:
    """Forget what entry points were found before."""
    for each in (
        *(registry.subsystems, registry.node_kinds, registry.topics),
        registry.live_views,
    ):
        each.cache_clear()


@pytest.fixture
def entries(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """Return the list of entry points that the registry finds."""
    found: list[Any] = []
    monkeypatch.setattr(registry, "entry_points", lambda group: found)
    ask_anew()
    yield found
    ask_anew()


@pytest.fixture
def install(entries: list[Any]) -> Install:
    """Return a function that makes a subsystem with given fields, and installs it."""

    def make(**fields: Any) -> Subsystem:
        extra = type("Extra", (Subsystem,), {"name": "extra", **fields})()
        entries.append(_Entry("extra", "extra.subsystem:EXTRA", extra))
        ask_anew()
        return extra  # type: ignore[no-any-return]

    return make


class _Other(Fault):
    kind: Literal["train_stop"]


class _Sanding(Fault):
    kind: Literal["sanding"]


def topic(pattern: str, view: Any = None) -> Topic:
    return Topic(pattern, String, STREAM, view, "extra_node", "people", "Something.")


def test_a_subsystem_of_another_distribution_comes_last(install: Install) -> None:
    extra = install(
        nodes=(NodeKind("extra_node", "extra.node:ExtraNode"),), topics=(topic("/extra"),)
    )
    assert registry.subsystems() == (*registry.BUILTIN, extra)
    assert "extra_node" in registry.node_kinds()
    assert registry.kind_of("/extra") is extra.topics[0]


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"name": "doppler"}, "name doppler belongs to doppler"),
        ({"sections": (Section("cbtc", None, ""),)}, "section cbtc belongs to train_radio"),
        ({"sections": (Section("trains", None, ""),)}, "section trains belongs to the corridor"),
        ({"faults": (_Other,)}, "kind of fault train_stop belongs to the corridor"),
        ({"faults": (_Sanding,)}, "kind of fault sanding belongs to track_code"),
        (
            {"options": (SectionOption("--spacing", "extra", "spacing_m"),)},
            "option --spacing belongs to doppler",
        ),
        ({"nodes": (NodeKind("wrs", "a:B"),)}, "kind of node wrs belongs to ranging"),
        ({"nodes": (NodeKind("world", "a:B"),)}, "kind of node world belongs to the corridor"),
        ({"topics": (topic("/world/state"),)}, "topic /world/state belongs to the corridor"),
        (
            {"topics": (topic("/wayside/{a}/{b}/range"),)},
            "topic /wayside/{}/{}/range belongs to ranging",
        ),
        ({"sections": (Section("extra", None, ""),) * 2}, "section extra is declared twice"),
        ({"topics": (topic("/{a}/own"), topic("/{b}/own"))}, "topic /{}/own is declared twice"),
        ({"faults": (Fault,)}, f"{UNREAD}: ValueError: Fault has no kind: Literal[...]"),
        (
            {"faults": (int,)},
            f"{UNREAD}: AttributeError: type object 'int' has no attribute 'model_fields'",
        ),
        ({"nodes": None}, f"{UNREAD}: TypeError: 'NoneType' object is not iterable"),
        (
            {"sections": ("extra",)},
            f"{UNREAD}: AttributeError: 'str' object has no attribute 'name'",
        ),
    ],
)
def test_a_declaration_that_is_wrong_or_taken_is_refused(
    install: Install, fields: dict[str, Any], line: str
) -> None:
    install(**fields)
    with pytest.raises(InputError) as refused:
        registry.subsystems()
    where = "rail_corridor.equipment: 'extra.subsystem:EXTRA'"
    assert str(refused.value) == f"{where}: {line}"


@pytest.mark.parametrize(
    ("loaded", "line"),
    [
        (ImportError("no module extra"), "cannot be loaded: ImportError: no module extra"),
        (SystemExit(7), "cannot be loaded: SystemExit: 7"),
        (Subsystem, "is not a Subsystem"),  # the class instead of an instance
    ],
)
def test_an_entry_point_that_cannot_be_used_is_named(
    entries: list[Any], loaded: Any, line: str
) -> None:
    entries.append(_Entry("extra", "extra:EXTRA", loaded))
    with pytest.raises(InputError, match=line):
        registry.subsystems()


def test_names_of_the_kinds_that_are_built_in_are_taken_once() -> None:
    for name in ("section", "kind of fault", "option", "kind of node", "topic"):
        names = [n for each in registry.BUILTIN for n in registry.names_of(each)[name]]
        assert len(set(names)) == len(names)
        assert names or name == "option"


def test_scenarios_come_with_equipment(install: Install, tmp_path: Path) -> None:
    plain = builtin_scenarios()["plain_line"]
    (tmp_path / "extra_line.yaml").write_text(plain.read_text())
    (tmp_path / "notes.txt").write_text("nothing")
    install(scenarios=tmp_path)
    assert {*builtin_scenarios()} - {"extra_line"} == {path.stem for path in plain.parent.glob("*")}
    assert load_scenario("extra_line").name == "plain_line"


def test_a_scenario_with_a_name_that_is_taken_is_refused(install: Install, tmp_path: Path) -> None:
    (tmp_path / "demo.yaml").write_text("name: demo\n")
    install(scenarios=tmp_path)
    with pytest.raises(InputError, match=r"there is one of this name already, .*builtin/demo.yaml"):
        builtin_scenarios()


def test_who_reads_the_truth_says_so_by_itself(install: Install) -> None:
    before = ends_of(STATE)[1]
    install(nodes=(NodeKind("extra_medium", "a:B", clocked=True, reads=(STATE,)),))
    assert ends_of(STATE)[1] == before.replace(", the report", ", extra_medium, the report")
    assert ends_of(CLOCK)[1].endswith("extra_medium")


class _View:
    """A view that the corridor does not know."""

    stamp_ns = 1_500_000_000

    def __init__(self, text: str) -> None:
        self._text = text

    @classmethod
    def from_msg(cls, message: Any) -> _View:
        if not message.data:
            raise ValueError("empty")
        return cls(message.data)

    def describe(self) -> str:
        return f"said {self._text}"


def test_a_view_of_another_distribution_is_shown_as_it_says(install: Install) -> None:
    install(topics=(topic("/extra", _View),))
    assert decoded.decode("/extra", String(data="hello")).strip() == "1.500 s  said hello"
    assert decoded.decode("/extra", String()).startswith("(empty)\n")
