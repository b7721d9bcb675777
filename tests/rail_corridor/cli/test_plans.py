"""What ``rail plan`` shows and writes."""

from __future__ import annotations

from pathlib import Path

import rclpy
import yaml
from rclpy.signals import SignalHandlerOptions
from rich.console import Console

from rail_corridor.cli.plans import show_plan
from rail_corridor.equipment.registry import node_kinds
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.parameter_files import arguments_of, write_plan
from rail_corridor.plan.plan import make_plan


def test_the_table_has_a_line_for_every_node(tmp_path: Path) -> None:
    console = Console(record=True, width=20)
    assert show_plan(load_scenario("demo"), None, console) == 0
    head, *lines = console.export_text().splitlines()
    assert head.split() == ["kind", "module", "namespace", "name", "process"]
    assert len(lines) == len(make_plan(load_scenario("demo"), tmp_path).nodes)
    vrs = next(line.split() for line in lines if line.startswith("vrs"))
    assert vrs[1:4] == ["rail_onboard.ranging.vrs_node", "/train_a", "vrs"]


def test_parameter_files_hold_what_the_plan_sets(tmp_path: Path) -> None:
    plan = write_plan(load_scenario("plain_line"), tmp_path)
    commands = (tmp_path / "commands.sh").read_text()
    assert str(tmp_path) not in commands
    for spec in plan.nodes:
        assert arguments_of(spec) in commands
        path = tmp_path / arguments_of(spec).split()[-1]
        values = yaml.safe_load(path.read_text())[spec.name]["ros__parameters"]
        assert str(tmp_path) not in path.read_text()
        expected = {k: v for k, v in spec.parameters.items() if v not in ((), [])}
        assert {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()} == expected


def test_a_node_reads_from_its_file_what_it_is_given_in_a_run(
    tmp_path: Path, ros_domain: int
) -> None:
    """Every kind of a corridor with all sensors, to the last bit."""
    scenario = load_scenario("sensors")
    plan = write_plan(scenario, tmp_path)
    for spec in {spec.kind: spec for spec in plan.nodes if spec.side != "world"}.values():
        arguments = arguments_of(spec).split()
        arguments[-1] = str(tmp_path / arguments[-1])
        context = rclpy.Context()
        options = SignalHandlerOptions.NO
        rclpy.init(
            args=arguments, context=context, domain_id=ros_domain, signal_handler_options=options
        )
        node = node_kinds()[spec.kind].load()(context=context, services=False)
        try:
            assert node.get_fully_qualified_name() == spec.name
            for name, value in spec.parameters.items():
                assert getattr(node._p, name) == value, name
        finally:
            node.destroy_node()
            rclpy.try_shutdown(context=context)
