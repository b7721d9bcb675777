"""Nodes started by hand from what ``rail plan --write`` writes, and asked for their parameters."""

from __future__ import annotations

import json
import re
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from rclpy.parameter_client import AsyncParameterClient

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import REPORT, make_plan
from rail_msgs_py.topics.tick import CLOCK, FAILED

if TYPE_CHECKING:
    from .conftest import Listener, Rail

pytestmark = pytest.mark.system


def test_a_corridor_started_by_hand_has_the_same_digest(rail: Rail, tmp_path: Path) -> None:
    changed = ("plain_line", "--duration", 3, "--seed", 5, "--zone-length", 390)
    written = tmp_path / "written"
    plan = rail.start("plan", *changed, "--write", written)
    assert rail.finish(plan) == 0, rail.errors(plan)
    assert re.match(r"\d+ nodes written to ", rail.output(plan))
    copied = tmp_path / "another_host"  # nothing in it names where it was
    shutil.move(written, copied)
    report = tmp_path / "by_hand.json"
    commands = copied / "commands.sh"
    run = rail.start(commands, "--report", report, command=["bash"])
    assert rail.finish(run) == 0, rail.errors(run)
    by_hand = json.loads(report.read_text())
    assert by_hand["complete"] and by_hand["nodes"] == 0 and not by_hand["failures"]
    assert by_hand["digest"] == rail.report(*changed, "--processes", "one")["digest"]


def test_a_world_that_refuses_its_parameters_ends_all_of_it(
    rail: Rail, tmp_path: Path, wait_until: Callable[[Callable[[], Any]], Any]
) -> None:
    written = tmp_path / "written"
    command = ("plan", "plain_line", "--zone-length", 390, "--write", written)
    assert rail.finish(rail.start(*command)) == 0
    again = rail.start(*command)
    assert rail.finish(again) == 2 and "not empty" in rail.errors(again)
    world = written / "parameters" / "world.yaml"
    world.write_text(world.read_text().replace("rate: 0.0", "rate: fast"))
    run = rail.start(written / "commands.sh", command=["bash"])
    assert rail.finish(run) == 2
    assert "world: rate: 'fast': must be a number" in rail.errors(run)
    wait_until(lambda: not rail.processes())


def test_a_second_node_of_a_name_ends_with_one_line(rail: Rail, listener: Listener) -> None:
    command = [sys.executable, "-m", "rail_wayside.ranging.wrs_node"]
    rules = ("--ros-args", "-r", "__node:=wrs3", "-r", "__ns:=/x/wayside")
    first = rail.start(*rules, command=command)
    full_name = "/x/wayside/wrs3"
    listener.until(lambda: full_name in listener.node.get_fully_qualified_node_names())
    second = rail.start(*rules, command=command)
    assert rail.finish(second) == 2
    told = f"{full_name}: a node of this name is running in ROS domain {rail.domain} already\n"
    assert rail.errors(second) == told
    first.kill()  # still in the graph for a while, but its name is free
    first.wait()
    third = rail.start(*rules, command=command)
    topic = f"{full_name}/zone1/tx"
    listener.until(lambda: listener.node.count_publishers(topic) > 1 or third.poll() is not None)
    assert third.poll() is None


def test_a_station_killed_in_the_one_process_comes_back_in_one_of_its_own(
    rail: Rail, listener: Listener, tmp_path: Path
) -> None:
    changed = ("plain_line", "--duration", 30)
    written, path = tmp_path / "written", tmp_path / "report.json"
    assert rail.finish(rail.start("plan", *changed, "--write", written)) == 0
    failed = listener.listen(FAILED)
    run = rail.start(
        *("run", *changed, "--processes", "one", "--rate", 2),
        *("--kill", "/wayside/wrs3@0.5", "--report", path),
    )
    listener.until(lambda: failed)
    station = rail.start(
        *("--ros-args", "-r", "__ns:=/wayside", "-r", "__node:=wrs3"),
        *("--params-file", written / "parameters" / "wayside_wrs3.yaml"),
        command=[sys.executable, "-m", "rail_wayside.ranging.wrs_node"],
    )
    assert rail.finish(run) == 0
    assert station.poll() is None
    # The train is in its zone from 20.8 to 34.5 s.
    train = json.loads(path.read_text())["trains"]["train_a"]
    assert train["handovers"]["made"] == train["handovers"]["expected"] >= 2
    assert train["phase_ranging"]["availability"] == 1.0


@pytest.mark.parametrize("scenario", ["demo", "moving_block"])
def test_every_node_lists_its_parameters_promptly(
    rail: Rail, listener: Listener, tmp_path: Path, scenario: str
) -> None:
    clock = listener.listen(CLOCK)
    run = rail.start("run", scenario, "--rate", 1, "--no-switches", "--processes", "one")
    listener.until(lambda: clock)
    node = listener.node
    names = [*(spec.name for spec in make_plan(load_scenario(scenario), tmp_path).nodes), REPORT]
    listener.until(lambda: {*names} <= {*node.get_fully_qualified_node_names()})
    begun_s = time.monotonic()
    for name in names:  # as `ros2 param list` does, which waits 5 s for each
        client = AsyncParameterClient(node, name)
        assert client.wait_for_services(5.0), name
        listed = client.list_parameters([])
        listener.until(listed.done)
        assert "use_sim_time" in listed.result().result.names
    # A node that is not served is waited for in vain, five seconds each.
    assert time.monotonic() - begun_s < 2.0 * len(names)
    client = AsyncParameterClient(node, "/wayside/wrs3")
    assert client.wait_for_services(5.0)
    got = client.get_parameters(["power_dbm"])
    listener.until(got.done)
    assert got.result().values[0].double_value == -10.0
    assert run.poll() is None
