"""Which topics are recorded, and whether a pattern can fit any."""

from __future__ import annotations

from fnmatch import fnmatchcase
from itertools import product

import pytest

from rail_corridor.recording.topic_selection import (
    EVERY_TOPIC,
    TopicSelection,
    fits_some_name,
)
from rail_msgs_py.topics.ranging import POSITION, VRS_RX, WRS_TX
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.topics.topic import Topic

WORDS = ("a", "ab", "b1", "12")
PATTERNS = ("/{x}/vrs/channel_{y}/rx", "/wayside/{x}/{y}/tx", "/{x}", "/clock", "/a/{x}_b")


@pytest.mark.parametrize(
    ("topic", "name", "selection", "taken"),
    [
        (WRS_TX, "/wayside/wrs1/zone1/tx", EVERY_TOPIC, True),
        (WRS_TX, "/wayside/wrs1/zone1/tx", TopicSelection(waveforms=False), False),
        (WRS_TX, "/wayside/wrs1/zone1/tx", TopicSelection(("*/tx",), waveforms=False), False),
        (WRS_TX, "/wayside/wrs1/zone1/tx", TopicSelection(("/wayside/*",)), True),
        (WRS_TX, "/wayside/wrs1/zone1/tx", TopicSelection(("/Wayside/*",)), False),
        (POSITION, "/wayside/zone_controller/a/position", TopicSelection(waveforms=False), True),
        (POSITION, "/wayside/zone_controller/a/position", TopicSelection(("position",)), False),
        (CLOCK, "/clock", TopicSelection(("*/tx",), waveforms=False), True),
    ],
)
def test_a_topic_is_taken_by_its_name_and_kind(
    topic: Topic, name: str, selection: TopicSelection, taken: bool
) -> None:
    assert selection.takes(topic, name) is taken


@pytest.mark.parametrize(
    "selection",
    [EVERY_TOPIC, TopicSelection(waveforms=False), TopicSelection(("/a/*", "[bc]?"), False)],
)
def test_a_recording_says_what_was_selected(selection: TopicSelection) -> None:
    assert TopicSelection.of(selection.values()) == selection
    assert bool(selection.describe()) is (selection != EVERY_TOPIC)


def test_a_recording_that_says_nothing_of_it_holds_every_topic() -> None:
    assert TopicSelection.of({"seed": "3"}) == EVERY_TOPIC


@pytest.mark.parametrize(
    "glob",
    [
        *("*", "**", "/*/rx", "/a/*", "/c/*", "/?/vrs/*", "/[ab]*/vrs/channel_12/rx", "*_12/*x"),
        *("/[!a]*/*/*_[0-9]/*", "/wayside/a/ab/tx", "/wayside/a/abc/tx", "/clock", "/cloc", "/a/a"),
        *("/a/*_b", "/a/?_b", "/a/_b", "", "clock", "/clock*", "/clock?", "/[", "*[1]2*"),
    ],
)
@pytest.mark.parametrize("pattern", PATTERNS)
def test_it_fits_some_name_if_it_fits_one_of_all(glob: str, pattern: str) -> None:
    names = [pattern.format(x=x, y=y) for x, y in product(WORDS, repeat=2)]
    expected = any(fnmatchcase(name, glob) for name in names)
    assert fits_some_name(glob, pattern, WORDS) is expected


def test_a_topic_without_waveforms_is_told_by_its_view() -> None:
    assert not TopicSelection(waveforms=False).takes(VRS_RX, VRS_RX.name(train="a", channel=1))
