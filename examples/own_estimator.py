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
from rail_msgs_py.decoders import stamped
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.position import Position
from rail_msgs_py.ranging.range_reading import RangeReading
from rail_msgs_py.standalone import run_node
from rail_msgs_py.tick_node import TickNode
from rail_msgs_py.topics.ranging import POSITION, RANGE
from rail_msgs_py.topics.tick import DONE
from rail_wayside.zone_controller_node import ZoneControllerParameters, zone_map_of

TICK_S = 0.1  # of the scenario, once that is read


class LineFit(TickNode[ZoneControllerParameters], name="zone_controller", namespace="/wayside"):
    """Read every range; answer every tick with a position and `done`."""

    def setup(self) -> None:
        """Open a port for the range of every zone."""
        self.train, self.zones = self._p.trains[0], zone_map_of(self._p).zones.values()
        self.last = deque(maxlen=5)
        reading = stamped(RangeReading.from_cdr)
        for zone in self.zones:
            self.inputs.port(RANGE, reading, site=zone.site, zone=zone.name)
        self.position = self.publisher(POSITION, train=self.train)
        self.done = self.stream_out(DONE, node=self.get_fully_qualified_name())

    def on_tick(self, stamp_ns: int, items: dict[str, RangeReading]) -> None:
        """Fit, publish, and report that the tick is done."""
        track, values = "", (0.0, np.inf, 0.0, np.inf)  # chainage, its variance, speed, its own
        readings = {reading.zone: reading for reading in items.values() if reading.usable}
        for zone in [zone for zone in self.zones if zone.name in readings][:1]:
            reading = readings[zone.name]
            chainage_m, variance_m2 = zone.locate(reading.range_m, reading.variance_m2)
            self.last.append(chainage_m)
            if len(self.last) == 5:
                per_tick_m, now_m = np.polyfit(np.arange(-4, 1), self.last, 1)
                # 0.6: variance of the end of a line through five points.
                track, values = zone.track, (now_m, 0.6 * variance_m2, per_tick_m / TICK_S, np.inf)
        self.position.publish(Position(stamp_ns, self.train, track, *values).to_cdr())
        self.done(header_to_cdr(stamp_ns))


if __name__ == "__main__":
    discover_on("this")
    with tempfile.TemporaryDirectory() as directory:
        plan = make_plan(load_scenario((sys.argv[1:] or ["plain_line"])[0]), Path(directory))
    TICK_S = plan.tick_s
    (spec,) = (spec for spec in plan.nodes if spec.name == CONTROLLER)
    run_node(lambda: LineFit(parameters=spec.parameters))
