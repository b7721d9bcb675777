"""Parameters of the world as a node."""

from __future__ import annotations

from dataclasses import dataclass

from rail_msgs_py.parameters import parameter
from rail_msgs_py.quantities import CAB_SIGNALS, END_WHEN_ARRIVED, GIVE_UP, PATIENCE


@dataclass(frozen=True)
class WorldParameters:
    """Parameters of the world."""

    world_file: str = parameter("", "JSON file with tracks, trains and media")
    ticks: int = parameter(0, "length of the run; 0 = until stopped", unit="ticks", low=0)
    rate: float = parameter(
        0.0, "simulated seconds per second; 0 = as fast as possible", low=0.0, high=1e6
    )
    nodes: tuple[str, ...] = parameter((), "full names of the nodes that must be ready first")
    sinks: tuple[str, ...] = parameter((), "full names of the nodes whose `done` ends a tick")
    clock_readers: int = parameter(0, "readers of the clock that must be connected first", low=0)
    end_when_arrived: bool = END_WHEN_ARRIVED.parameter()
    supervised: tuple[str, ...] = parameter((), "trains that wait for a command in every tick")
    odometers: tuple[str, ...] = parameter((), "trains whose wheels are listened to")
    supervision: str = parameter(
        "code_supervision", "name of the node on each of them that commands it"
    )
    cab_signals: bool = CAB_SIGNALS.parameter()
    patience_s: float = PATIENCE.parameter()
    queue_m: float = parameter(
        200.0,
        "within that way behind a train that has a reason to stand another stands for it",
        unit="m",
        low=0.0,
        high=1e5,
    )
    observed: bool = parameter(False, "whether to stay within reach of the report")
    timeout_s: float = GIVE_UP.but(default=5.0).parameter()
    start_timeout_s: float = parameter(
        60.0, "wall time without a sign of a node at the start", unit="s", low=0.1, high=7200.0
    )
