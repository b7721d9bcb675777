"""Speed supervision of a train: obeys the code in the rails, brakes where the driver does not.

Topics in: ``track_code/message``, ``odometer``, with a localizer its ``state``. Topics out:
``command``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import Equipment
from rail_msgs_py.parameters import declare, parameter
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter, figures_from_cdr
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.track_code import CODE_RECEIVED
from rail_msgs_py.topics.world import COMMAND, ODOMETER
from rail_onboard.localizer.located import located

from .supervision import CodeSupervision

_CODE, _ODOMETER, _LOCALIZER = "code", "odometer", "localizer"
_FIELDS = ("speed", "gradient", "block_length", "network")


@dataclass(frozen=True)
class CodeSupervisionParameters:
    """Parameters of the supervision on board."""

    braking_mps2: float = parameter(
        0.5, "service braking that may be counted on", unit="m/s^2", low=0.05, high=5.0
    )
    odometer_error: float = parameter(
        0.02, "relative error of distances that must be allowed for", low=0.0, high=0.5
    )
    localizer: bool = parameter(
        False, "whether a localizer tells place and speed; where it knows none, the odometer does"
    )
    direction: int = parameter(1, "1 or -1: towards greater or smaller chainages", low=-1, high=1)
    timeout_s: float = parameter(
        2.0, "wall time after which the receiver is given up", unit="s", low=0.05, high=3600.0
    )


class CodeSupervisionNode(Equipment):
    """Speed supervision as a managed node; switched off it demands the emergency brake."""

    def __init__(
        self,
        name: str = "code_supervision",
        *,
        namespace: str = "/train_1",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(name, namespace, context=context, parameters=parameters, services=services)
        self._p = declare(self, CodeSupervisionParameters)
        self._supervision = CodeSupervision(
            braking_mps2=self._p.braking_mps2, odometer_error=self._p.odometer_error
        )
        train = namespace.strip("/")
        self._publish = self.stream_out(COMMAND, train=train, supervision=self.get_name())
        self._table = TableWriter((train,), COMMAND.columns)
        owners = {_CODE: CODE_RECEIVED.owner(train=train)}
        if self._p.localizer:
            owners[_LOCALIZER] = LOCALIZER_STATE.owner(train=train)
            self.stream_in(LOCALIZER_STATE, self._on_located, train=train)
        self._inbox: TickInbox[Any] = TickInbox([_ODOMETER, *owners])
        self._watch = TickWatch(self, self._inbox, owners, self._p.timeout_s, self._advance)
        self.stream_in(CODE_RECEIVED, self._on_code, train=train)
        self.stream_in(ODOMETER, self._on_odometer, train=train)
        self.announce_when_connected()

    def _on_code(self, raw: bytes) -> None:
        stamp_ns, figures = figures_from_cdr(raw, 1, len(CODE_RECEIVED.columns))
        self._inbox.put(stamp_ns, _CODE, figures[0].tolist())
        self._advance()

    def _on_odometer(self, raw: bytes) -> None:
        stamp_ns, figures = figures_from_cdr(raw, 1, len(ODOMETER.columns))
        self._inbox.put(stamp_ns, _ODOMETER, figures[0].tolist())
        self._watch.begin()
        self._advance()

    def _on_located(self, raw: bytes) -> None:
        stamp_ns, figures = figures_from_cdr(raw, 1, len(LOCALIZER_STATE.columns))
        self._inbox.put(stamp_ns, _LOCALIZER, figures[0].tolist())
        self._advance()

    def _advance(self) -> None:
        while self._inbox.complete:
            self._watch.end()
            self._supervise(*self._inbox.take())

    def _supervise(self, stamp_ns: int, items: dict[str, Any]) -> None:
        code, odometer = items.get(_CODE), items.get(_ODOMETER)
        if odometer is None:
            return
        carrier_hz, fields = None, None
        if code is not None and code[CODE_RECEIVED.index["carrier_hz"]] > 0.0:
            carrier_hz = code[CODE_RECEIVED.index["carrier_hz"]]
            if code[CODE_RECEIVED.index["valid"]] > 0.0:
                fields = {name: round(code[CODE_RECEIVED.index[name]]) for name in _FIELDS}
        distance_m, speed_mps = odometer
        way_m, fastest_mps, doubt_mps = None, None, 0.0
        known = located(items.get(_LOCALIZER))
        if known is not None:
            way_m = known.travelled(self._p.direction)
            speed_mps = known.believed_mps
            fastest_mps, doubt_mps = known.fastest_mps, known.doubt_mps
        output = self._supervision.update(
            stamp_ns * 1e-9,
            distance_m,
            speed_mps,
            fields=fields,
            carrier_hz=carrier_hz,
            located_m=way_m,
            fastest_mps=fastest_mps,
        )
        emergency = output.emergency_brake or not self.switched_on
        figures = [
            # The driver keeps to it by his own speed, supervision judges the fastest it may be.
            max(0.0, output.permitted_mps - doubt_mps),
            float(output.warning),
            float(output.service_brake),
            float(emergency),
        ]
        self._publish(self._table.write(stamp_ns, np.array([figures])))
        intervenes = emergency or output.service_brake
        self.report(
            DiagnosticStatus.WARN if intervenes else DiagnosticStatus.OK,
            "supervision",
            output.reason or "speed is within the code",
            stamp_ns=stamp_ns,
        )


def main() -> None:
    """Run the supervision of a train on its own."""
    run_node(CodeSupervisionNode)


if __name__ == "__main__":
    main()
