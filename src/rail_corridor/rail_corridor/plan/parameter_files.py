"""``rail plan --write``: a plan as files, from which every node can be started by hand.

In the folder are the scenario, the world file, a ROS parameter file for each node, the settings of
the middleware, and the command line of every node. Everything in it is named relative to the
folder, so that it can be copied to any host: nodes are started from within it.
"""

from __future__ import annotations

import shlex
import sys
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, Final

import yaml

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.registry import node_kinds
from rail_corridor.errors import InputError
from rail_corridor.loading.scenario_files import SCENARIO, files_of
from rail_corridor.scenario.model import Scenario

from .plan import REPORT, WORLD, Plan, make_plan

COMMANDS: Final = "commands.sh"
_PARAMETERS: Final = "parameters"
_PROFILE: Final = "fastdds.xml"

_HEAD: Final = """\
#!/usr/bin/env bash
# {scenario}, {count} nodes and the report; all of it: bash {commands} [--report FILE.json]
# On several hosts: copy the folder, go into it, and run some of the lines on each.
cd "$(dirname "$0")" || exit 1
PYTHON="${{PYTHON:-{python}}}"
# One thread for linear algebra: the bits of a sum must not depend on how many there are.
export OPENBLAS_NUM_THREADS=1
export FASTRTPS_DEFAULT_PROFILES_FILE="${{FASTRTPS_DEFAULT_PROFILES_FILE:-$PWD/{profile}}}"
trap 'kill $(jobs -p) 2>/dev/null' EXIT

"""

_README: Final = """\
{scenario}: a corridor as files, made by `rail plan --write`.

{scenario_file}      the scenario, complete; `rail run {scenario_file}` runs all of it
world.json         tracks, trains and media, read by the world and its media
parameters/        a ROS parameter file for each node
{profile}        settings of the middleware, for bursts of waveforms
{commands}        the command line of every node, and of the report

`bash {commands}` starts every node in a process of its own on this host, then the report, and
ends the nodes with it. Or start any of them by hand, from within this folder, on any host that has
a copy of it: the world file is named relative to it. With ament packages, for example:

    {ros2_run}

The world waits for all nodes and the report, at most for `start_timeout_s` of its parameters. The
report is `rail run {scenario_file} --only report`; it ends with the run, nodes that you started do
not. Parameters may be changed: `rate: 1.0` of the world paces the run. Without `--only`,
`rail run {scenario_file} --external NODE` runs everything but the nodes that are started by hand.
"""


def module_of(spec: NodeSpec) -> str:
    """Module that starts a node by ``python -m``."""
    return node_kinds()[spec.kind].target.partition(":")[0]


def arguments_of(spec: NodeSpec) -> str:
    """Arguments of a node on its own: its name, and its parameter file."""
    namespace, _, name = spec.name.rpartition("/")
    rules = f"-r __ns:={namespace or '/'} -r __node:={name}"
    return f"--ros-args {rules} --params-file {_PARAMETERS}/{_file_name(spec)}"


def write_plan(scenario: Scenario, directory: Path) -> Plan:
    """Plan a run whose nodes are started by hand; the folder is made if it is not there.

    Raises
    ------
    OSError
        If a file cannot be written.
    InputError
        If a file of a track cannot be read any longer, or the folder holds something already that
        may have been changed by hand.
    """
    files = files_of(scenario)
    if directory.is_dir() and any(directory.iterdir()):
        reason = "the folder is not empty; what is in it may have been changed by hand"
        raise InputError(reason, field="--write", value=str(directory))
    (directory / _PARAMETERS).mkdir(parents=True, exist_ok=True)
    for file in files:
        path = directory / file.name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(file.data)
    plan = make_plan(scenario, directory, observers=(REPORT,))
    specs = [_relative(spec, directory) for spec in plan.nodes]
    for spec in specs:
        (directory / _PARAMETERS / _file_name(spec)).write_text(parameter_file(spec))
    profile = resources.files("rail_corridor.middleware") / _PROFILE
    (directory / _PROFILE).write_text(profile.read_text())
    (directory / COMMANDS).write_text(_commands(plan.scenario, specs))
    first = next(spec for spec in specs if spec.side != "world")
    package, kind = module_of(first).partition(".")[0], first.kind
    readme = _README.format(
        scenario=plan.scenario,
        scenario_file=SCENARIO,
        profile=_PROFILE,
        commands=COMMANDS,
        ros2_run=f"ros2 run {package} {kind} {arguments_of(first)}",
    )
    (directory / "README.txt").write_text(readme)
    return replace(plan, nodes=tuple(specs))


def parameter_file(spec: NodeSpec) -> str:
    """ROS parameter file of a node: what the plan sets; an empty array has no type there."""
    values = {name: _plain(value) for name, value in spec.parameters.items()}
    set_here = {name: value for name, value in values.items() if value != []}
    content = {spec.name: {"ros__parameters": set_here}}
    text: str = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=100)
    return text


def _plain(value: Any) -> Any:
    """Value without types of NumPy and tuples."""
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value.item() if hasattr(value, "item") else value


def _file_name(spec: NodeSpec) -> str:
    return f"{spec.name.strip('/').replace('/', '_')}.yaml"


def _relative(spec: NodeSpec, directory: Path) -> NodeSpec:
    """The node with the world file named relative to the folder."""
    path = spec.parameters.get("world_file")
    if path is None:
        return spec
    inside = str(Path(path).relative_to(directory))
    return replace(spec, parameters={**spec.parameters, "world_file": inside})


def _commands(scenario: str, specs: list[NodeSpec]) -> str:
    head = _HEAD.format(
        scenario=scenario,
        count=len(specs),
        commands=COMMANDS,
        python=shlex.quote(sys.executable),
        profile=_PROFILE,
    )
    nodes = []
    for spec in specs:
        nodes.append(f'"$PYTHON" -m {module_of(spec)} {arguments_of(spec)} &')
        if spec.name == WORLD:
            nodes.append("WORLD=$!")
    report = f'"$PYTHON" -m rail_corridor.cli.main run {SCENARIO} --only report "$@" &'
    # With the report; at once if the world, without which nothing begins, refuses its parameters.
    end = ("REPORT=$!", 'wait -n "$WORLD" "$REPORT" || exit', 'wait "$REPORT"')
    return head + "\n".join([*nodes, "", report, *end, ""])
