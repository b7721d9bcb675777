"""A running corridor, looked into with ``rail topics``, ``echo``, ``hz`` and ``plot``."""

from __future__ import annotations

import json
import re
import signal
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest
from std_msgs.msg import String

from rail_msgs_py.topics.qos import LATCHED
from rail_msgs_py.topics.tick import CLOCK

if TYPE_CHECKING:
    from .conftest import Listener, Rail

pytestmark = pytest.mark.system

ECHOES = {
    "/wayside/wrs1/zone1/tx": r"CH1 .* 1 x 960 samples at 4 MS/s, -10\.0 dBm",
    "/diagnostics": r"ok +/",
}


def test_topics_echo_and_hz_of_a_running_corridor(
    rail: Rail, listener: Listener, wait_until: Callable[..., Any]
) -> None:
    nothing = rail.start("topics")
    assert rail.finish(nothing) == 1
    assert rail.output(nothing) == "no corridor is running on this host and ROS_DOMAIN_ID\n"
    clock = listener.listen(CLOCK)
    run = rail.start("run", "plain_line", "--duration", 600, "--rate", 2, "--processes", "one")
    listener.until(lambda: len(clock) > 2)

    echoes = {topic: rail.start("echo", topic, "--once") for topic in ECHOES}
    raw = rail.start("echo", "/wayside/wrs1/zone1/range", "--once", "--raw")
    listed = rail.start("topics")
    nobody = rail.start("echo", "/nobody", "--once")
    fast = ("--where", "speed_mps > 0", "--field", "path_m,speed_mps", "--count", 2)
    table = rail.start("echo", "/world/state", *fast, "--every", 5, "--format", "csv")
    wrong = rail.start("echo", "/world/state", "--field", "nobody.speed_mps")
    piped = rail.start(
        "-c",
        f"set -o pipefail; {sys.executable} -m rail_corridor.cli.main echo /clock | head -n 1",
        command=["bash"],
    )
    # One that is no part of the corridor is found as well.
    listener.node.create_publisher(String, "/foreign", LATCHED).publish(String(data="here"))
    foreign = rail.start("echo", "/foreign", "--once", "--format", "json")
    plot = rail.start(
        *("plot", "/world/state.speed_mps", "/wayside/wrs1/zone1/range.range_m"),
        *("--seconds", 2, "--out", "plot.png"),
    )
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
    assert rail.finish(table) == 0
    header, *rows = rail.output(table).splitlines()
    assert header == "stamp_s,path_m,speed_mps"
    (first_s, *first), (second_s, *_) = [[float(cell) for cell in row.split(",")] for row in rows]
    assert second_s - first_s == pytest.approx(0.5)
    assert min(first) > 0.0
    assert rail.finish(wrong) == 2
    said = [line for line in rail.errors(wrong).splitlines() if not line.startswith("# ")]
    assert rail.output(wrong) == "" and len(said) == 1 and "train_a.speed_mps" in said[0]
    assert rail.finish(piped) == 0, rail.errors(piped)
    assert (rail.output(piped), rail.errors(piped)) == ("clock:\n", "")
    assert rail.finish(foreign) == 0
    assert json.loads(rail.output(foreign)) == {"stamp_s": None, "data": "here"}
    assert rail.finish(plot) == 0, rail.errors(plot)
    assert (rail.directory / "plot.png").read_bytes().startswith(b"\x89PNG")
    wait_until(lambda: "10.0 Hz of simulated time" in rail.output(rate))
    rate.send_signal(signal.SIGINT)
    assert rail.finish(rate) == 0
    run.send_signal(signal.SIGINT)
    assert rail.finish(run) == 128 + signal.SIGINT
