"""Automatic train protection: where it is run, and what of it can be judged."""

from __future__ import annotations

from math import inf, isnan, nan
from typing import Any, ClassVar

from rail_msgs_py.topics.train_radio import ATP_STATE, RADIO_TELEGRAMS, TRAIN_TELEGRAMS
from rail_msgs_py.topics.world import COMMAND, ODOMETER
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_testing.conformance.bench import Bench
from rail_testing.conformance.kind import FLAG, EquipmentKind, Ports, ValueRange

#: Of a position: what figures are rounded by [m].
_ROUNDED_M = 0.02


class Atp(EquipmentKind):
    """Train protection of the second of two trains."""

    name: ClassVar[str] = "atp"
    title: ClassVar[str] = "automatic train protection"
    node_kind: ClassVar[str] = "atp"
    scenario: ClassVar[dict[str, Any]] = {
        "name": "atp_conformance",
        "seed": 5,
        "duration_s": 300.0,
        "tick_s": 0.5,
        "tracks": {
            "main": {
                "elements": [{"straight_m": 3000}],
                "gradients": [[0, 0], [800, -8], [1500, 5]],
                "speed_limits": [[0, 80], [1200, 60]],
                "stops_m": [2700],
            }
        },
        "stations": {"zone_length_m": 350.0},
        "cbtc": {"base_spacing_m": 1500},
        "trains": [
            {"name": "first", "route": ["main"], "start_m": 600},
            {"name": "second", "route": ["main"], "start_m": 200},
        ],
    }
    ranges: ClassVar[dict[str, dict[str, ValueRange]]] = {
        COMMAND.pattern: {
            "permitted_mps": ValueRange(0.0, 200.0, unknown=(inf,)),
            "warning": FLAG,
            "service_brake": FLAG,
            "emergency_brake": FLAG,
            "traction_cut_off": FLAG,
            "on_sight": FLAG,
        },
        ATP_STATE.pattern: {
            "accepted": ValueRange(0.0),
            "lost": ValueRange(0.0),
            "rejected": ValueRange(0.0),
            "front_m": ValueRange(-1e6, 1e6, unknown=(nan,)),
            "uncertainty_m": ValueRange(0.0, 1e6, unknown=(inf,)),
            "end_of_authority_m": ValueRange(-1e6, 1e6, unknown=(nan,)),
            "authority_age_s": ValueRange(0.0, 1e6, unknown=(inf,)),
        },
    }

    def ports(self, bench: Bench) -> Ports:
        """Topics of its train."""
        train = bench.place
        command = COMMAND.name(train=train, supervision=bench.node.rpartition("/")[2])
        return Ports(
            {ODOMETER.name(train=train): ODOMETER},
            {RADIO_TELEGRAMS.name(train=train): RADIO_TELEGRAMS},
            {
                command: COMMAND,
                TRAIN_TELEGRAMS.name(train=train): TRAIN_TELEGRAMS,
                ATP_STATE.name(train=train): ATP_STATE,
            },
        )

    def peers(self, bench: Bench) -> tuple[str, ...]:
        """The radio of its train."""
        return (f"/{bench.place}/cbtc_radio",)

    def command(self, bench: Bench) -> Any:
        """Its newest command."""
        supervision = bench.node.rpartition("/")[2]
        return bench.output(COMMAND, train=bench.place, supervision=supervision).latest

    def state(self, bench: Bench) -> Any:
        """Its newest state."""
        return bench.output(ATP_STATE, train=bench.place).latest

    def brakes(self, bench: Bench) -> bool:
        """Whether it demands a brake."""
        command = self.command(bench)
        return bool(command.service_brake or command.emergency_brake)

    def working(self, bench: Bench) -> bool:
        """It knows where it is, and lets the train run."""
        return not isnan(self.state(bench).front_m) and not self.brakes(bench)

    def false_claim(self, bench: Bench) -> str:
        """Its position, against where the train is."""
        state, front_m = self.state(bench), bench.corridor.truth(bench.place).front_m
        if isnan(state.front_m):
            return ""
        off_m = abs(float(state.front_m) - front_m)
        if off_m <= float(state.uncertainty_m) + _ROUNDED_M:
            return ""
        return (
            f"believes its front at {state.front_m:.1f} m ± {state.uncertainty_m:.1f} m; "
            f"it is at {front_m:.1f} m, {off_m:.1f} m off"
        )

    def knows_too_much(self, bench: Bench) -> str:
        """A position that it was told at the start of the run, an authority of before, no brake."""
        state = self.state(bench)
        if not isnan(state.front_m):
            start_m = float(self.parameter(bench, "start_m"))
            where = f" (its start was {start_m:.1f} m)" if not isnan(start_m) else ""
            return (
                f"knows its position, {state.front_m:.1f} m{where}, in the first tick after a "
                "restart, before anything could tell it"
            )
        if not isnan(state.end_of_authority_m):
            return "has an authority of before its restart"
        return "" if self.brakes(bench) else "does not demand a brake after its restart"

    @staticmethod
    def parameter(bench: Bench, name: str) -> float:
        """A parameter of the one under test, NaN if it has none of that name."""
        return float(bench.parameters.get(name, nan))

    def not_silent(self, bench: Bench) -> str:
        """It must demand the emergency brake, and tell nobody anything."""
        if not self.command(bench).emergency_brake:
            return "is switched off and does not demand the emergency brake"
        sent: Telegrams = bench.output(TRAIN_TELEGRAMS, train=bench.place).latest
        return "is switched off and sends telegrams" if sent.frames else ""

    def believes_garbage(self, bench: Bench) -> str:
        """Without a telegram that it can read for so long it must brake."""
        if self.brakes(bench):
            return ""
        return "demands no brake, though it has heard nothing of use for longer than its time-out"


KIND = Atp()
