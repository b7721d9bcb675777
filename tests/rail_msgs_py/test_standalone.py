"""A node on its own, started with arguments that ROS does not take."""

from __future__ import annotations

import sys

import pytest

from rail_msgs_py.standalone import run_node


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--params-file", "nowhere.yaml"], "nowhere.yaml"),
        (["-r", "no_rule"], "remap rule: '-r no_rule'"),
        (["--frobnicate"], "unknown ROS arguments ['--frobnicate']"),
    ],
)
def test_arguments_that_ros_does_not_take_are_one_line(
    arguments: list[str],
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["node", "--ros-args", *arguments])
    with pytest.raises(SystemExit) as ended:
        run_node(lambda: pytest.fail("a node was made"))
    assert ended.value.code == 2
    errors = capsys.readouterr().err
    assert said in errors and errors.count("\n") == 1
