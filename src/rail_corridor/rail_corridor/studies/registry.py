"""The generators and calculations that a study file may name."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from rail_corridor.study.sources import CalculationSource, Drawn, GeneratorSource
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


GENERATORS: Final[Mapping[str, GeneratorSource]] = {
    "kills": GeneratorSource(KillParameters, draw_kill),
    "handover": GeneratorSource(HandoverParameters, draw_handover),
}
CALCULATIONS: Final[Mapping[str, CalculationSource]] = {
    "threats": CalculationSource(ThreatParameters, count_threats),
}
