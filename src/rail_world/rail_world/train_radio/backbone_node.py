"""The backbone as a node: carries the telegrams of zone controller and base stations.

It is there if the scenario has threats. Topics in: ``/clock``, every base station's ``telegrams``,
the zone controller's ``telegrams`` for each. Topics out: ``~/<base>/uplink_telegrams``,
``~/<base>/downlink_telegrams``, ``~/strikes``, ``~/done``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.parameters import declare, parameter
from rail_msgs_py.stamps import clock_from_cdr
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.train_radio import (
    BACKBONE_DOWN,
    BACKBONE_UP,
    DOWN_TELEGRAMS,
    STRIKES,
    UP_TELEGRAMS,
)
from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams
from rail_world.media import read_part

from .backbone import Backbone, Carried
from .description import CbtcDescription
from .frame_threats import Threat
from .threat_description import ThreatsDescription

_CLOCK_PORT, _CARRIED_PORT = "clock", "carried up"
_CONTROLLER = "/wayside/zone_controller"
#: Of the seed; cbtc_medium has 7 of the same numbers.
_THREAT_STREAM = 8


@dataclass(frozen=True)
class BackboneParameters:
    """Parameters of the backbone."""

    world_file: str = parameter("", "JSON file with tracks, trains, media and threats")
    timeout_s: float = parameter(
        2.5, "wall time after which a base station is given up", unit="s", low=0.05, high=3600.0
    )
    controller_timeout_s: float = parameter(
        4.0, "wall time after which the controller is given up", unit="s", low=0.05, high=3600.0
    )


class BackboneNode(CorridorNode):
    """The backbone as a node."""

    def __init__(
        self,
        *,
        namespace: str = "/world",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(
            "backbone", namespace, context=context, parameters=parameters, services=services
        )
        p = declare(self, BackboneParameters)
        described, part = read_part(p.world_file, "train_radio", CbtcDescription)
        bases = tuple(base.name for base in part.base_stations)
        threats = described.part("threats", ThreatsDescription)
        bits = np.random.Philox(np.random.SeedSequence([described.seed, _THREAT_STREAM]))
        self._backbone = Backbone(bases, threats.periods, np.random.Generator(bits))
        # A tick has two legs: up when the base stations have been heard, down when the controller
        # has. The second begins after the first, and the next tick after both.
        self._up: TickInbox[Telegrams | None] = TickInbox([_CLOCK_PORT, *bases])
        self._down: TickInbox[Telegrams | None] = TickInbox([_CARRIED_PORT, *bases])
        self._between_legs = False
        stations = {base: UP_TELEGRAMS.owner(base=base) for base in bases}
        self._up_watch = TickWatch(self, self._up, stations, p.timeout_s, self._advance)
        controller = dict.fromkeys(bases, _CONTROLLER)
        self._down_watch = TickWatch(
            self, self._down, controller, p.controller_timeout_s, self._advance
        )
        self._up_out = {base: self.stream_out(BACKBONE_UP, base=base) for base in bases}
        self._down_out = {base: self.stream_out(BACKBONE_DOWN, base=base) for base in bases}
        for base in bases:
            for topic, inbox in (
                (UP_TELEGRAMS, self._up),
                (DOWN_TELEGRAMS, self._down),
            ):
                self.stream_in(
                    topic,
                    lambda raw, base=base, inbox=inbox: self._put(inbox, base, raw),
                    base=base,
                )
        self._strikes = self.publisher(STRIKES).publish
        self._strikes_table = TableWriter(("backbone",), STRIKES.columns)
        self._done = self.stream_out(DONE, node=self.get_fully_qualified_name())
        self.stream_in(CLOCK, self._on_clock)
        self.announce_when_connected()

    def _on_clock(self, raw: bytes) -> None:
        self._up.put(clock_from_cdr(raw), _CLOCK_PORT, None)
        self._up_watch.begin()
        self._down_watch.begin()
        self._advance()

    def _put(self, inbox: TickInbox[Telegrams | None], base: str, raw: bytes) -> None:
        heard = Telegrams.from_cdr(raw)
        inbox.put(heard.stamp_ns, base, heard)
        self._advance()

    def _advance(self) -> None:
        while True:
            if self._between_legs and self._down.complete:
                self._carry_down(*self._down.take())
            elif not self._between_legs and self._up.complete:
                self._carry_up(*self._up.take())
            else:
                return

    def _carry_up(self, stamp_ns: int, items: Mapping[str, Telegrams | None]) -> None:
        self._up_watch.end()
        self._between_legs = True
        carried = self._backbone.up(stamp_ns, _frames(items))
        self._down.put(stamp_ns, _CARRIED_PORT, None)
        for base, publish in self._up_out.items():
            publish(telegrams(stamp_ns, carried[base]))

    def _carry_down(self, stamp_ns: int, items: Mapping[str, Telegrams | None]) -> None:
        self._down_watch.end()
        self._between_legs = False
        carried = self._backbone.down(stamp_ns, _frames(items))
        for base, publish in self._down_out.items():
            publish(telegrams(stamp_ns, carried[base]))
        strikes = self._backbone.strikes
        figures = [self._backbone.frames, *(strikes[threat] for threat in Threat)]
        self._strikes(self._strikes_table.write(stamp_ns, np.array([figures], dtype=np.float64)))
        self._done(header_to_cdr(stamp_ns))


def _frames(items: Mapping[str, Telegrams | None]) -> Carried:
    return {port: list(heard.frames) for port, heard in items.items() if heard is not None}


def main() -> None:
    """Run the backbone on its own."""
    run_node(BackboneNode)


if __name__ == "__main__":
    main()
