"""However a run ends, it leaves a report if it can, and nothing else."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from rail_msgs_py import topics

if TYPE_CHECKING:
    from .conftest import Listener, Rail

pytestmark = pytest.mark.system


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_everything_and_leaves_a_report(
    rail: Rail, listener: Listener, number: signal.Signals
) -> None:
    path = rail.directory / "report.json"
    clock = listener.listen(topics.CLOCK)
    run = rail.start("run", "branch", "--rate", 5, "--processes", "site", "--report", path)
    listener.until(lambda: len(clock) > 10)
    segments = rail.segments()
    listener.close()
    run.send_signal(number)
    assert rail.finish(run) == 128 + number
    report = json.loads(path.read_text())
    assert report["complete"] is False
    assert 10 <= report["ticks"] < 750
    assert set(report["trains"]) == {"train_a", "train_b"}
    assert not rail.processes()
    assert segments
    assert not rail.left_behind(segments)
    assert "Traceback" not in rail.errors(run)


def test_nothing_outlives_a_killed_launcher(
    rail: Rail, listener: Listener, wait_until: Callable[[Callable[[], Any]], Any]
) -> None:
    clock = listener.listen(topics.CLOCK)
    run = rail.start("run", "branch", "--rate", 5, "--processes", "site")
    listener.until(lambda: len(clock) > 10)
    assert len(rail.processes()) > 5
    segments = rail.segments()
    listener.close()
    run.kill()
    run.wait()
    wait_until(lambda: not rail.processes())
    # Shared memory that was in use up to the last moment goes with the next run at the latest.
    rail.report("plain_line", "--duration", 1, "--processes", "one")
    assert segments
    assert not rail.left_behind(segments)


def test_a_signal_while_it_connects_ends_it_too(rail: Rail, listener: Listener) -> None:
    run = rail.start("run", "demo", "--rate", 1, "--processes", "site")
    listener.until(lambda: len(rail.processes()) > 3)
    run.send_signal(signal.SIGTERM)
    assert rail.finish(run) == 128 + signal.SIGTERM
    assert not rail.processes()
