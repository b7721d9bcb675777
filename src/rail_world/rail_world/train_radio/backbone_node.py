"""The backbone as a node: carries the telegrams of zone controller and base stations.

It is there if the scenario has threats. Topics in: ``/clock``, every base station's ``telegrams``,
the zone controller's ``telegrams`` for each. Topics out: ``~/<base>/uplink_telegrams``,
``~/<base>/downlink_telegrams``, ``~/strikes``, ``~/done``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rail_msgs_py.decoders import stamped
from rail_msgs_py.delivery import Send
from rail_msgs_py.parameters import parameter
from rail_msgs_py.quantities import GIVE_UP
from rail_msgs_py.tick_inputs import TickInputs
from rail_msgs_py.topics.train_radio import (
    BACKBONE_DOWN,
    BACKBONE_UP,
    DOWN_TELEGRAMS,
    STRIKES,
    UP_TELEGRAMS,
)
from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams
from rail_world.medium_node import MediumNode, MediumParameters

from .backbone import Backbone, Carried
from .description import CbtcDescription
from .frame_threats import Threat
from .threat_description import ThreatsDescription

#: Of the seed; cbtc_medium has 7 of the same numbers.
_THREAT_STREAM = 8


@dataclass(frozen=True)
class BackboneParameters(MediumParameters):
    """Parameters of the backbone."""

    world_file: str = parameter("", "JSON file with tracks, trains, media and threats")
    timeout_s: float = GIVE_UP.but(default=2.5).parameter()
    controller_timeout_s: float = GIVE_UP.but(default=4.0).parameter()


class BackboneNode(MediumNode[BackboneParameters], name="backbone", namespace="/world"):
    """The backbone as a node.

    A tick has two legs: up when the base stations have been heard, down when the controller has.
    """

    def setup(self) -> None:
        """Open the ports of all base stations, for both legs."""
        radio = self.part("train_radio", CbtcDescription)
        bases = tuple(base.name for base in radio.base_stations)
        bits = np.random.Philox(np.random.SeedSequence([self._world.seed, _THREAT_STREAM]))
        self._backbone = Backbone(
            bases, self.part("threats", ThreatsDescription).periods, np.random.Generator(bits)
        )
        read = stamped(Telegrams.from_cdr)
        up = self.leg(self._carry_up, self._p.timeout_s, then=self.inputs)
        up.clock()
        self._up_ports = {base: up.port(UP_TELEGRAMS, read, base=base) for base in bases}
        self._down_ports = {
            base: self.inputs.port(DOWN_TELEGRAMS, read, base=base) for base in bases
        }
        self._up_out = {base: self.stream_out(BACKBONE_UP, base=base) for base in bases}
        self._down_out = {base: self.stream_out(BACKBONE_DOWN, base=base) for base in bases}
        self._strikes = self.table_out(STRIKES, ("backbone",))

    @cached_property
    def inputs(self) -> TickInputs:
        """What the second leg waits for; the controller has its time from the clock on."""
        timeout_s = self._p.controller_timeout_s
        return self.leg(self._on_tick, timeout_s, timed_from="tick")

    def start_over(self) -> None:
        """Know no way to any train, and have nothing under way."""
        self._backbone.start_over()

    def _carry_up(self, stamp_ns: int, items: Mapping[str, Any]) -> None:
        """Bring the controller what the base stations have received."""
        carried = self._carried(self._backbone.up, stamp_ns, _frames(self._up_ports, items))
        _publish(self._up_out, stamp_ns, carried)

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Bring the base stations what the controller sends; the second leg."""
        carried = self._carried(self._backbone.down, stamp_ns, _frames(self._down_ports, items))
        _publish(self._down_out, stamp_ns, carried)
        strikes = self._backbone.strikes
        values = [self._backbone.frames, *(strikes[threat] for threat in Threat)]
        self._strikes(stamp_ns, np.array([values], dtype=np.float64))

    def _carried(
        self, carry: Callable[[int, Carried], Carried], stamp_ns: int, frames: Carried
    ) -> Carried:
        """What comes out; switched off nothing does, whoever sends."""
        return carry(stamp_ns, frames) if self.switched_on else {base: [] for base in self._up_out}


def _frames(ports: Mapping[str, str], items: Mapping[str, Telegrams]) -> Carried:
    """Frames by base station."""
    return {base: list(items[port].frames) for base, port in ports.items() if port in items}


def _publish(out: Mapping[str, Send], stamp_ns: int, carried: Carried) -> None:
    for base, publish in out.items():
        publish(telegrams(stamp_ns, carried[base]))


if __name__ == "__main__":
    BackboneNode.main()
