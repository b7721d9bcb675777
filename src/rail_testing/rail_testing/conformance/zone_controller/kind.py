"""Zone controller: where it is run, and what of it can be judged."""

from __future__ import annotations

from itertools import pairwise
from math import inf, isfinite, isnan, nan, sqrt
from typing import Any, ClassVar

from rail_msgs_py.topics.ranging import POSITION, RANGE
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.train_radio import (
    AUTHORITY,
    BACKBONE_UP,
    DOWN_TELEGRAMS,
    REPORTS,
    UP_TELEGRAMS,
)
from rail_testing.conformance.bench import Bench
from rail_testing.conformance.kind import EquipmentKind, Ports, ValueRange

_SIGMAS, _ROUNDED_M = 6.0, 0.1


class ZoneController(EquipmentKind):
    """Zone controller of a line with three trains."""

    name: ClassVar[str] = "zone_controller"
    title: ClassVar[str] = "zone controller"
    node_kind: ClassVar[str] = "zone_controller"
    scenario: ClassVar[dict[str, Any]] = {
        "name": "zone_controller_conformance",
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
            {"name": "first", "route": ["main"], "start_m": 900},
            {"name": "second", "route": ["main"], "start_m": 550},
            {"name": "third", "route": ["main"], "start_m": 200},
        ],
    }
    ranges: ClassVar[dict[str, dict[str, ValueRange]]] = {
        AUTHORITY.pattern: {
            "end_of_authority_m": ValueRange(-1e6, 1e6, unknown=(nan,)),
            "limit_mps": ValueRange(0.0, 200.0, unknown=(nan,)),
            "worst_rear_m": ValueRange(-1e6, 1e6, unknown=(nan,)),
            "report_age_s": ValueRange(0.0, 1e6, unknown=(inf,)),
            "accepted": ValueRange(0.0),
            "lost": ValueRange(0.0),
            "rejected": ValueRange(0.0),
        },
        REPORTS.pattern: {
            "sealed_s": ValueRange(0.0),
            "speed_mps": ValueRange(0.0, 200.0),
            "uncertainty_m": ValueRange(0.0, 1e6, unknown=(inf,)),
        },
    }
    notices_within_s: ClassVar[float] = 6.0

    def ports(self, bench: Bench) -> Ports:
        """Ranges of all zones and telegrams of all base stations; positions and authorities."""
        p = bench.parameters
        inputs = {
            RANGE.name(site=site, zone=zone): RANGE
            for site, zone in zip(p["sites"], p["zones"], strict=True)
        }
        outputs = {POSITION.name(train=train): POSITION for train in p["trains"]}
        outputs[DONE.name(node=bench.node)] = DONE
        if self.bases(bench):
            up = BACKBONE_UP if p.get("backbone") else UP_TELEGRAMS
            inputs |= {up.name(base=base): up for base in self.bases(bench)}
            outputs |= {DOWN_TELEGRAMS.name(base=base): DOWN_TELEGRAMS for base in p["bases"]}
            for train in p["trains"]:
                outputs[AUTHORITY.name(train=train)] = AUTHORITY
                outputs[REPORTS.name(train=train)] = REPORTS
        return Ports({CLOCK.name(): CLOCK}, inputs, outputs)

    @staticmethod
    def bases(bench: Bench) -> tuple[str, ...]:
        """Its base stations."""
        return tuple(bench.parameters.get("bases", ()))

    def peers(self, bench: Bench) -> tuple[str, ...]:
        """A station of phase ranging, that of the last train's zone."""
        return (f"/wayside/{bench.parameters['sites'][0]}",)

    def authority(self, bench: Bench, train: str) -> Any:
        """The newest authority of a train."""
        return bench.output(AUTHORITY, train=train).latest

    def trains(self, bench: Bench) -> list[str]:
        """Trains on the line, the foremost first."""
        truth = {name: bench.corridor.truth(name) for name in bench.parameters["trains"]}
        on_line = [name for name, each in truth.items() if each.on_line]
        return sorted(on_line, key=lambda name: -truth[name].front_m)

    def working(self, bench: Bench) -> bool:
        """Every train on the line has an authority that was renewed lately."""
        if not self.bases(bench):
            names = bench.parameters["trains"]
            return all(bench.output(POSITION, train=name).latest.known for name in names)
        states = [self.authority(bench, train) for train in self.trains(bench)]
        return all(isfinite(s.end_of_authority_m) and s.report_age_s < 3.0 for s in states)

    def rear_m(self, bench: Bench, train: str) -> float:
        """Where the rear of a train truly is [m]."""
        corridor = bench.corridor
        lengths = {each.name: each.vehicle.length_m for each in corridor.planned.world.trains}
        return float(corridor.truth(train).front_m - lengths[train])

    def false_claim(self, bench: Bench) -> str:
        """An authority into another train, or a position that is not so."""
        for train in bench.parameters["trains"]:
            position = bench.output(POSITION, train=train).latest
            if not position.known:
                continue
            front_m = bench.corridor.truth(train).front_m
            off_m, sigma_m = abs(position.chainage_m - front_m), sqrt(position.variance_m2)
            if off_m > _SIGMAS * sigma_m + 1.0:
                return (
                    f"ranges {train} at {position.chainage_m:.1f} m with a deviation of "
                    f"{sigma_m:.2f} m; it is at {front_m:.1f} m"
                )
        return self.shared_stretch(bench) if self.bases(bench) else ""

    def shared_stretch(self, bench: Bench) -> str:
        """What two trains may both run into."""
        for ahead, behind in pairwise(self.trains(bench)):
            end_m = self.authority(bench, behind).end_of_authority_m
            rear_m = self.rear_m(bench, ahead)
            if isnan(end_m) or end_m <= rear_m + _ROUNDED_M:
                continue
            return (
                f"the authority of {behind} ends at {end_m:.1f} m, {end_m - rear_m:.1f} m beyond "
                f"the rear of {ahead} at {rear_m:.1f} m: two trains may be on the same stretch"
            )
        return ""

    def knows_too_much(self, bench: Bench) -> str:
        """Before a report came there is nothing to give an authority for."""
        for train in bench.parameters["trains"] if self.bases(bench) else ():
            end_m = self.authority(bench, train).end_of_authority_m
            if not isnan(end_m):
                return (
                    f"gives {train} an authority to {end_m:.1f} m in its first tick after a restart"
                )
        return ""

    def not_silent(self, bench: Bench) -> str:
        """It must know no train and give no authority."""
        for train in bench.parameters["trains"]:
            if bench.output(POSITION, train=train).latest.known:
                return f"is switched off and knows where {train} is"
            if self.bases(bench) and not isnan(self.authority(bench, train).end_of_authority_m):
                return f"is switched off and gives {train} an authority"
        return ""


KIND = ZoneController()
