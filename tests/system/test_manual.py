"""The test of the manual passes as it is printed, and the node of the contract works."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory

    from .conftest import Rail

DOCS = Path(__file__).resolve().parents[2] / "docs"


def printed(document: str, *, holds: str) -> str:
    """Return the block of Python in a document that holds a text."""
    text = (DOCS / document).read_text(encoding="utf-8")
    (block,) = (each for each in re.findall(r"```python\n(.*?)```", text, re.S) if holds in each)
    return str(block)


def test_the_first_test_of_the_manual(corridor: CorridorFactory) -> None:
    names: dict[str, Any] = {}
    exec(printed("testing.md", holds="def test_"), names)
    (test,) = (value for name, value in names.items() if name.startswith("test_"))
    test(corridor)


def test_the_loop_of_the_manual(capsys: pytest.CaptureFixture[str]) -> None:
    block = printed("testing.md", holds="simulate(").replace(
        'simulate("demo", seed=4)', 'simulate("demo", seed=4, duration_s=5.0)'
    )
    exec(block, {})
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [float(time_s) for time_s, _ in lines] == [0.25 * tick for tick in range(20)]
    assert all(abs(float(error_m)) < 2.0 for _, error_m in lines[4:])


@pytest.mark.system
def test_a_monitor_that_is_attached_hears_every_tick_at_full_speed(rail: Rail) -> None:
    code = printed("node_contract.md", holds="rclpy.init()")
    for old, new in (
        ("/wayside/zone_controller/done", "/my/monitor/done"),
        ('data="/wayside/zone_controller"', 'data="/my/monitor"'),
        ("/wayside/zone_controller/train_a/position", "/my/monitor/heard"),
        ("    position.publish(answer)\n", "    print(message.clock.sec, flush=True)\n"),
        ("position.get_subscription_count() and ", ""),
    ):
        assert old in code
        code = code.replace(old, new)
    monitor = rail.start("-c", code, command=[sys.executable])
    path = rail.directory / "report.json"
    run = rail.start(
        *("run", "plain_line", "--duration", 20, "--processes", "one", "--report", path),
        *("--attach", "/my/monitor"),
    )
    assert rail.finish(run) == 0, rail.errors(run)
    report = json.loads(path.read_text())
    assert report["failures"] == [] and report["ticks"] == 200
    monitor.terminate()
    monitor.wait()
    assert len(rail.output(monitor).split()) == 200


@pytest.mark.system
def test_the_node_of_the_contract(corridor: CorridorFactory) -> None:
    c = corridor("plain_line", duration_s=3.0)
    code = printed("node_contract.md", holds="rclpy.init()")
    c.add(command=[sys.executable, "-c", code], replaces="/wayside/zone_controller")
    outcome = c.run_to_end()
    assert outcome.report["failures"] == [] and outcome.report["missing_ticks"] == 0
    positions = c.topic("/wayside/zone_controller/train_a/position").all
    assert len(positions) == 30 and not any(position.known for position in positions)
