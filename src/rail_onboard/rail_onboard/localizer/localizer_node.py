"""One position on board from all sensors, with an interval that holds it.

Topics in, as far as there are any: ``/<train>/odometer``, ``/<train>/doppler/fix``,
``/<train>/atp/told_position`` of the tick before or the zone controller's ``position``,
``/<train>/track_code/message``. Topics out: ``state``, ``position``.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import Equipment
from rail_msgs_py.parameters import ParameterError, declare, parameter
from rail_msgs_py.position import Position, PositionWriter
from rail_msgs_py.position import figures_from_cdr as position_from_cdr
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter, figures_from_cdr
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_POSITION, LOCALIZER_STATE, TOLD_POSITION
from rail_msgs_py.topics.ranging import POSITION
from rail_msgs_py.topics.track_code import CODE_RECEIVED
from rail_msgs_py.topics.world import ODOMETER
from rail_signals.localizer.core import LocalizerCore
from rail_signals.localizer.protection_level import Estimate, Reason, Status
from rail_signals.localizer.readings import (
    BlockReading,
    DopplerReading,
    OdometerReading,
    RangeReading,
    TickReadings,
)
from rail_signals.localizer.settings import (
    BlockModel,
    DopplerModel,
    IntegrityClaim,
    LocalizerSettings,
    OdometerModel,
    RangeModel,
    Sensor,
)

from .block_entries import BlockEntries

_ODOMETER, _DOPPLER, _TOLD, _RANGED, _CODES = "odometer", "doppler", "told", "ranged", "codes"


@dataclass(frozen=True)
class LocalizerParameters:
    """Parameters of the localizer."""

    track: str = parameter("main", "track it runs on, frame of its positions")
    direction: int = parameter(1, "1 or -1: towards greater or smaller chainages", low=-1, high=1)
    start_m: float = parameter(0.0, "chainage of its front when put into service", unit="m")
    placed_m: float = parameter(1.0, "standard deviation of that", unit="m", low=0.001, high=1e4)
    doppler: bool = parameter(False, "whether there is a positioner by Doppler shifts")
    told: bool = parameter(False, "whether ranges are told to the train protection by radio")
    ranged: bool = parameter(False, "whether the zone controller's ranges are shared")
    joints_m: tuple[float, ...] = parameter((), "chainages of the joints it passes", unit="m")
    joint_carriers_hz: tuple[float, ...] = parameter(
        (), "carrier of the block behind each joint", unit="Hz"
    )
    zone_starts_m: tuple[float, ...] = parameter(
        (), "chainages at which another station begins to range", unit="m"
    )
    told_sigmas: float = parameter(
        4.0, "half-width of a range that is told, in standard deviations", low=1.0, high=10.0
    )
    range_bias_m: float = parameter(
        0.5, "standard deviation of the lasting error of ranges", unit="m", low=0.0, high=100.0
    )
    odometer_scale: float = parameter(
        0.02, "standard deviation of the wheels' scale", low=0.0, high=0.2
    )
    detection_s: float = parameter(
        0.5, "longest time from a joint to its notice", unit="s", low=0.0, high=10.0
    )
    integrity_risk: float = parameter(
        1e-5, "probability that the error exceeds the interval", low=1e-12, high=0.1
    )
    oldest_s: float = parameter(1.5, "age that a reading may have", unit="s", low=0.0, high=10.0)
    tick_s: float = parameter(0.1, "time of a tick", unit="s", low=0.01, high=1.0)
    timeout_s: float = parameter(
        2.0, "wall time after which a sensor is given up", unit="s", low=0.05, high=3600.0
    )


def settings_of(p: LocalizerParameters) -> LocalizerSettings:
    """Assumptions of the parameters.

    Raises
    ------
    ParameterError
        If they do not fit together.
    """
    try:
        return LocalizerSettings(
            direction=p.direction,
            ranging=RangeModel(bias_m=p.range_bias_m),
            doppler=DopplerModel(),
            block=BlockModel(detection_s=p.detection_s),
            odometer=OdometerModel(scale=p.odometer_scale),
            claim=IntegrityClaim(risk=p.integrity_risk, tick_s=p.tick_s, oldest_s=p.oldest_s),
        )
    except ValueError as error:
        raise ParameterError(f"localizer: {error}") from None


class LocalizerNode(Equipment):
    """The localizer of a train as a managed node; switched off it knows nothing."""

    def __init__(
        self,
        name: str = "localizer",
        *,
        namespace: str = "/train_1",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(name, namespace, context=context, parameters=parameters, services=services)
        self._p = p = declare(self, LocalizerParameters)
        self._train = train = namespace.strip("/")
        try:
            self._entries = BlockEntries(p.joints_m, p.joint_carriers_hz)
        except ValueError as error:
            raise ParameterError(f"localizer: {error}") from None
        self._start_over()
        owners: dict[str, str] = {}
        self.stream_in(ODOMETER, self._on_odometer, train=train)
        if p.doppler:
            owners[_DOPPLER] = DOPPLER_FIX.owner(train=train)
            self._take(DOPPLER_FIX, _DOPPLER, len(DOPPLER_FIX.columns))
        if p.told:
            owners[_TOLD] = TOLD_POSITION.owner(train=train)
            self._take(
                TOLD_POSITION, _TOLD, len(TOLD_POSITION.columns), round(p.tick_s * NANOSECONDS)
            )
        if p.ranged:
            owners[_RANGED] = POSITION.owner(train=train).rpartition("/")[0]
            self.stream_in(POSITION, self._on_position, train=train)
        if p.joints_m:
            owners[_CODES] = CODE_RECEIVED.owner(train=train)
            self._take(CODE_RECEIVED, _CODES, len(CODE_RECEIVED.columns))
        self._inbox: TickInbox[Any] = TickInbox([_ODOMETER, *owners])
        if p.told:
            # What is told in the first tick nobody can have received before it.
            self._inbox.put(0, _TOLD, None)
        self._watch = TickWatch(self, self._inbox, owners, p.timeout_s, self._advance)
        self._tell = (
            self.stream_out(LOCALIZER_STATE, train=train)
            if p.told or p.joints_m  # train protection or code supervision waits for it
            else (self.publisher(LOCALIZER_STATE, train=train).publish)
        )
        self._table = TableWriter((train,), LOCALIZER_STATE.columns)
        self._position = self.publisher(LOCALIZER_POSITION, train=train).publish
        self._writer = PositionWriter(train, p.track)
        self.announce_when_connected()

    def on_activate(self, state: Any) -> Any:
        """Switched on again, it knows nothing of what was before."""
        self._start_over()
        return super().on_activate(state)

    def _start_over(self) -> None:
        self._core = LocalizerCore(settings_of(self._p))
        self._last_ns: int | None = None
        self._believed_m = self._p.start_m

    def _take(self, topic: Any, port: str, columns: int, late_ns: int = 0) -> None:
        """Listen to a table of one row; `late_ns` is added to its stamp."""

        def put(raw: bytes) -> None:
            stamp_ns, figures = figures_from_cdr(raw, 1, columns)
            self._inbox.put(stamp_ns + late_ns, port, figures[0].tolist())
            self._advance()

        self.stream_in(topic, put, train=self._train)

    def _on_odometer(self, raw: bytes) -> None:
        stamp_ns, figures = figures_from_cdr(raw, 1, len(ODOMETER.columns))
        self._inbox.put(stamp_ns, _ODOMETER, figures[0].tolist())
        self._watch.begin()
        self._advance()

    def _on_position(self, raw: bytes) -> None:
        stamp_ns, track, figures = position_from_cdr(raw)
        self._inbox.put(stamp_ns, _RANGED, figures if track == self._p.track else None)
        self._advance()

    def _advance(self) -> None:
        while self._inbox.complete:
            self._watch.end()
            self._locate(*self._inbox.take())

    def _locate(self, stamp_ns: int, items: Mapping[str, Any]) -> None:
        figures = np.array([[0.0, 0.0, 0.0, 0.0, np.nan, -inf, inf, np.nan, -inf, inf, inf]])
        trouble = "switched off"
        if self.switched_on:
            estimate = self._estimate(stamp_ns, items)
            figures, trouble = _row(estimate), _trouble(estimate)
        front_m, speed_mps, sigma_m = figures[0, [4, 7, 10]].tolist()
        if isfinite(front_m):
            self._believed_m = front_m
        self._tell(self._table.write(stamp_ns, figures))
        known = isfinite(front_m)
        place = Position(
            stamp_ns,
            self._train,
            self._p.track,
            front_m if known else self._believed_m,
            sigma_m**2 if known else inf,
            speed_mps if known else 0.0,
            0.0 if known else inf,
        )
        self._position(self._writer.write(place))
        level = DiagnosticStatus.WARN if trouble else DiagnosticStatus.OK
        self.report(level, "position", trouble or "protected", stamp_ns=stamp_ns)

    def _estimate(self, stamp_ns: int, items: Mapping[str, Any]) -> Estimate:
        step_s = 0.0
        if self._last_ns is None:
            self._core.place(self._p.start_m, self._p.placed_m)
        else:
            step_s = (stamp_ns - self._last_ns) / NANOSECONDS
        self._last_ns = stamp_ns
        return self._core.step(
            step_s,
            TickReadings(
                range=self._range_of(stamp_ns, items),
                doppler=_doppler_of(items.get(_DOPPLER)),
                block=self._block_of(items.get(_CODES)),
                odometer=_odometer_of(items.get(_ODOMETER)),
            ),
        )

    def _range_of(self, stamp_ns: int, items: Mapping[str, Any]) -> RangeReading | None:
        told, shared = items.get(_TOLD), items.get(_RANGED)
        if told is not None:
            time_s, position_m, half_m = told
            age_s = stamp_ns / NANOSECONDS - time_s
            variance_m2 = (half_m / self._p.told_sigmas) ** 2
        elif shared is not None:
            position_m, variance_m2, _, _ = shared
            age_s = 0.0
        else:
            return None
        if not (isfinite(position_m) and 0.0 < variance_m2 < inf):
            return None
        if not 0.0 <= age_s <= self._p.oldest_s:
            return None
        station = bisect_right(self._p.zone_starts_m, position_m)
        return RangeReading(position_m, variance_m2, age_s, float(station))

    def _block_of(self, code: list[float] | None) -> BlockReading | None:
        if code is None:
            return None
        joint_m = self._entries.entered(code[CODE_RECEIVED.index["carrier_hz"]], self._believed_m)
        return None if joint_m is None else BlockReading(joint_m, 0.0)


def _doppler_of(fix: list[float] | None) -> DopplerReading | None:
    """A fix as the filter takes it, None if it is not one."""
    if fix is None or fix[DOPPLER_FIX.index["reason"]] != 0.0:
        return None
    chainage_m, speed_mps, variance, covariance, speed_variance = fix[1:6]
    return DopplerReading(chainage_m, speed_mps, variance, covariance, speed_variance, 0.0)


def _odometer_of(reading: list[float] | None) -> OdometerReading | None:
    return None if reading is None else OdometerReading(abs(reading[1]), 0.0)


def _row(estimate: Estimate) -> np.ndarray[Any, Any]:
    """Figures [1, column] as ``LOCALIZER_STATE.columns``."""
    excluded = sum(1 << int(sensor) for sensor in Sensor if bool(estimate.excluded[..., sensor]))
    return np.array(
        [
            [
                float(estimate.status),
                float(estimate.reason),
                float(estimate.found),
                float(excluded),
                float(estimate.position_m),
                float(estimate.low_m),
                float(estimate.high_m),
                float(estimate.speed_mps),
                float(estimate.speed_low_mps),
                float(estimate.speed_high_mps),
                float(estimate.sigma_m),
            ]
        ]
    )


def _trouble(estimate: Estimate) -> str:
    """What is wrong, in words; empty if nothing is."""
    excluded = [sensor.name.lower() for sensor in Sensor if bool(estimate.excluded[..., sensor])]
    parts = [f"without {', '.join(excluded)}"] if excluded else []
    if int(estimate.status) == Status.UNAVAILABLE:
        parts.append("not known")
    elif bool(estimate.found) and not excluded:
        parts.append("a sensor is faulty")
    reason = Reason(int(estimate.reason))
    if int(estimate.status) == Status.UNAVAILABLE and reason is not Reason.NONE:
        parts.append(reason.name.lower().replace("_", " "))
    return ": ".join(parts)


def main() -> None:
    """Run the localizer of a train on its own."""
    run_node(LocalizerNode)


if __name__ == "__main__":
    main()
