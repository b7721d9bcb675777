"""The table of topics: names can be told apart, types and quality of service are sound."""

from __future__ import annotations

import importlib
import itertools
import pkgutil
import re

import pytest
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)

import rail_msgs_py.topics
from rail_corridor.cli.topic_docs import column_tables, ends_of
from rail_corridor.equipment.registry import kind_of, topics
from rail_msgs_py.table import Table
from rail_msgs_py.topics.column import Column
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.qos import ESTIMATE, LATCHED, OBSERVER_WINDOW_TICKS, STREAM, name_of
from rail_msgs_py.topics.ranging import RANGE, VRS_CHANNEL
from rail_msgs_py.topics.tick import FAILED, FINISHED, OBSERVED, READY
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.train_bus import BUS_STATE, BUS_TREND
from rail_msgs_py.topics.train_radio import STRIKES
from rail_msgs_py.topics.world import CORRIDOR_PATH
from rail_signals.doppler.solver import NoFixReason
from rail_signals.localizer.protection_level import ProtectionReason, Status
from rail_signals.localizer.settings import Sensor
from rail_signals.train_bus.faults import KINDS
from rail_world.train_radio.frame_threats import Threat

PARTS = {
    "train": ("train_1", "a", "world_2"),
    "site": ("wrs1", "zone_controller_2", "s"),
    "zone": ("zone1", "tx", "range"),
    "circuit": ("tc1", "wrs1", "zone_controller"),
    "track": ("main", "markers", "path"),
    "channel": (1, 42),
    "base": ("base1", "wrs1", "b"),
    "station": ("ref1", "wrs1", "r"),
    "supervision": ("atp", "code_supervision"),
    "end": ("head", "tail"),
    "source": ("truth", "ranging"),
    "node": ("/world/radio_medium", "/wayside/zone_controller"),
}
MODULES = [
    importlib.import_module(f"rail_msgs_py.topics.{found.name}")
    for found in pkgutil.iter_modules(rail_msgs_py.topics.__path__)
]
#: Every topic that a module defines.
FIELDS = {
    name: value
    for module in MODULES
    for name, value in vars(module).items()
    if isinstance(value, Topic)
}


def placeholders(topic: Topic) -> list[str]:
    """Return the names of the placeholders of a pattern."""
    return re.findall(r"\{(\w+)\}", topic.pattern)


def names_of(topic: Topic) -> list[str]:
    """Return several names of a kind of topic, some of them chosen to confuse."""
    keys = placeholders(topic)
    combinations = itertools.product(*(PARTS[key] for key in keys))
    return [topic.name(**dict(zip(keys, values, strict=True))) for values in combinations]


def test_the_table_is_complete_and_names_nothing_twice() -> None:
    assert sorted(topics(), key=lambda t: t.pattern) == sorted(
        FIELDS.values(), key=lambda t: t.pattern
    )
    assert len({topic.pattern for topic in topics()}) == len(topics())


@pytest.mark.parametrize("topic", topics(), ids=lambda t: t.pattern)
def test_every_name_tells_its_kind_and_no_other(topic: Topic) -> None:
    for name in names_of(topic):
        assert re.fullmatch(r"(/[A-Za-z_]\w*)+", name), "a ROS name"
        assert kind_of(name) is topic
        others = [other.pattern for other in topics() if other is not topic and other.matches(name)]
        assert others == []


@pytest.mark.parametrize("topic", topics(), ids=lambda t: t.pattern)
def test_every_topic_is_documented(topic: Topic) -> None:
    for text in (*ends_of(topic), topic.text):
        assert text.strip()
    assert topic.text.endswith(".")
    assert name_of(topic.qos) in ("stream", "estimate", "latched")


@pytest.mark.parametrize("topic", [t for t in topics() if t.view is Table], ids=lambda t: t.pattern)
def test_every_column_of_a_table_is_explained(topic: Topic) -> None:
    assert topic.table
    assert len(topic.column_texts) == len(topic.columns)
    assert len({column.name for column in topic.table}) == len(topic.table)
    for column in topic.table:
        # Without a unit in its name it is a count, a number of something, a flag, or it says what.
        assert column.unit or len(column.text.split()) > 3, column.name
        assert f"| `{column.name.replace('{', '<').replace('}', '>')}` | {column.unit} | " in (
            column_tables()
        )


def test_a_table_whose_columns_the_scenario_counts_has_no_fixed_ones() -> None:
    assert VRS_CHANNEL.columns == VRS_CHANNEL.column_texts == ()
    assert VRS_CHANNEL.table[-1].unit == "dBm"


@pytest.mark.parametrize(("name", "text"), [("", "a number"), ("axles", "")])
def test_a_column_without_name_or_text_is_refused(name: str, text: str) -> None:
    with pytest.raises(ValueError, match="needs a name and a text"):
        Column(name, text)


ENUMERATIONS = [
    (DOPPLER_FIX, "reason", {int(r): r.name for r in NoFixReason if r}),
    (LOCALIZER_STATE, "status", {int(s): s.name for s in Status}),
    (LOCALIZER_STATE, "reason", {int(r): r.name for r in ProtectionReason}),
    (LOCALIZER_STATE, "excluded", {1 << sensor: sensor.name for sensor in Sensor}),
    (BUS_TREND, "kind", dict(enumerate(KINDS, start=1))),
    (BUS_STATE, "kind", {0: "none"} | dict(enumerate(KINDS, start=1))),
]


@pytest.mark.parametrize(
    ("topic", "column", "values"), ENUMERATIONS, ids=lambda x: getattr(x, "pattern", None)
)
def test_an_enumeration_is_told_value_by_value(
    topic: Topic, column: str, values: dict[int, str]
) -> None:
    text = topic.column_texts[topic.index[column]].lower()
    told = {int(number): name for number, name in re.findall(r"(?<![-\w])(\d+) ([a-z ]+)", text)}
    for number, name in values.items():
        assert told[number].strip().startswith(name.lower().replace("_", " ")), name
    assert told.keys() - values.keys() <= {0}, "a value that there is not"


def test_the_threats_stand_in_their_own_order() -> None:
    assert STRIKES.columns[1:] == tuple(threat.value for threat in Threat)


@pytest.mark.parametrize(
    "name", ["/", "/rosout", "/parameter_events", "/wayside/wrs1/zone1", "/train_1/vrs/rx", "tx"]
)
def test_a_foreign_name_has_no_kind(name: str) -> None:
    assert kind_of(name) is None


def test_a_missing_part_of_a_name_is_an_error() -> None:
    with pytest.raises(KeyError):
        RANGE.name(site="wrs1")


@pytest.mark.parametrize("topic", [t for t in topics() if t.view], ids=lambda t: t.pattern)
def test_a_view_reads_the_type_of_its_topic(topic: Topic) -> None:
    assert callable(topic.view.from_msg)
    if topic.type().get_fields_and_field_types().keys() == {"layout", "data"}:
        # an empty multi-array is nobody's layout
        with pytest.raises(ValueError):
            topic.view.from_msg(topic.type())
    else:
        topic.view.from_msg(topic.type())


@pytest.mark.parametrize("profile", [STREAM, ESTIMATE, LATCHED], ids=name_of)
def test_every_profile_is_reliable_and_serves_a_default_reader(profile: QoSProfile) -> None:
    assert profile.reliability == ReliabilityPolicy.RELIABLE
    assert profile.history == HistoryPolicy.KEEP_LAST
    for reader in (QoSProfile(depth=10), profile):
        compatibility, reason = qos_check_compatible(profile, reader)
        assert compatibility != QoSCompatibility.ERROR, reason


def test_what_the_report_reads_outlasts_the_window_it_may_lag() -> None:
    assert ESTIMATE.depth >= 2 * OBSERVER_WINDOW_TICKS
    read_late = [t for t in topics() if "the report" in t.readers and t.qos is not LATCHED]
    assert len(read_late) > 10
    assert all(topic.qos is ESTIMATE for topic in read_late)


def test_what_late_joiners_must_learn_is_latched() -> None:
    latched = (READY, FAILED, FINISHED, CORRIDOR_PATH)
    assert all(t.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for t in latched)
    assert STREAM.durability == DurabilityPolicy.VOLATILE
    # who joins late begins with the newest, not with one of long ago
    assert ESTIMATE.durability == DurabilityPolicy.VOLATILE
    assert OBSERVED.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    # one message of each node at least, and every part of the map
    assert LATCHED.depth >= 100


def test_an_unknown_profile_has_no_name() -> None:
    with pytest.raises(KeyError):
        name_of(QoSProfile(depth=1))
