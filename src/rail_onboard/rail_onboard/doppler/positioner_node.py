"""Positions of a train from the Doppler shifts of reference stations.

Topics in: ``rx``, with a localizer its ``state`` of the tick before. Topics out: ``fix``,
``position``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import block, table_row
from rail_msgs_py.doppler import quantities
from rail_msgs_py.doppler.parameters import ReferenceToneParameters, tone_plan_of
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.position import Position, PositionWriter
from rail_msgs_py.quantities import DIRECTION_OR_UNKNOWN, GIVE_UP, TICK, TRAIN_START
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.doppler import DOPPLER_FIX, DOPPLER_POSITION, REFERENCE_RX
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.waveform import Waveform
from rail_onboard.localizer.protected_interval import protected_interval
from rail_signals.doppler.receiver import ToneReceiver
from rail_signals.doppler.solver import Answer, DopplerSolver, NoFixReason
from rail_signals.doppler.surveyed_line import SurveyedLine

from .positioner import DopplerPositioner, Tracking


@dataclass(frozen=True)
class DopplerPositionerParameters(ReferenceToneParameters):
    """Parameters of a positioner; arrays over points of the line, or over stations."""

    track: str = parameter("main", "track it runs on, frame of its positions")
    direction: int = DIRECTION_OR_UNKNOWN.parameter()
    start_m: float = TRAIN_START.parameter()
    placed_m: float = parameter(50.0, "how far off that may be", unit="m", low=0.1, high=1e5)
    line_chainage_m: tuple[float, ...] = parameter((), "chainages at equal steps", unit="m")
    line_x_m: tuple[float, ...] = parameter((), "places of the line there, east", unit="m")
    line_y_m: tuple[float, ...] = parameter((), "north", unit="m")
    line_z_m: tuple[float, ...] = parameter((), "up", unit="m")
    line_heading_rad: tuple[float, ...] = parameter((), "direction of the line", unit="rad")
    station_slots: tuple[int, ...] = parameter((), "frequency slot of each station")
    station_x_m: tuple[float, ...] = parameter((), "place of its antenna, east", unit="m")
    station_y_m: tuple[float, ...] = parameter((), "north", unit="m")
    station_z_m: tuple[float, ...] = parameter((), "up", unit="m")
    station_hz: float = quantities.STATION_OFFSET_HZ.parameter()
    walk_hz: float = quantities.RECEIVER_WALK.parameter()
    worst_sigma_m: float = parameter(
        50.0, "a position more uncertain than this is not given", unit="m", low=0.01, high=1e4
    )
    localizer: bool = parameter(
        False, "whether a localizer waits for the positions, and tells where to look"
    )
    tick_s: float = TICK.parameter()
    timeout_s: float = GIVE_UP.parameter()


def positioner_of(p: DopplerPositionerParameters, *, restarted: bool = False) -> DopplerPositioner:
    """Positioner of the parameters; one that has restarted does not know where the train is.

    Raises
    ------
    ValueError
        If they do not fit together.
    """
    plan = tone_plan_of(p)
    line = SurveyedLine(
        np.array(p.line_chainage_m),
        np.array(p.line_x_m),
        np.array(p.line_y_m),
        np.array(p.line_z_m),
        np.array(p.line_heading_rad),
    )
    solver = DopplerSolver(
        plan,
        line,
        np.column_stack([p.station_x_m, p.station_y_m, p.station_z_m]),
        p.station_slots,
        worst_sigma_m=p.worst_sigma_m,
        grid_m=min(5.0, 0.25 * p.min_distance_m),
    )
    tracking = Tracking(p.max_speed_mps, p.placed_m, p.walk_hz, p.station_hz)
    start_m = None if restarted else p.start_m
    return DopplerPositioner(ToneReceiver(plan), solver, tracking, start_m, p.direction)


class DopplerPositionerNode(
    EquipmentNode[DopplerPositionerParameters], name="doppler", namespace="/train_1"
):
    """A positioner as a managed node; switched off it knows nothing."""

    def setup(self) -> None:
        """Open the ports of the train."""
        p, train = self._p, self.place
        if len(p.line_chainage_m) < 2:
            raise ParameterError(f"line_chainage_m: {p.line_chainage_m}: needs two points or more")
        self._fix = self.table_out(DOPPLER_FIX, (train,), awaited=p.localizer, train=train)
        self._position = self.publisher(DOPPLER_POSITION, train=train).send
        self._writer = PositionWriter(train, p.track)
        self._received = self.inputs.trigger(REFERENCE_RX, block, train=train)
        self._localizer = ""
        if p.localizer:
            # It answers to the positions of a tick, so what it says is of use in the next.
            late_ns, row = round(p.tick_s * NANOSECONDS), table_row(LOCALIZER_STATE)
            self._localizer = self.inputs.port(LOCALIZER_STATE, row, delay_ns=late_ns, train=train)

    def start_over(self) -> None:
        """Know no place; see `on_tick`."""
        self._positioner = positioner_of(self._p, restarted=True)
        self._last_ns: int | None = None

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Find the place by what was received in a tick."""
        received: Waveform | None = items.get(self._received)
        if self._last_ns is None and stamp_ns == 0:
            # Where the train is put into service is known at the start of the run, and to no one
            # who is switched on later.
            self._positioner = positioner_of(self._p)
        step_s = 0.0 if self._last_ns is None else (stamp_ns - self._last_ns) / NANOSECONDS
        self._last_ns = stamp_ns
        positioner = self._positioner
        answer = Answer(NoFixReason.TOO_FEW_STATIONS)
        if self.switched_on:
            if (known := protected_interval(items.get(self._localizer))) is not None:
                positioner.tell(known.low_m, known.high_m)
            answer = positioner.locate(None if received is None else received.row, step_s)
        self._publish(stamp_ns, answer, positioner.tones)

    def _publish(self, stamp_ns: int, answer: Answer, tones: int) -> None:
        fix = answer.fix if answer.reason is NoFixReason.NONE else None
        place = Position(
            stamp_ns, self.place, self._p.track, self._positioner.near_m, inf, 0.0, inf
        )
        values = [float(answer.reason), *(np.nan,) * 5, float(tones), np.nan]
        if fix is not None:
            c = fix.covariance
            values[1:6] = fix.chainage_m, fix.speed_mps, c[0, 0], c[0, 1], c[1, 1]
            values[7] = fix.offset_hz
            place = Position(
                stamp_ns,
                self.place,
                self._p.track,
                fix.chainage_m,
                float(c[0, 0]),
                fix.speed_mps,
                float(c[1, 1]),
            )
        self._fix(stamp_ns, np.array([values]))
        self._position(self._writer.write(place))
        trouble = "" if fix is not None else answer.reason.name.lower().replace("_", " ")
        level = DiagnosticStatus.WARN if trouble else DiagnosticStatus.OK
        self.report(level, "position", trouble or "position known", stamp_ns=stamp_ns)


if __name__ == "__main__":
    DopplerPositionerNode.main()
