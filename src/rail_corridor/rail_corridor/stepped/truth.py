"""Where trains are and how they move, as the world has it: for judging, not for equipment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rail_msgs_py.topics.world import STATE


@dataclass(frozen=True)
class Truth:
    """One train at one instant.

    Parameters
    ----------
    track : str
        On which its front is.
    front_m : float
        Chainage of its front on that track [m].
    path_m : float
        Place of its front along its route [m].
    x_m, y_m, z_m, heading_rad : float
        Of its front, in the map.
    speed_mps, acceleration_mps2 : float
    on_line : bool
        Whether it has departed and not yet arrived.
    """

    track: str
    front_m: float
    path_m: float
    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    speed_mps: float
    acceleration_mps2: float
    on_line: bool


def truth_of(traffic: Any, tracks: Sequence[str]) -> Mapping[str, Truth]:
    """Truth of every train by name; ``tracks`` are those of the world in their order."""
    found = {}
    for name, row in zip(traffic.names, traffic.state().tolist(), strict=True):
        value = dict(zip(STATE.columns, row, strict=True))
        found[name] = Truth(
            track=tracks[int(value["track_index"])],
            front_m=value["chainage_m"],
            path_m=value["path_m"],
            x_m=value["x_m"],
            y_m=value["y_m"],
            z_m=value["z_m"],
            heading_rad=value["heading_rad"],
            speed_mps=value["speed_mps"],
            acceleration_mps2=value["acceleration_mps2"],
            on_line=value["on_line"] > 0.0,
        )
    return found
