"""A detection point: finds the axles in what its wheel sensor shows.

Topics in: ``coils``. Topics out: ``passages``.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from axle_counter import quantities
from axle_counter.signals.axle_detector import AxleDetector, Passages
from axle_counter.signals.wheel_sensor import WheelSensor
from axle_counter.topics import COILS, PASSAGES
from rail_msgs_py.decoders import samples
from rail_msgs_py.tick_node import EquipmentNode

_OFF = Passages(0, 0, 0, busy=False, valid=False)


@dataclass(frozen=True)
class DetectionPointParameters:
    """Parameters of a detection point."""

    coil_spacing_m: float = quantities.COIL_SPACING.parameter()
    pulse_m: float = quantities.PULSE.parameter()
    rest_v: float = quantities.REST.parameter()
    depth_v: float = quantities.DEPTH.parameter()
    threshold: float = quantities.THRESHOLD.parameter()
    release: float = quantities.RELEASE.parameter()


class DetectionPointNode(
    EquipmentNode[DetectionPointParameters], name="wheel_sensor", namespace="/wayside/dp1"
):
    """A detection point as a managed node."""

    def setup(self) -> None:
        """Open the ports of the point."""
        given = {field.name: getattr(self._p, field.name) for field in fields(WheelSensor)}
        self._sensor = WheelSensor(**given)
        self._coils = self.inputs.port(COILS, samples, point=self.place)
        self._publish = self.table_out(PASSAGES, (self.place,), awaited=True, point=self.place)

    def start_over(self) -> None:
        """Know nothing of any wheel."""
        self._detector = AxleDetector(self._sensor)

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Tell which axles have passed in the tick."""
        coils = items[self._coils]
        seen = _OFF
        if self.switched_on and coils is not None and len(coils) == 2:
            seen = self._detector.feed(coils.real)
        values = (seen.forward, seen.backward, seen.unclear, seen.busy, seen.valid)
        self._publish(stamp_ns, np.array([values], dtype=np.float64))
        self.report(
            DiagnosticStatus.OK if seen.valid else DiagnosticStatus.WARN,
            "coils",
            "work" if seen.valid else "do not work",
            stamp_ns=stamp_ns,
        )


if __name__ == "__main__":
    DetectionPointNode.main()
