"""Replace the zone controller by your own node: a straight line through the last five readings.

Run:  rail run plain_line --external /wayside/zone_controller     (in another terminal)
      python examples/own_estimator.py [SCENARIO]
See:  the report of the other terminal, whose figures of the first train are those of this node.
"""

import sys
import tempfile
from collections import deque
from pathlib import Path

import numpy as np

from rail_corridor.equipment.ranging.nodes import CONTROLLER
from rail_corridor.loading.loader import load_scenario
from rail_corridor.middleware.discovery import discover_on
from rail_corridor.plan.plan import make_plan
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.parameters import declare
from rail_msgs_py.position import Position
from rail_msgs_py.ranging.range_reading import RangeReading
from rail_msgs_py.standalone import run_node
from rail_msgs_py.topics.ranging import POSITION, RANGE
from rail_msgs_py.topics.tick import DONE
from rail_wayside.zone_controller_node import ZoneControllerParameters, zone_map_of


class LineFit(CorridorNode):
    """Read every range; answer every tick with a position and `done`."""

    def __init__(self, parameters: dict[str, object]) -> None:
        super().__init__("zone_controller", "/wayside", parameters=parameters)
        described = declare(self, ZoneControllerParameters)
        self.train, self.zones = described.trains[0], zone_map_of(described).zones
        self.inbox, self.last = TickInbox(self.zones), deque(maxlen=5)
        for zone in self.zones.values():
            self.stream_in(RANGE, self.on_range, site=zone.site, zone=zone.name)
        self.position = self.publisher(POSITION, train=self.train)
        self.done = self.stream_out(DONE, node=self.get_fully_qualified_name())
        self.announce_when_connected()

    def on_range(self, raw: bytes) -> None:
        """Wait for the readings of every zone."""
        reading = RangeReading.from_cdr(raw)
        self.inbox.put(reading.stamp_ns, reading.zone, reading)
        while self.inbox.complete:
            self.estimate(*self.inbox.take())

    def estimate(self, stamp_ns: int, readings: dict[str, RangeReading]) -> None:
        """Fit, publish, and say that the tick is done."""
        track, figures = "", (0.0, np.inf, 0.0, np.inf)  # chainage, its variance, speed, its own
        usable = [(self.zones[name], r) for name, r in readings.items() if r.usable]
        for zone, reading in usable[:1]:
            chainage_m, variance_m2 = zone.locate(reading.range_m, reading.variance_m2)
            self.last.append(chainage_m)
            if len(self.last) == 5:
                per_tick_m, now_m = np.polyfit(np.arange(-4, 1), self.last, 1)
                # 0.6: variance of the end of a line through five points.
                track, figures = zone.track, (now_m, 0.6 * variance_m2, per_tick_m / 0.1, np.inf)
        self.position.publish(Position(stamp_ns, self.train, track, *figures).to_cdr())
        self.done(header_to_cdr(stamp_ns))


if __name__ == "__main__":
    discover_on("this")
    with tempfile.TemporaryDirectory() as directory:
        plan = make_plan(load_scenario((sys.argv[1:] or ["plain_line"])[0]), Path(directory))
    (spec,) = (spec for spec in plan.nodes if spec.name == CONTROLLER)
    run_node(lambda: LineFit(spec.parameters))
