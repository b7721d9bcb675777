"""Whose a sample is: kind of node, and stage."""

from __future__ import annotations

import pytest

from rail_corridor.equipment.registry import node_kinds
from rail_corridor.studies.tick_profile.attribution import Attributor, Stage, stage_of
from rail_corridor.studies.tick_profile.probe import kinds_by_module

MODULES = {
    "launcher.py": "rail_corridor.run.launcher",
    "delivery.py": "rail_msgs_py.delivery",
    "wrs.py": "rail_wayside.ranging.wrs_node",
    "receiver.py": "rail_signals.ranging.receiver",
    "intake.py": "rail_corridor.report.intake",
    "inputs.py": "rail_msgs_py.tick_inputs",
    "dispatcher.py": "numba.core.dispatcher",
}
KINDS = {"rail_wayside.ranging.wrs_node": "ranging: wrs", "rail_corridor.report": "report"}


@pytest.mark.parametrize(
    ("module", "stage"),
    [
        ("rail_msgs_py.waveform", "transport"),
        ("rail_msgs_py.ranging.range_reading", "transport"),
        ("rclpy.experimental.events_executor", "transport"),
        ("diagnostic_msgs.msg._key_value", "transport"),
        ("builtin_interfaces.msg._time", "transport"),
        ("rail_signals.localizer.localizer", "arithmetic"),
        ("numpy._core.numeric", "arithmetic"),
        ("scipy.fft._basic", "arithmetic"),
        ("rail_world.ranging.medium", "arithmetic"),
        ("rail_world.train_radio.fading_kernel", "arithmetic"),
        ("rail_world.trains.motion", "arithmetic"),
        ("rail_world.noise_kernels", "arithmetic"),
        ("rail_world.medium_node", "interpreter"),
        ("rail_corridor.run.launcher", "transport"),
        ("rail_world.ranging.medium_node", "interpreter"),
        ("rail_world.world_node", "interpreter"),
        ("rail_wayside.ranging.train_tracker", "interpreter"),
        ("rail_corridor.report.intake", "interpreter"),
        ("numba.core.dispatcher", None),
        ("functools", None),
        ("", None),
    ],
)
def test_stage_of_a_module(module: str, stage: Stage | None) -> None:
    assert stage_of(module) == stage


@pytest.mark.parametrize(
    ("files", "whose"),
    [
        ("launcher.py delivery.py wrs.py receiver.py", ("ranging: wrs", "arithmetic", 2)),
        ("launcher.py delivery.py wrs.py", ("ranging: wrs", "interpreter", 2)),
        ("launcher.py delivery.py wrs.py delivery.py", ("ranging: wrs", "transport", 2)),
        ("launcher.py delivery.py wrs.py receiver.py <string>", ("ranging: wrs", "arithmetic", 2)),
        ("launcher.py wrs.py receiver.py dispatcher.py", ("ranging: wrs", "arithmetic", 1)),
        ("launcher.py delivery.py", ("transport", "transport", -1)),
        ("launcher.py delivery.py intake.py", ("report", "interpreter", 2)),
        ("<string>", ("transport", "interpreter", -1)),
        ("launcher.py <string>", ("transport", "transport", -1)),
    ],
)
def test_whose_a_stack_is(files: str, whose: tuple[str, Stage, int]) -> None:
    assert Attributor(KINDS, MODULES).attribute(files.split()) == whose


def test_what_is_done_for_a_node_before_its_callback_is_that_node_s() -> None:
    attributor = Attributor(KINDS, MODULES)
    before = ["launcher.py", "delivery.py", "inputs.py"]
    reader = "rail_wayside.ranging.wrs_node"
    assert attributor.attribute(before, reader) == ("ranging: wrs", "transport", 1)
    assert attributor.attribute(["delivery.py", "intake.py"], reader).kind == "report"
    assert attributor.attribute(before, "rail_corridor.studies.x").kind == "transport"


def test_every_kind_of_node_has_a_row_of_its_own() -> None:
    kinds = kinds_by_module()
    labels = [kinds[kind.target.partition(":")[0]] for kind in node_kinds().values()]
    assert len({*labels}) == len(node_kinds())
    assert kinds["rail_wayside.ranging.wrs_node"] == "ranging: wrs"
    assert kinds["rail_world.world_node"] == "world"
