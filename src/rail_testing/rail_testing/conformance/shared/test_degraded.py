"""Degraded inputs: none, old ones, unreadable ones, in the wrong order."""

from __future__ import annotations

import pytest

from rail_testing.conformance.bench import Bench
from rail_testing.conformance.mutations import DISORDERS, GARBAGE

REQUIREMENT = pytest.mark.requirement


@REQUIREMENT("EN 50159 7.3.1, repetition; 7.3.4, resequencing; 7.3.6, delay [M]")
@REQUIREMENT("node contract, a message of an earlier tick is none of the present")
@pytest.mark.parametrize("disorder", DISORDERS)
def test_what_is_old_or_comes_twice_changes_nothing(bench: Bench, disorder: str) -> None:
    """One answer for each tick all the same, true as ever, and the work goes on."""
    c = bench.start()
    bench.run_until_working(bench.kind.starts_within_s, "after the start")
    for name, topic in bench.ports.heard.items():
        if topic.view is not None or topic.table:
            c.intercept(name, DISORDERS[disorder](topic))
    bench.run(10.0)
    bench.run_until_working(2.0, f"while inputs are {disorder}")


@REQUIREMENT("EN 50159 7.3.5, corruption [M]")
@REQUIREMENT("DESIGN, What a claim is: withheld where it cannot be kept")
@pytest.mark.parametrize("garbage", GARBAGE)
def test_from_garbage_nothing_is_learnt(bench: Bench, garbage: str) -> None:
    """Every tick is answered, nothing is claimed that is not so; afterwards it works again."""
    c = bench.start()
    bench.run_until_working(bench.kind.starts_within_s, "after the start")
    bench.run(5.0)
    names = {
        name: topic
        for name, topic in bench.ports.heard.items()
        if topic.view is not None and (garbage != "empty" or name not in bench.ports.triggers)
    } or dict(bench.ports.heard)
    for name, topic in names.items():
        c.intercept(name, GARBAGE[garbage](topic))
    bench.run(bench.kind.notices_within_s)
    bench.run(5.0, lambda: bench.kind.believes_garbage(bench))
    for name in names:
        c.intercept(name, None)
    bench.run_until_working(bench.kind.recovers_within_s, f"after inputs were {garbage}")
    bench.run(5.0)


@REQUIREMENT("EN 50159 7.3.2, deletion [M]")
@REQUIREMENT("DESIGN, After a fault has gone, the corridor goes on")
def test_it_does_without_its_peers(bench: Bench) -> None:
    """Those that it hears are dead for a while: it answers, claims nothing false, and recovers."""
    c = bench.start()
    peers = bench.kind.peers(bench)
    if not peers:
        pytest.skip("hears nothing but its medium")
    bench.run_until_working(bench.kind.starts_within_s, "after the start")
    for peer in peers:
        c.kill(peer)
    bench.run(bench.kind.notices_within_s)
    bench.run(5.0, lambda: bench.kind.believes_garbage(bench))
    for peer in peers:
        c.restart(peer)
    bench.run_until_working(bench.kind.recovers_within_s, f"after {', '.join(peers)} came back")
    bench.run(5.0)
