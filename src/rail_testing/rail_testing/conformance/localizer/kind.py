"""Localizer: where it is run, and what of it can be judged."""

from __future__ import annotations

from math import inf, isnan, nan
from typing import Any, ClassVar

from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_POSITION, LOCALIZER_STATE, RELAYED_RANGE
from rail_msgs_py.topics.world import ODOMETER
from rail_testing.conformance.bench import Bench
from rail_testing.conformance.kind import FLAG, EquipmentKind, Ports, ValueRange

#: What figures are rounded by [m], [m/s].
_ROUNDED = 1e-6


class LocalizerKind(EquipmentKind):
    """Localizer of the second of two trains, with ranges by radio and Doppler fixes."""

    name: ClassVar[str] = "localizer"
    title: ClassVar[str] = "localizer"
    node_kind: ClassVar[str] = "localizer"
    scenario: ClassVar[dict[str, Any]] = {
        "name": "localizer_conformance",
        "seed": 5,
        "duration_s": 300.0,
        "tick_s": 0.5,
        "tracks": {
            "main": {
                "elements": [{"straight_m": 3000}],
                "speed_limits": [[0, 80], [1200, 60]],
                "stops_m": [2700],
            }
        },
        "stations": {"zone_length_m": 350.0},
        "cbtc": {"base_spacing_m": 1500},
        "references": {"spacing_m": 500},
        "localizer": {},
        "trains": [
            {"name": "first", "route": ["main"], "start_m": 600},
            {"name": "second", "route": ["main"], "start_m": 200},
        ],
    }
    ranges: ClassVar[dict[str, dict[str, ValueRange]]] = {
        LOCALIZER_STATE.pattern: {
            "status": ValueRange(values=(0.0, 1.0, 2.0)),
            "reason": ValueRange(0.0, 100.0),
            "found": FLAG,
            "excluded": ValueRange(0.0, 255.0),
            "front_m": ValueRange(-1e6, 1e6, unknown=(nan,)),
            "low_m": ValueRange(-1e6, 1e6, unknown=(-inf,)),
            "high_m": ValueRange(-1e6, 1e6, unknown=(inf,)),
            "speed_mps": ValueRange(-200.0, 200.0, unknown=(nan,)),
            "speed_low_mps": ValueRange(-1e3, 1e3, unknown=(-inf,)),
            "speed_high_mps": ValueRange(-1e3, 1e3, unknown=(inf,)),
            "sigma_m": ValueRange(0.0, 1e6, unknown=(inf,)),
        }
    }

    def ports(self, bench: Bench) -> Ports:
        """Topics of its train."""
        train = bench.place
        inputs = {}
        if bench.parameters.get("told"):
            inputs[RELAYED_RANGE.name(train=train)] = RELAYED_RANGE
        if bench.parameters.get("doppler"):
            inputs[DOPPLER_FIX.name(train=train)] = DOPPLER_FIX
        outputs = {
            LOCALIZER_STATE.name(train=train): LOCALIZER_STATE,
            LOCALIZER_POSITION.name(train=train): LOCALIZER_POSITION,
        }
        return Ports({ODOMETER.name(train=train): ODOMETER}, inputs, outputs)

    def peers(self, bench: Bench) -> tuple[str, ...]:
        """Its Doppler positioner."""
        return (f"/{bench.place}/doppler",) if bench.parameters.get("doppler") else ()

    def state(self, bench: Bench) -> Any:
        """Its newest state."""
        return bench.output(LOCALIZER_STATE, train=bench.place).latest

    def working(self, bench: Bench) -> bool:
        """It has a position that it stands for."""
        return bool(self.state(bench).status >= 1.0)

    def false_claim(self, bench: Bench) -> str:
        """Intervals that do not hold what they should."""
        state, truth = self.state(bench), bench.corridor.truth(bench.place)
        if not self.working(bench):
            known = not isnan(state.front_m) or state.high_m < inf
            return "is unavailable, and yet gives a position" if known else ""
        words = ""
        if not state.low_m - _ROUNDED <= truth.front_m <= state.high_m + _ROUNDED:
            words = (
                f"the front is at {truth.front_m:.2f} m, outside of the interval from "
                f"{state.low_m:.2f} to {state.high_m:.2f} m that it claims"
            )
        speed_mps = truth.speed_mps
        low_mps, high_mps = state.speed_low_mps, state.speed_high_mps
        if not low_mps - _ROUNDED <= speed_mps <= high_mps + _ROUNDED:
            words = words or (
                f"the speed is {speed_mps:.2f} m/s, outside of the interval from {low_mps:.2f} "
                f"to {high_mps:.2f} m/s that it claims"
            )
        return words

    def not_silent(self, bench: Bench) -> str:
        """It must know nothing."""
        return "is switched off and claims a position" if self.working(bench) else ""

    def believes_garbage(self, bench: Bench) -> str:
        """What it still claims must hold; that is judged in every tick."""
        return ""


KIND = LocalizerKind()
