"""Automatic train protection: obeys movement authorities received by radio, reports the train.

Topics in: ``/<train>/cbtc_radio/telegrams``, ``/<train>/odometer``, with a localizer its
``state``. Topics out: ``command``, ``telegrams``, ``state``, ``told_position``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, nan
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import Equipment
from rail_msgs_py.parameters import ParameterError, declare, parameter
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter, figures_from_cdr
from rail_msgs_py.topics.localizer import LOCALIZER_STATE, TOLD_POSITION
from rail_msgs_py.topics.train_radio import ATP_STATE, RADIO_TELEGRAMS, TRAIN_TELEGRAMS
from rail_msgs_py.topics.world import COMMAND, ODOMETER
from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams
from rail_msgs_py.train_radio.train_channel import train_end
from rail_onboard.braking_curve import GuaranteedBraking
from rail_onboard.localizer.located import located
from rail_onboard.track_code.supervision import SupervisionOutput, Thresholds

from .supervision import AuthoritySupervision
from .train_location import NOWHERE, Location, TrainLocation
from .train_protection import TrainIdentity, TrainProtection

_ODOMETER, _RADIO, _LOCALIZER = "odometer", "radio", "localizer"
_NOT_TOLD = (nan, nan, inf)
_OFF = SupervisionOutput(0.0, True, True, True, "switched off")


@dataclass(frozen=True)
class AtpParameters:
    """Parameters of the protection on board."""

    number: int = parameter(1, "number of the train in telegrams", low=1, high=0xEFFF)
    segment: int = parameter(0, "number of its track", low=0, high=0xFFFF)
    start_m: float = parameter(0.0, "chainage of its front when put into service", unit="m")
    placed_m: float = parameter(1.0, "how well that is known", unit="m", low=0.0, high=1e4)
    length_m: float = parameter(100.0, "its length", unit="m", low=1.0, high=6000.0)
    steepest_fall_permil: float = parameter(
        0.0, "steepest fall it runs on", unit="permil", low=0.0, high=100.0
    )
    braking_mps2: float = parameter(
        0.7, "service braking that may be counted on", unit="m/s^2", low=0.05, high=5.0
    )
    emergency_mps2: float = parameter(
        0.9, "emergency braking that may be counted on", unit="m/s^2", low=0.05, high=5.0
    )
    traction_mps2: float = parameter(
        1.0, "most acceleration of its motors", unit="m/s^2", low=0.0, high=5.0
    )
    margin_m: float = parameter(
        5.0, "kept before the end of authority", unit="m", low=0.0, high=1e4
    )
    odometer_error: float = parameter(
        0.02, "relative error of distances that must be allowed for", low=0.0, high=0.5
    )
    authority_timeout_s: float = parameter(
        3.0, "age of an authority that makes the train brake", unit="s", low=0.1, high=600.0
    )
    localizer: bool = parameter(False, "whether the position is that of a localizer")
    secret: str = parameter("00" * 16, "of the safe channel, in hexadecimal digits")
    seed: int = parameter(0, "of the nonces of the safe channel", low=0)
    tick_s: float = parameter(0.25, "time of a tick", unit="s", low=0.01, high=1.0)
    timeout_s: float = parameter(
        2.0, "wall time after which the radio is given up", unit="s", low=0.05, high=3600.0
    )


def protection_of(p: AtpParameters, restarts: int = 0) -> TrainProtection:
    """Protection of the parameters, after it was switched on anew so often.

    Raises
    ------
    ParameterError
        If they do not fit together.
    """
    # A speed measured in one tick is acted on in the next: two ticks, and a tenth for the brake.
    delay_s = 2.0 * p.tick_s + 0.1
    try:
        braking = GuaranteedBraking(
            service_mps2=p.braking_mps2,
            emergency_mps2=p.emergency_mps2,
            fall_permil=p.steepest_fall_permil,
            delay_s=delay_s,
            traction_mps2=p.traction_mps2,
            speed_error=p.odometer_error,
        )
        thresholds = Thresholds()
        # A train that is a little too fast where it should stand must stand before the end.
        rolling_m = braking.stopping_m(thresholds.service_over_mps)
        supervision = AuthoritySupervision(
            p.length_m,
            margin_m=max(p.margin_m, rolling_m),
            timeout_s=p.authority_timeout_s,
            braking=braking,
            thresholds=thresholds,
        )
        channel = train_end(p.secret, p.seed, p.number, p.tick_s, restarts)
    except ValueError as error:
        raise ParameterError(f"atp: {error}") from None
    identity = TrainIdentity(p.number, p.segment, p.start_m, p.placed_m, p.length_m)
    return TrainProtection(identity, channel, TrainLocation(p.odometer_error), supervision)


class AtpNode(Equipment):
    """Train protection as a managed node; switched off it demands the emergency brake."""

    def __init__(
        self,
        name: str = "atp",
        *,
        namespace: str = "/train_1",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(name, namespace, context=context, parameters=parameters, services=services)
        self._p = declare(self, AtpParameters)
        self._protection = protection_of(self._p)
        self._activations = 0
        train = namespace.strip("/")
        owners = {_RADIO: f"/{train}/cbtc_radio"}
        if self._p.localizer:
            owners[_LOCALIZER] = LOCALIZER_STATE.owner(train=train)
            self.stream_in(LOCALIZER_STATE, self._on_located, train=train)
            self._tell_position = self.stream_out(TOLD_POSITION, train=train)
            self._told_table = TableWriter((train,), TOLD_POSITION.columns)
        self._inbox: TickInbox[Any] = TickInbox([_ODOMETER, *owners])
        self._watch = TickWatch(self, self._inbox, owners, self._p.timeout_s, self._advance)
        self._command = self.stream_out(COMMAND, train=train, supervision=name)
        self._tell = self.stream_out(TRAIN_TELEGRAMS, train=train)
        self._state = self.publisher(ATP_STATE, train=train).publish
        self._command_table = TableWriter((train,), COMMAND.columns)
        self._state_table = TableWriter((train,), ATP_STATE.columns)
        self.stream_in(ODOMETER, self._on_odometer, train=train)
        self.stream_in(RADIO_TELEGRAMS, self._on_telegrams, train=train)
        self.announce_when_connected()

    def on_activate(self, state: Any) -> Any:
        """Switched on again, it knows nothing of what was before."""
        self._protection = protection_of(self._p, self._activations)
        self._activations += 1
        return super().on_activate(state)

    def _on_odometer(self, raw: bytes) -> None:
        stamp_ns, figures = figures_from_cdr(raw, 1, len(ODOMETER.columns))
        self._inbox.put(stamp_ns, _ODOMETER, figures[0].tolist())
        self._watch.begin()
        self._advance()

    def _on_telegrams(self, raw: bytes) -> None:
        heard = Telegrams.from_cdr(raw)
        self._inbox.put(heard.stamp_ns, _RADIO, heard)
        self._advance()

    def _on_located(self, raw: bytes) -> None:
        stamp_ns, figures = figures_from_cdr(raw, 1, len(LOCALIZER_STATE.columns))
        self._inbox.put(stamp_ns, _LOCALIZER, figures[0].tolist())
        self._advance()

    def _advance(self) -> None:
        while self._inbox.complete:
            self._watch.end()
            self._decide(*self._inbox.take())

    def _decide(self, stamp_ns: int, items: Mapping[str, Any]) -> None:
        distance_m, speed_mps = items[_ODOMETER]
        heard = items.get(_RADIO)
        frames = heard.in_slot(self._p.number) if heard else []
        protection = self._protection
        place, fastest_mps, doubt_mps = None, None, 0.0
        if self._p.localizer:
            known = located(items.get(_LOCALIZER))
            place = NOWHERE
            if known is not None:
                place = Location(known.low_m + known.half_m, known.half_m, True)
                speed_mps = known.believed_mps
                fastest_mps, doubt_mps = known.fastest_mps, known.doubt_mps
        out, sent = _OFF, []
        if self.switched_on:
            out = protection.tick(stamp_ns, distance_m, speed_mps, frames, place, fastest_mps)
            told_mps = speed_mps if fastest_mps is None else fastest_mps
            sent = [(self._p.number, protection.frame(stamp_ns, told_mps))]
        self._tell(telegrams(stamp_ns, sent))
        if self._p.localizer:
            newest = max(protection.told, default=_NOT_TOLD) if self.switched_on else _NOT_TOLD
            self._tell_position(self._told_table.write(stamp_ns, np.array([newest])))
        figures = np.array([protection.figures(stamp_ns)], dtype=np.float64)
        self._state(self._state_table.write(stamp_ns, figures))
        # The driver keeps to it by his own speed, supervision judges the fastest it may be.
        permitted_mps = max(0.0, out.permitted_mps - doubt_mps)
        command = [[permitted_mps, out.warning, out.service_brake, out.emergency_brake]]
        self._command(self._command_table.write(stamp_ns, np.array(command, dtype=np.float64)))
        self.report(
            DiagnosticStatus.WARN if out.reason else DiagnosticStatus.OK,
            "supervision",
            out.reason or "running",
            stamp_ns=stamp_ns,
        )


def main() -> None:
    """Run the protection of a train on its own."""
    run_node(AtpNode)


if __name__ == "__main__":
    main()
