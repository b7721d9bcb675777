"""Profiles as text: what rosbag2 writes, read back here and by an independent reader."""

from __future__ import annotations

from typing import Any

import pytest
import yaml
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosbags.rosbag2.metadata import parse_qos

from rail_msgs_py.topics.qos import ESTIMATE, LATCHED, STREAM
from rail_msgs_py.topics.qos_text import offered_profiles, profile_from

OTHER = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)


@pytest.mark.parametrize("profile", [STREAM, ESTIMATE, LATCHED, OTHER])
def test_it_comes_back_as_it_was(profile: QoSProfile) -> None:
    (fields,) = yaml.safe_load(offered_profiles(profile))
    back = profile_from(fields)
    assert back.history == profile.history
    assert back.reliability == profile.reliability
    assert back.durability == profile.durability
    if profile.history == HistoryPolicy.KEEP_LAST:
        assert back.depth == profile.depth


@pytest.mark.parametrize("profile", [STREAM, ESTIMATE, LATCHED])
def test_an_independent_reader_understands_it(profile: QoSProfile) -> None:
    (read,) = parse_qos(offered_profiles(profile))
    assert (read.history.name, read.depth) == ("KEEP_LAST", profile.depth)
    assert (read.reliability.name, read.durability.name) == (
        profile.reliability.name,
        profile.durability.name,
    )
    assert (read.lifespan.sec, read.lifespan.nsec) == (9223372036, 854775807)


def test_the_numbers_of_older_recordings_and_what_was_not_known() -> None:
    old = {"history": 1, "depth": 5, "reliability": 1, "durability": 1}
    assert profile_from(old).depth == 5
    assert profile_from(old).durability == DurabilityPolicy.TRANSIENT_LOCAL
    unknown = profile_from(
        {"history": "unknown", "depth": 0, "reliability": "reliable", "durability": "volatile"}
    )
    assert (unknown.history, unknown.depth) == (HistoryPolicy.KEEP_LAST, 10)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *(("history", "for_ever"), ("reliability", None), ("durability", 17), ("depth", "many")),
        *(("depth", -1), ("depth", 10**9), ("history", []), ("reliability", {})),
    ],
)
def test_what_is_no_profile_is_refused(key: str, value: Any) -> None:
    good = {"history": "keep_last", "depth": 8, "reliability": "reliable", "durability": "volatile"}
    with pytest.raises(ValueError, match=key):
        profile_from({**good, key: value})
