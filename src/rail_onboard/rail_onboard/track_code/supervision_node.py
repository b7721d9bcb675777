"""Speed supervision of a train: obeys the code in the rails, brakes where the driver does not.

Topics in: ``track_code/message``, ``odometer``, with a localizer its ``state``. Topics out:
``command``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import table_row
from rail_msgs_py.parameters import parameter
from rail_msgs_py.quantities import ALLOWED_ODOMETER_ERROR, DIRECTION, GIVE_UP
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.track_code import CODE_RECEIVED
from rail_msgs_py.topics.world import COMMAND, ODOMETER
from rail_msgs_py.track_code import quantities
from rail_onboard.localizer.protected_interval import protected_interval
from rail_signals.track_code.scales import CodeScales

from .supervision import CodeSupervision
from .wheel_check import WheelCheck

_FIELDS = ("speed", "gradient", "block_length", "network")


@dataclass(frozen=True)
class CodeSupervisionParameters:
    """Parameters of the supervision on board."""

    braking_mps2: float = quantities.BRAKING.parameter()
    odometer_error: float = ALLOWED_ODOMETER_ERROR.parameter()
    most_braking_mps2: float = parameter(
        2.5, "the most that the train can slow down", unit="m/s^2", low=0.1, high=20.0
    )
    most_traction_mps2: float = parameter(
        1.5, "the most that the train can gather, downhill", unit="m/s^2", low=0.1, high=20.0
    )
    speeds_kmh: tuple[float, ...] = quantities.SPEEDS.parameter()
    localizer: bool = parameter(
        False, "whether a localizer tells place and speed; where it knows none, the odometer does"
    )
    direction: int = DIRECTION.parameter()
    timeout_s: float = GIVE_UP.parameter()


class CodeSupervisionNode(
    EquipmentNode[CodeSupervisionParameters], name="code_supervision", namespace="/train_1"
):
    """Speed supervision as a managed node; switched off it demands the emergency brake."""

    def setup(self) -> None:
        """Open the ports of the train."""
        train = self.place
        self._command = self.table_out(
            COMMAND, (train,), awaited=True, train=train, supervision=self.get_name()
        )
        self._code = self.inputs.port(CODE_RECEIVED, table_row(CODE_RECEIVED), train=train)
        self._localizer = (
            self.inputs.port(LOCALIZER_STATE, table_row(LOCALIZER_STATE), train=train)
            if self._p.localizer
            else ""
        )
        self._odometer = self.inputs.trigger(ODOMETER, table_row(ODOMETER), train=train)

    def start_over(self) -> None:
        """Have received no code."""
        self._supervision = CodeSupervision(
            guaranteed_service_mps2=self._p.braking_mps2,
            odometer_error=self._p.odometer_error,
            scales=CodeScales(speeds_kmh=self._p.speeds_kmh),
            wheels=WheelCheck(
                most_braking_mps2=self._p.most_braking_mps2,
                most_traction_mps2=self._p.most_traction_mps2,
            ),
        )

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Judge the speed by the code, and command the brakes."""
        code = items.get(self._code)
        carrier_hz, fields = None, None
        if code is not None and code[CODE_RECEIVED.index["carrier_hz"]] > 0.0:
            carrier_hz = code[CODE_RECEIVED.index["carrier_hz"]]
            if code[CODE_RECEIVED.index["valid"]] > 0.0:
                fields = {name: round(code[CODE_RECEIVED.index[name]]) for name in _FIELDS}
        distance_m, speed_mps = items[self._odometer]
        travelled_m, fastest_mps, doubt_mps, more_mps = None, None, 0.0, 0.0
        known = protected_interval(items.get(self._localizer))
        if known is not None:
            travelled_m = known.travelled(self._p.direction)
            speed_mps, fastest_mps = known.speeds(speed_mps)
            doubt_mps = fastest_mps - speed_mps
            more_mps = max(0.0, known.most_mps - fastest_mps)
        output = self._supervision.update(
            stamp_ns * 1e-9,
            distance_m,
            speed_mps,
            fields=fields,
            carrier_hz=carrier_hz,
            located_m=travelled_m,
            fastest_mps=fastest_mps,
            doubt_mps=more_mps,
        )
        emergency = output.emergency_brake or not self.switched_on
        values = [
            # The driver keeps to it by his own speed, supervision judges the fastest it may be.
            max(0.0, output.permitted_mps - doubt_mps),
            float(output.warning),
            float(output.service_brake),
            float(emergency),
            float(output.traction_cut_off),
            float(output.on_sight),
        ]
        self._command(stamp_ns, np.array([values]))
        intervenes = emergency or output.service_brake
        self.report(
            DiagnosticStatus.WARN if intervenes else DiagnosticStatus.OK,
            "supervision",
            output.reason or "speed is within the code",
            stamp_ns=stamp_ns,
        )


if __name__ == "__main__":
    CodeSupervisionNode.main()
