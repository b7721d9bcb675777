"""One position on board from all sensors, with an interval that holds it.

Topics in, as far as there are any: ``/<train>/odometer``, ``/<train>/doppler/fix``,
``/<train>/atp/relayed_range`` of the tick before or the zone controller's ``position``,
``/<train>/track_code/message``. Topics out: ``state``, ``position``.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import copysign, inf, isfinite, isnan, nan
from typing import Any, Final

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import table_row
from rail_msgs_py.localizer import quantities
from rail_msgs_py.parameters import parameter
from rail_msgs_py.position import Position, PositionWriter, position_from_cdr
from rail_msgs_py.quantities import (
    CLAIM_SIGMAS,
    DIRECTION,
    GIVE_UP,
    ODOMETER_ERROR,
    PLACED_SIGMA,
    TICK,
    TRAIN_START,
)
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_POSITION, LOCALIZER_STATE, RELAYED_RANGE
from rail_msgs_py.topics.ranging import POSITION
from rail_msgs_py.topics.track_code import CODE_RECEIVED
from rail_msgs_py.topics.world import ODOMETER
from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.protection_level import Localization, ProtectionReason, Status
from rail_signals.localizer.readings import (
    BlockEntry,
    DopplerFix,
    RangeFix,
    TickMeasurements,
    WheelSpeed,
)
from rail_signals.localizer.screening import UnusedReading
from rail_signals.localizer.settings import (
    BlockModel,
    DopplerModel,
    IntegrityClaim,
    LocalizerSettings,
    OdometerModel,
    RangeModel,
)

from .block_entries import BlockEntries


@dataclass(frozen=True)
class LocalizerParameters:
    """Parameters of the localizer."""

    track: str = parameter("main", "track it runs on, frame of its positions")
    direction: int = DIRECTION.parameter()
    start_m: float = TRAIN_START.parameter()
    placed_m: float = PLACED_SIGMA.parameter()
    doppler: bool = parameter(False, "whether there is a positioner by Doppler shifts")
    told: bool = parameter(False, "whether ranges are relayed to the train protection by radio")
    ranged: bool = parameter(False, "whether the zone controller's ranges are shared")
    joints_m: tuple[float, ...] = parameter((), "chainages of the joints it passes", unit="m")
    joint_carriers_hz: tuple[float, ...] = parameter(
        (), "carrier of the block behind each joint", unit="Hz"
    )
    zone_starts_m: tuple[float, ...] = parameter(
        (), "chainages at which another station begins to range", unit="m"
    )
    told_sigmas: float = CLAIM_SIGMAS.parameter()
    range_bias_m: float = parameter(
        0.5, "standard deviation of the lasting error of ranges", unit="m", low=0.0, high=100.0
    )
    odometer_scale: float = ODOMETER_ERROR.parameter()
    detection_s: float = parameter(
        0.5, "longest time from a joint to its notice", unit="s", low=0.0, high=10.0
    )
    integrity_risk: float = quantities.INTEGRITY_RISK.parameter()
    oldest_s: float = parameter(1.5, "age that a reading may have", unit="s", low=0.0, high=10.0)
    tick_s: float = TICK.parameter()
    timeout_s: float = GIVE_UP.parameter()


def settings_of(p: LocalizerParameters) -> LocalizerSettings:
    """Assumptions of the parameters.

    Raises
    ------
    ValueError
        If they do not fit together.
    """
    return LocalizerSettings(
        direction=p.direction,
        ranging=RangeModel(bias_m=p.range_bias_m),
        doppler=DopplerModel(),
        block=BlockModel(detection_s=p.detection_s),
        odometer=OdometerModel(scale=p.odometer_scale),
        claim=IntegrityClaim(risk=p.integrity_risk, tick_s=p.tick_s, oldest_s=p.oldest_s),
    )


class LocalizerNode(EquipmentNode[LocalizerParameters], name="localizer", namespace="/train_1"):
    """The localizer of a train as a managed node; switched off it knows nothing."""

    def setup(self) -> None:
        """Open the ports of the sensors that there are."""
        p, train = self._p, self.place
        self._localizer = Localizer(settings_of(p))
        self._entries = BlockEntries(p.joints_m, p.joint_carriers_hz)
        self._odometer = self.inputs.trigger(ODOMETER, table_row(ODOMETER), train=train)
        self._doppler = self._relayed = self._ranged = self._codes = ""
        if p.doppler:
            self._doppler = self.inputs.port(DOPPLER_FIX, table_row(DOPPLER_FIX), train=train)
        if p.told:
            # What is relayed in the first tick nobody can have received before it.
            late_ns = round(p.tick_s * NANOSECONDS)
            row = table_row(RELAYED_RANGE)
            self._relayed = self.inputs.port(RELAYED_RANGE, row, delay_ns=late_ns, train=train)
        if p.ranged:
            self._ranged = self.inputs.port(POSITION, self._on_own_track, train=train)
        if p.joints_m:
            self._codes = self.inputs.port(CODE_RECEIVED, table_row(CODE_RECEIVED), train=train)
        # Train protection, code supervision or the positioner waits for it.
        awaited = p.told or bool(p.joints_m) or p.doppler
        self._state = self.table_out(LOCALIZER_STATE, (train,), awaited=awaited, train=train)
        self._position = self.publisher(LOCALIZER_POSITION, train=train).send
        self._writer = PositionWriter(train, p.track)

    def start_over(self) -> None:
        """Know nothing of what was before: not even where it started."""
        self._localizer.reset()
        self._entries.reset()
        self._believed_m = nan
        self._started = False

    def _on_own_track(self, raw: bytes) -> tuple[int, tuple[float, float, float, float] | None]:
        stamp_ns, track, values = position_from_cdr(raw)
        return stamp_ns, values if track == self._p.track else None

    def on_tick(self, stamp_ns: int, items: Mapping[str, Any]) -> None:
        """Locate the train by what its sensors say in a tick."""
        # The place where it is put into service is known at the start of the run, and to no one
        # who is switched on later.
        starting = not self._started and stamp_ns == 0
        self._started = True
        columns: tuple[float, ...] = _UNKNOWN
        trouble = "switched off"
        if self.switched_on:
            if starting:
                self._localizer.place(self._p.start_m, self._p.placed_m)
                self._believed_m = self._p.start_m
            here = Localization.of(
                self._localizer.tick(stamp_ns / NANOSECONDS, self._readings(stamp_ns, items))
            )
            columns, trouble = _columns(here), _trouble(here)
            rejected = _words(self._localizer.rejected)
            level = DiagnosticStatus.WARN if rejected else DiagnosticStatus.OK
            self.report(level, "readings", rejected or "accepted", stamp_ns=stamp_ns)
        self._publish(stamp_ns, columns)
        level = DiagnosticStatus.WARN if trouble else DiagnosticStatus.OK
        self.report(level, "position", trouble or "protected", stamp_ns=stamp_ns)

    def _publish(self, stamp_ns: int, columns: tuple[float, ...]) -> None:
        state = dict(zip(LOCALIZER_STATE.columns, columns, strict=True))
        front_m = state["front_m"]
        known = isfinite(front_m)
        if known:
            self._believed_m = front_m
        self._state(stamp_ns, np.array([columns]))
        last_m = self._believed_m if isfinite(self._believed_m) else self._p.start_m
        place = Position(
            stamp_ns,
            self.place,
            self._p.track,
            front_m if known else last_m,
            state["sigma_m"] ** 2 if known else inf,
            state["speed_mps"] if known else 0.0,
            0.0 if known else inf,
        )
        self._position(self._writer.write(place))

    def _readings(self, stamp_ns: int, items: Mapping[str, Any]) -> TickMeasurements:
        return TickMeasurements(
            range=self._range_of(stamp_ns, items),
            doppler=_doppler_of(items.get(self._doppler)),
            block=self._block_of(items.get(self._codes)),
            odometer=_odometer_of(items.get(self._odometer)),
        )

    def _range_of(self, stamp_ns: int, items: Mapping[str, Any]) -> RangeFix | None:
        """Range relayed by radio or shared by the wayside, None where they say there is none."""
        relayed, shared = items.get(self._relayed), items.get(self._ranged)
        if relayed is not None:
            time_s, position_m, half_m = relayed
            if isnan(time_s) and isnan(position_m):
                return None
            age_s = stamp_ns / NANOSECONDS - time_s
            # What is told has in it how wrong its time may be, and clocks are so for long.
            lasting_m = abs(half_m) / self._p.told_sigmas
            # The square must not hide a sign that is wrong.
            variance_m2 = copysign((half_m / self._p.told_sigmas) ** 2, half_m)
        elif shared is not None:
            position_m, variance_m2, _, _ = shared
            if variance_m2 == inf:
                return None
            age_s = lasting_m = 0.0
        else:
            return None
        station = bisect_right(self._p.zone_starts_m, position_m)
        return RangeFix(position_m, variance_m2, age_s, float(station), lasting_m=lasting_m)

    def _block_of(self, code: list[float] | None) -> BlockEntry | None:
        if code is None:
            return None
        joint_m = self._entries.entered(code[CODE_RECEIVED.index["carrier_hz"]], self._believed_m)
        return None if joint_m is None else BlockEntry(joint_m, 0.0)


def _doppler_of(row: list[float] | None) -> DopplerFix | None:
    """A fix of the positioner, None where it says that there is none."""
    if row is None or row[DOPPLER_FIX.index["reason"]] != 0.0:
        return None
    chainage_m, speed_mps, variance, covariance, speed_variance = row[1:6]
    return DopplerFix(chainage_m, speed_mps, variance, covariance, speed_variance, 0.0)


def _odometer_of(row: list[float] | None) -> WheelSpeed | None:
    return None if row is None else WheelSpeed(abs(row[ODOMETER.index["speed_mps"]]), 0.0)


#: Of what is published where nothing is known, as `LOCALIZER_STATE.columns`.
_UNKNOWN: Final = (0.0, 0.0, 0.0, 0.0, nan, -inf, inf, nan, -inf, inf, inf, inf, 0.0)


def _columns(here: Localization) -> tuple[float, ...]:
    """Values of a state, as `LOCALIZER_STATE.columns`."""
    return (
        float(here.status),
        float(here.reason),
        float(here.detected),
        float(sum(1 << sensor for sensor in here.excluded)),
        here.position_m,
        here.low_m,
        here.high_m,
        here.speed_mps,
        here.speed_low_mps,
        here.speed_high_mps,
        here.sigma_m,
        here.fastest_mps,
        float(here.wheels_doubted),
    )


def _trouble(here: Localization) -> str:
    """What is wrong, in words; empty if nothing is."""
    excluded = [sensor.name.lower() for sensor in sorted(here.excluded)]
    parts = [f"without {', '.join(excluded)}"] if excluded else []
    if here.status is Status.UNAVAILABLE:
        parts.append("not known")
        if here.reason is not ProtectionReason.NONE:
            parts.append(here.reason.name.lower().replace("_", " "))
    elif here.detected and not excluded:
        parts.append("a sensor is faulty")
    return ": ".join(parts)


def _words(rejected: Sequence[UnusedReading]) -> str:
    """Which sensors gave no evidence, and why."""
    return "; ".join(f"{sensor.name.lower()}: {why.value}" for sensor, why, _ in rejected)


if __name__ == "__main__":
    LocalizerNode.main()
