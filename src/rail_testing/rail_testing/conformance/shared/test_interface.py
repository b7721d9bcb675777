"""Interface: names, types, quality of service, one message a tick, units and ranges."""

from __future__ import annotations

import pytest
from rclpy.qos import ReliabilityPolicy

from rail_msgs_py.message_definition import type_name
from rail_testing.conformance.bench import Bench

REQUIREMENT = pytest.mark.requirement


@REQUIREMENT("DESIGN, On the wire: standard messages only")
@REQUIREMENT("node contract 4, Quality of service")
def test_topics_have_their_names_types_and_quality_of_service(bench: Bench) -> None:
    """Every output is published once, under its name, with its type, reliable and as kept."""
    bench.start()
    bench.run(bench.tick_s, claims=False)
    for name, topic in bench.ports.outputs.items():
        found = bench.corridor.publishers_of(name)
        if len(found) != 1:
            bench.refuse(f"{name}: is published by {len(found)} nodes; it must be one")
        if found[0].topic_type != type_name(topic.type):
            bench.refuse(f"{name}: is of type {found[0].topic_type}, not {type_name(topic.type)}")
        profile = found[0].qos_profile
        if profile.reliability != ReliabilityPolicy.RELIABLE:
            bench.refuse(f"{name}: is published best effort; it must be reliable")
        if profile.durability != topic.qos.durability:
            bench.refuse(f"{name}: has durability {profile.durability.name}")


@REQUIREMENT("node contract 2, One output per tick")
@REQUIREMENT("DESIGN, Time: synchronous ticks")
def test_every_tick_has_one_message_on_each_output(bench: Bench) -> None:
    """One message for each stamp, in its tick, in the declared form, every value in its range."""
    bench.start()
    bench.run(15.0, claims=False)


@REQUIREMENT("DESIGN, What a claim is")
def test_it_does_its_work_and_what_it_claims_is_so(bench: Bench) -> None:
    """Where nothing is wrong it works, and its claims are compared with the truth."""
    bench.start()
    bench.run_until_working(bench.kind.starts_within_s, "after the start")
    bench.run(30.0)
