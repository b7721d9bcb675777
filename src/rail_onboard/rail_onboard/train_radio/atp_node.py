"""Automatic train protection: obeys movement authorities received by radio, reports the train.

Topics in: ``/<train>/cbtc_radio/telegrams``, ``/<train>/odometer``, with a localizer its
``state``, with a train bus the ``link`` of its head. Topics out: ``command``, ``telegrams``,
``state``, ``relayed_range``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import stamped, table_row
from rail_msgs_py.parameters import parameter
from rail_msgs_py.quantities import (
    ALLOWED_ODOMETER_ERROR,
    GIVE_UP,
    PLACED,
    SEED,
    TICK,
    TRAIN_LENGTH,
    TRAIN_START,
)
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.localizer import LOCALIZER_STATE, RELAYED_RANGE
from rail_msgs_py.topics.train_bus import BUS_LINK
from rail_msgs_py.topics.train_radio import ATP_STATE, RADIO_TELEGRAMS, TRAIN_TELEGRAMS
from rail_msgs_py.topics.world import COMMAND, ODOMETER
from rail_msgs_py.train_radio import quantities
from rail_msgs_py.train_radio.cycle import Cycle
from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams
from rail_msgs_py.train_radio.train_channel import EndSettings, train_end
from rail_msgs_py.train_radio.unit_clock import ClockParameters, unit_clock_of
from rail_onboard.braking_curve import GuaranteedBraking
from rail_onboard.gradient_profile import GradientProfile
from rail_onboard.localizer.protected_interval import protected_interval
from rail_onboard.track_code.supervision import SupervisionOutput, Thresholds

from .odometer_watch import RunningLimits
from .supervision import AuthoritySupervision, CurveTimes
from .train_location import Location, TrainLocation
from .train_modes import ModeSupervision, TrainMode
from .train_protection import LocalizerView, TrainIdentity, TrainProtection

_NOT_RELAYED = (nan, nan, inf)
_OFF = SupervisionOutput(0.0, True, True, True, "switched off", traction_cut_off=True)
_NO_STATE = (nan, nan, nan, nan, inf, nan, inf, 0.0, 0.0)
_MODES = {
    TrainMode.NOT_KNOWN: "position not known: held until it is located",
    TrainMode.LOCATED: "located, stands",
    TrainMode.MOVING: "moving under supervision",
    TrainMode.ON_SIGHT: "on sight, released by a person",
}
_SUPERVISED = (TrainMode.LOCATED, TrainMode.MOVING)
#: From the command to the first force of the brake.
_DEAD_TIME_S = 0.1


@dataclass(frozen=True)
class AtpParameters(ClockParameters):
    """Parameters of the protection on board."""

    number: int = parameter(1, "number of the train in telegrams", low=1, high=0xEFFF)
    segment: int = parameter(0, "number of its track", low=0, high=0xFFFF)
    start_m: float = TRAIN_START.parameter()
    placed_m: float = PLACED.parameter()
    length_m: float = TRAIN_LENGTH.parameter()
    gradient_from_m: tuple[float, ...] = parameter(
        (0.0,), "surveyed chainages from which each gradient of its track holds", unit="m"
    )
    gradient_permil: tuple[float, ...] = parameter(
        (0.0,), "these gradients", unit="permil", low=-200.0, high=200.0
    )
    braking_mps2: float = quantities.BRAKING.parameter()
    emergency_mps2: float = quantities.EMERGENCY_BRAKING.parameter()
    band_up_to_mps: tuple[float, ...] = parameter(
        (), "speeds up to which other guaranteed rates hold, rising", unit="m/s", low=0.0
    )
    band_braking_mps2: tuple[float, ...] = parameter(
        (), "service brake rate of each of them", unit="m/s^2", low=0.01, high=5.0
    )
    band_emergency_mps2: tuple[float, ...] = parameter(
        (), "emergency brake rate of each of them", unit="m/s^2", low=0.01, high=5.0
    )
    brake_build_up_s: float = parameter(
        0.0, "from the demand to the full force of a brake, a ramp", unit="s", low=0.0, high=10.0
    )
    fastest_mps: float = parameter(
        100.0, "speed that the train never exceeds", unit="m/s", low=0.1, high=200.0
    )
    traction_mps2: float = parameter(
        1.0, "most acceleration of its motors", unit="m/s^2", low=0.0, high=5.0
    )
    most_braking_mps2: float = parameter(
        2.5,
        "most deceleration by brakes, resistance and rise together; wheels that lose speed faster "
        "slide",
        unit="m/s^2",
        low=0.1,
        high=10.0,
    )
    releases_s: tuple[float, ...] = parameter(
        (), "simulated times at which a person releases it to run on sight", unit="s", low=0.0
    )
    on_sight_mps: float = quantities.ON_SIGHT.parameter()
    cycle_s: float = quantities.ATP_CYCLE.parameter()
    report_period_s: float = quantities.REPORT_PERIOD.parameter()
    margin_m: float = parameter(
        6.0, "kept before the end of authority", unit="m", low=0.0, high=1e4
    )
    odometer_error: float = ALLOWED_ODOMETER_ERROR.parameter()
    authority_timeout_s: float = quantities.AUTHORITY_TIMEOUT.parameter()
    localizer: bool = parameter(False, "whether the position is that of a localizer")
    bus: bool = parameter(
        False,
        "whether the train bus confirms that the train is whole; else it is a fixed formation",
    )
    secret: str = parameter("00" * 16, "its key with the zone controller, in hexadecimal digits")
    seed: int = SEED.parameter()
    tick_s: float = TICK.parameter()
    timeout_s: float = GIVE_UP.parameter()


def supervision_of(p: AtpParameters) -> AuthoritySupervision:
    """Supervision of the parameters.

    Raises
    ------
    ValueError
        If they do not fit together.
    """
    # What a cycle measures the next one acts on; the stated one covers the tick of the simulation.
    cycle_s = max(p.cycle_s, p.tick_s)
    bands = (p.band_braking_mps2, p.band_emergency_mps2)
    if any(len(rates) != len(p.band_up_to_mps) for rates in bands):
        raise ValueError(f"band_up_to_mps: {p.band_up_to_mps} goes with other numbers of rates")
    if len(p.gradient_from_m) != len(p.gradient_permil):
        raise ValueError(f"gradient_permil: {p.gradient_permil} is not one for each chainage")
    service, emergency = (
        (*zip(p.band_up_to_mps, rates, strict=True), (inf, rate))
        for rates, rate in zip(bands, (p.braking_mps2, p.emergency_mps2), strict=True)
    )
    braking = GuaranteedBraking(
        service_mps2=service,
        emergency_mps2=emergency,
        gradients=GradientProfile(zip(p.gradient_from_m, p.gradient_permil, strict=True)),
        delay_s=2.0 * cycle_s + _DEAD_TIME_S,
        cut_off_s=2.0 * cycle_s,
        build_up_s=p.brake_build_up_s,
        traction_mps2=p.traction_mps2,
        speed_error=p.odometer_error,
    )
    thresholds = Thresholds()
    return AuthoritySupervision(
        p.length_m,
        margin_m=p.margin_m,
        timeout_s=p.authority_timeout_s,
        braking=braking,
        thresholds=thresholds,
        times=CurveTimes(driver_s=2.0 * cycle_s),
        fastest_mps=p.fastest_mps,
    )


def protection_of(p: AtpParameters) -> TrainProtection:
    """Protection of the parameters.

    Raises
    ------
    ValueError
        If they do not fit together.
    """
    supervision = supervision_of(p)
    braking = supervision.curves.braking
    modes = ModeSupervision(
        supervision,
        releases_s=p.releases_s,
        on_sight_mps=p.on_sight_mps,
        timeout_s=p.authority_timeout_s,
        thresholds=Thresholds(),
    )
    limits = RunningLimits(
        accelerating_mps2=max(braking.gathering_mps2, 0.1),
        braking_mps2=p.most_braking_mps2,
        sure_braking_mps2=braking.service_deceleration_mps2,
        delay_s=braking.full_force_s,
        fastest_mps=p.fastest_mps,
    )
    channel = train_end(EndSettings(p.secret, p.seed, p.number, p.tick_s, unit_clock_of(p)))
    identity = TrainIdentity(p.number, p.segment, p.start_m, p.placed_m, p.length_m)
    location = TrainLocation(p.odometer_error, limits=limits)
    return TrainProtection(identity, channel, location, modes)


def _confirms_end(link: list[float] | None) -> bool:
    """Whether the terminal at the head has heard the end of the train within its time-out."""
    return link is not None and link[BUS_LINK.index["other_end"]] > 0.0


def _worst_brake(braking: GuaranteedBraking) -> tuple[float, float]:
    """Deceleration on the steepest fall, and the delay that the traction until then makes longer.

    With D(v) = v T + (v + a T)^2 / (2 b) an error of speed costs as much way as with a delay of
    T (1 + a / b) and no traction.
    """
    deceleration_mps2 = braking.service_deceleration_mps2
    return deceleration_mps2, braking.full_force_s * (
        1.0 + braking.traction_mps2 / deceleration_mps2
    )


class AtpNode(EquipmentNode[AtpParameters], name="atp", namespace="/train_1"):
    """Train protection as a managed node; switched off it demands the emergency brake."""

    def setup(self) -> None:
        """Open the ports of the train."""
        train = self.place
        self._reports = Cycle(self._p.report_period_s, self._p.tick_s)
        self._radio = self.inputs.port(RADIO_TELEGRAMS, stamped(Telegrams.from_cdr), train=train)
        self._localizer = ""
        if self._p.localizer:
            row = table_row(LOCALIZER_STATE)
            self._localizer = self.inputs.port(LOCALIZER_STATE, row, train=train)
            self._relay = self.table_out(RELAYED_RANGE, (train,), awaited=True, train=train)
        self._bus = ""
        if self._p.bus:
            # What the end of the train says in a tick is known at the head after it.
            late_ns, row = round(self._p.tick_s * NANOSECONDS), table_row(BUS_LINK)
            self._bus = self.inputs.port(BUS_LINK, row, delay_ns=late_ns, train=train, end="head")
        self._odometer = self.inputs.trigger(ODOMETER, table_row(ODOMETER), train=train)
        self._command = self.table_out(
            COMMAND, (train,), awaited=True, train=train, supervision=self.get_name()
        )
        self._send = self.stream_out(TRAIN_TELEGRAMS, train=train)
        self._state = self.table_out(ATP_STATE, (train,), train=train)

    def start_over(self) -> None:
        """Have no authority, and no session with the zone controller."""
        self._protection = protection_of(self._p)
        self._worst_brake = _worst_brake(supervision_of(self._p).curves.braking)

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Judge place and speed by the authority, command the brakes, report the train."""
        distance_m, speed_mps = items[self._odometer]
        received = items.get(self._radio)
        frames = received.in_slot(self._p.number) if received else []
        protection = self._protection
        localizer, doubt_mps = None, 0.0
        known = protected_interval(items.get(self._localizer)) if self._p.localizer else None
        if known is not None:
            believed_mps, fastest_mps = known.speeds(speed_mps)
            doubt_mps = fastest_mps - believed_mps
            # What it may be faster than supervised counts as way ahead of the front.
            ahead_m = known.braking_m(fastest_mps, *self._worst_brake)
            half_m = known.half_m + 0.5 * ahead_m
            place = Location(known.low_m + half_m, half_m, True)
            localizer = LocalizerView(place, believed_mps, fastest_mps)
        protection.whole = not self._p.bus or _confirms_end(items.get(self._bus))
        out, sent = _OFF, []
        if self.switched_on:
            out = protection.tick(stamp_ns, distance_m, speed_mps, frames, localizer)
            if self._reports.begins(stamp_ns):
                sent = [(self._p.number, protection.frame(stamp_ns))]
        self._send(telegrams(stamp_ns, sent))
        if self._p.localizer:
            newest = (
                max(protection.relayed, default=_NOT_RELAYED) if self.switched_on else _NOT_RELAYED
            )
            self._relay(stamp_ns, np.array([newest]))
        state = protection.state_values(stamp_ns) if self.switched_on else _NO_STATE
        self._state(stamp_ns, np.array([state], dtype=np.float64))
        # The driver keeps to it by his own speed, supervision judges the fastest it may be.
        permitted_mps = max(0.0, out.permitted_mps - doubt_mps)
        command = [permitted_mps, out.warning, out.service_brake, out.emergency_brake]
        command += [out.traction_cut_off, out.on_sight]
        self._command(stamp_ns, np.array([command], dtype=np.float64))
        self.report(
            DiagnosticStatus.WARN if out.reason else DiagnosticStatus.OK,
            "supervision",
            out.reason or "running",
            stamp_ns=stamp_ns,
        )
        mode = protection.mode if self.switched_on else TrainMode.NOT_KNOWN
        self.report(
            DiagnosticStatus.OK if mode in _SUPERVISED else DiagnosticStatus.WARN,
            "mode",
            _MODES[mode],
            stamp_ns=stamp_ns,
        )


if __name__ == "__main__":
    AtpNode.main()
