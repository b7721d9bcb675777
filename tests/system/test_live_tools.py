"""A running corridor, looked into with ``rail topics``, ``rail echo`` and ``rail hz``."""

from __future__ import annotations

import re
import signal
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from rail_msgs_py.topics.tick import CLOCK

if TYPE_CHECKING:
    from .conftest import Listener, Rail

pytestmark = pytest.mark.system

ECHOES = {
    "/wayside/wrs1/zone1/tx": r"CH1 .* 1 x 960 samples at 4 MS/s, -10\.0 dBm",
    "/wayside/zone_controller/train_a/position": r"train_a on main: \d+\.\d+ m ± .* km/h",
    "/diagnostics": r"ok +/",
}


def test_topics_echo_and_hz_of_a_running_corridor(
    rail: Rail, listener: Listener, wait_until: Callable[..., Any]
) -> None:
    clock = listener.listen(CLOCK)
    run = rail.start("run", "plain_line", "--duration", 600, "--rate", 2, "--processes", "one")
    listener.until(lambda: len(clock) > 2)

    echoes = {topic: rail.start("echo", topic, "--once") for topic in ECHOES}
    raw = rail.start("echo", "/wayside/wrs1/zone1/range", "--once", "--raw")
    listed = rail.start("topics")
    nobody = rail.start("echo", "/nobody", "--once")
    rate = rail.start("hz", "/clock")
    for topic, pattern in ECHOES.items():
        assert rail.finish(echoes[topic]) == 0, rail.errors(echoes[topic])
        assert re.search(pattern, rail.output(echoes[topic])), rail.output(echoes[topic])
    assert rail.finish(raw) == 0
    assert re.search(r"radiation_type: 1\n.*\nmin_range: ", rail.output(raw))
    assert rail.finish(listed) == 0
    assert "/wayside/wrs1/zone1/tx" in rail.output(listed)
    assert rail.finish(nobody) == 1
    assert rail.output(nobody) == ""
    assert rail.errors(nobody).count("\n") == 1
    assert "/nobody: nobody publishes it" in rail.errors(nobody)
    wait_until(lambda: "10.0 Hz of simulated time" in rail.output(rate))
    rate.send_signal(signal.SIGINT)
    assert rail.finish(rate) == 0
    run.send_signal(signal.SIGINT)
    assert rail.finish(run) == 128 + signal.SIGINT
