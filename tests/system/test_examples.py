"""Every example does what its docstring says."""

from __future__ import annotations

import ast
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rail_msgs_py.topics.tick import DIAGNOSTICS

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory

    from .conftest import Listener, Rail

pytestmark = pytest.mark.system
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def example(name: str) -> list[str]:
    return [sys.executable, "-u", str(EXAMPLES / name)]


def test_every_example_is_short_and_says_how_to_run_it_and_what_to_see() -> None:
    for path in EXAMPLES.glob("*.py"):
        text = path.read_text()
        docstring = ast.get_docstring(ast.parse(text)) or ""
        assert "Run:" in docstring and "See:" in docstring, path.name
        assert path.name in docstring
        assert len([line for line in text.splitlines() if line]) < 60, path.name


def test_phase_ranging(rail: Rail) -> None:
    run = rail.start(command=example("phase_ranging.py"))
    assert rail.finish(run) == 0, rail.errors(run)
    rows = [line.split() for line in rail.output(run).splitlines()[1:]]
    assert len(rows) == 4
    for true, _, measured, _, sigma, _, bound, _ in rows:
        assert abs(float(measured) - float(true)) < 4.0 * float(sigma)
        assert float(sigma) == pytest.approx(float(bound), rel=0.1)


def test_echo_positions(rail: Rail) -> None:
    corridor = rail.start("run", "demo", "--rate", 5, "--processes", "one")
    run = rail.start(12, command=example("echo_positions.py"))
    assert rail.finish(run) == 0, rail.errors(run)
    lines = rail.output(run).splitlines()
    assert len(lines) >= 12
    known = [re.search(r"train_[abc] on main: +[\d.]+ m, sigma 0\.\d\d m", line) for line in lines]
    assert any(known)
    corridor.send_signal(signal.SIGINT)
    assert rail.finish(corridor) == 128 + signal.SIGINT


def test_own_estimator(corridor: CorridorFactory) -> None:
    c = corridor("plain_line", duration_s=15.0)
    c.add(command=example("own_estimator.py"), replaces="/wayside/zone_controller")
    report = c.run_to_end().report
    assert report["failures"] == []
    ranging = report["trains"]["train_a"]["phase_ranging"]
    assert ranging["misleading_ticks"] == 0
    # All but the first four readings; a line through five is better than one reading can be.
    assert ranging["availability"] == pytest.approx(1.0 - 4.0 / 150.0)
    assert ranging["rmse_m"] < ranging["bound_m"]
    assert ranging["normalised_error"] == pytest.approx(1.0, abs=0.25)


def test_switch_off_a_station(rail: Rail, listener: Listener) -> None:
    diagnostics = listener.listen(DIAGNOSTICS)
    corridor = rail.start("run", "plain_line", "--rate", 0.5, "--processes", "site")
    run = rail.start("wrs2", command=example("switch_off_a_station.py"))
    assert rail.finish(run) == 0, rail.errors(run)
    output = rail.output(run)
    assert "wrs2 is off" in output and "wrs2 is on: True" in output

    def said() -> list[str]:
        statuses = (status for message in diagnostics for status in message.status)
        return [s.message for s in statuses if s.name == "/wayside/wrs2: equipment"]

    listener.until(lambda: said()[-1:] == ["switched on"] and "switched off" in said())
    corridor.send_signal(signal.SIGINT)
    assert rail.finish(corridor) == 128 + signal.SIGINT


def test_two_hosts(rail: Rail) -> None:
    before = subprocess.run(["ip", "netns", "list"], capture_output=True, text=True).stdout
    run = rail.start("plain_line", 8, command=example("two_hosts.py"))
    assert rail.finish(run) == 0, rail.errors(run)
    after = subprocess.run(["ip", "netns", "list"], capture_output=True, text=True).stdout
    assert set(after.splitlines()) <= set(before.splitlines())
    if "no network namespaces can be made here" in rail.output(run):
        pytest.skip(f"no network namespaces for user {os.getuid()}")
    digests = re.findall(r"(?:two hosts|one host): +(\w{64})", rail.output(run))
    assert len(digests) == 2
    assert len(set(digests)) == 1
