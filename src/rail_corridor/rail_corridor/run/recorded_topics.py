"""Whether there will be the topics that are to be recorded, before anything starts."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from rail_corridor.equipment.registry import node_kinds, topics
from rail_corridor.errors import InputError
from rail_corridor.plan.plan import Plan
from rail_corridor.recording.topic_selection import TopicSelection, fits_some_name
from rail_corridor.report.map_poses import TRUTH, locators_of
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.waveform import Waveform

from .options import RunOptions


def check_recorded_topics(options: RunOptions, plan: Plan) -> None:
    """Raise InputError for a pattern that fits no topic of a run.

    What somebody else's node sends beside ours nobody knows beforehand: then all are good.
    """
    if options.record is not None and not options.external:
        check_topics(options.record.selection, plan)


def check_topics(selection: TopicSelection, plan: Plan) -> None:
    """Raise InputError for a pattern that fits no topic of a plan."""
    sent = [
        topic
        for topic in topics()
        if _is_sent(topic, plan) and (selection.waveforms or topic.view is not Waveform)
    ]
    words = names_in(plan)
    for pattern in selection.patterns:
        if not any(fits_some_name(pattern, topic.pattern, words) for topic in sent):
            reason = f"fits no topic of {plan.scenario}"
            reason += "" if selection.waveforms else " that carries no waveforms"
            raise InputError(reason, field="--record-topics", value=pattern)


def _is_sent(topic: Topic, plan: Plan) -> bool:
    """Whether the plan has a node that sends it; of what every node sends there is some."""
    senders = node_kinds().keys() & {*re.findall(r"\w+", topic.sender)}
    return not senders or not senders.isdisjoint(spec.kind for spec in plan.nodes)


def names_in(plan: Plan) -> frozenset[str]:
    """What may stand in the name of a topic: of nodes, tracks, trains, and of what nodes know.

    Zones and channels are known to the nodes that work on them, as parameters; equipment is a
    source of poses by its own name.
    """
    names = {spec.name for spec in plan.nodes}
    words = {word for name in names for word in name.strip("/").split("/")}
    known = {word for spec in plan.nodes for word in _words(spec.parameters.values())}
    trains = (train.name for train in plan.world.trains)
    sources = (TRUTH, *(each.name for each in locators_of(plan.records)))
    return frozenset((*names, *words, *known, *trains, *plan.world.tracks, *sources))


def _words(values: Any) -> Iterator[str]:
    """Texts and whole numbers among values, and in the arrays among them."""
    for value in values:
        if isinstance(value, tuple | list):
            yield from _words(value)
        elif isinstance(value, str | int) and not isinstance(value, bool):
            yield str(value)
