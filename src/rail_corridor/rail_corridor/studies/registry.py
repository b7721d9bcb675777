"""The generators and calculations that a study file may name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator

from rail_corridor.study.sources import CalculationSource, Drawn, GeneratorSource
from rail_signals.localizer.settings import LocalizerSettings, Sensor
from rail_signals.localizer.study.campaign import tally
from rail_signals.localizer.study.faults import CASES, FaultKind
from rail_signals.localizer.study.simulation import SimulatedLine
from rail_signals.train_bus.faults import KINDS
from rail_signals.train_bus.study.campaign import HEALTHY, examine
from rail_signals.train_bus.study.campaign import draw_case as draw_bus_case
from rail_world.train_radio.frame_threats import Threat

from .handover_scenarios import MOST_TRAINS, Situation, scenario_data
from .kill_scenarios import draw_case
from .threats import run_threat_campaign

#: Studies that come with the corridor.
FOLDER: Final = Path(str(resources.files("rail_corridor.studies"))) / "builtin"


class _Parameters(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class KillParameters(_Parameters):
    """None: everything is drawn from the seed."""


class HandoverParameters(_Parameters):
    """A situation of `handover_scenarios`."""

    corridor: Literal["plain", "branching"] = "plain"
    manoeuvre: Literal["running", "standing", "reversing"] = "running"
    speed_kmh: float = Field(80.0, ge=10.0, le=500.0)
    trains: int = Field(4, ge=1, le=10)


class ThreatParameters(_Parameters):
    """Frames under a threat."""

    threat: Literal["all"] | Threat = "all"
    frames: int = Field(10_000, ge=1, le=100_000_000)


def draw_kill(_: KillParameters, seed: int) -> Drawn:
    """A scenario in which one piece of equipment dies; see `kill_scenarios`."""
    case = draw_case(seed)
    facts = {
        "kind": case.kind,
        "node": case.kill.node,
        "killed_s": case.kill.time_s,
        "loss_db": case.data["cbtc"]["extra_loss_db"],
        "train_stop": "faults" in case.data,
    }
    return Drawn(case.data, (case.kill,), facts)


def draw_handover(parameters: HandoverParameters, seed: int) -> Drawn:
    """A scenario of the handover campaign; see `handover_scenarios`."""
    situation = Situation(parameters.corridor, parameters.manoeuvre, parameters.speed_kmh)
    trains = min(parameters.trains, MOST_TRAINS[parameters.manoeuvre])
    return Drawn(scenario_data(situation, trains, seed))


def count_threats(parameters: ThreatParameters, seed: int) -> Mapping[str, float]:
    """Frames of the safe channel under attack; see `threats`."""
    group = list(Threat) if parameters.threat == "all" else [parameters.threat]
    (row,) = run_threat_campaign(parameters.frames, [group], seed)
    return {
        "frames": row.frames,
        "restarts": row.restarts,
        "attacks": row.attacks,
        "arrived": row.arrived,
        "rejected": sum(row.rejected.values()),
        "accepted": row.accepted,
        "wrongly_accepted": sum(row.wrongly_accepted.values()),
    }


class IntegrityParameters(_Parameters):
    """Trains on a simulated line, each with one fault of one sensor."""

    fault: str = "none"
    trains: int = Field(100, ge=1, le=10_000)
    ticks: int = Field(1500, ge=500, le=100_000)

    @field_validator("fault")
    @classmethod
    def _is_one(cls, value: str) -> str:
        if value not in INTEGRITY_FAULTS:
            raise ValueError(f"must be one of {', '.join(INTEGRITY_FAULTS)}")
        return value


class TrainBusParameters(_Parameters):
    """A train bus with one fault, or none."""

    fault: str = HEALTHY
    snr_db: float = Field(60.0, ge=0.0, le=120.0)

    @field_validator("fault")
    @classmethod
    def _is_one(cls, value: str) -> str:
        if value not in (*KINDS, HEALTHY):
            raise ValueError(f"must be one of {', '.join((*KINDS, HEALTHY))}")
        return value


#: Faults of the localizer's sensors by name, as ``range bias``; None: without any.
INTEGRITY_FAULTS: Final[Mapping[str, tuple[Sensor, FaultKind] | None]] = {
    "none": None,
    **{f"{sensor.name.lower()} {kind.value}": (sensor, kind) for sensor, kind in CASES},
}


def count_integrity(parameters: IntegrityParameters, seed: int) -> Mapping[str, float | None]:
    """Positions that were claimed, and misleading; see `rail_signals.localizer.study.campaign`."""
    number = list(INTEGRITY_FAULTS).index(parameters.fault)
    sensor, kind = INTEGRITY_FAULTS[parameters.fault] or (None, None)
    counted = tally(
        LocalizerSettings(direction=1 - 2 * (number % 2)),
        SimulatedLine(),
        sensor,
        kind,
        runs=parameters.trains,
        ticks=parameters.ticks,
        rng=np.random.default_rng([seed, number]),
    )
    return {
        "positions": counted.positions,
        "claimed": counted.claimed,
        "protected": counted.protected,
        "misleading": counted.misleading,
        "misleading_trains": counted.misleading_runs,
        "misleading_speeds": counted.misleading_speeds,
        "false_alarms": counted.false_alarms,
        "wrong_exclusions": counted.wrong_exclusions,
        "due": counted.due,
        "late": counted.late,
        "delay_p95_s": _highest(counted.delays_s, 0.95),
        "protection_mean_m": float(counted.protection_m.mean()),
        "rmse_m": float(np.sqrt(np.mean(counted.error_m**2))),
    }


def _highest(values: np.ndarray, share: float) -> float | None:
    """The value that so many are not above."""
    ordered = np.sort(values)
    return float(ordered[math.ceil(share * ordered.size) - 1]) if ordered.size else None


def examine_train_bus(parameters: TrainBusParameters, seed: int) -> Mapping[str, float | None]:
    """Whether a fault is found; see `rail_signals.train_bus.study.campaign`."""
    number = (*KINDS, HEALTHY).index(parameters.fault)
    rng = np.random.default_rng([seed, number])
    case = draw_bus_case(parameters.fault, rng, parameters.snr_db)
    result = examine(case, rng)
    healthy = parameters.fault == HEALTHY
    return {
        "found": result.reported != HEALTHY,
        "located": None if healthy else bool(result.is_located),
        "named": result.reported == parameters.fault,
    }


GENERATORS: Final[Mapping[str, GeneratorSource]] = {
    "kills": GeneratorSource(KillParameters, draw_kill),
    "handover": GeneratorSource(HandoverParameters, draw_handover),
}
CALCULATIONS: Final[Mapping[str, CalculationSource]] = {
    "threats": CalculationSource(ThreatParameters, count_threats),
    "integrity": CalculationSource(IntegrityParameters, count_integrity),
    "train_bus": CalculationSource(TrainBusParameters, examine_train_bus),
}
