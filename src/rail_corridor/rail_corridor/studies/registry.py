"""The generators and calculations that a study file may name, and the studies that come along."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Final

from rail_corridor.study.sources import CalculationSource, GeneratorSource

from .handover import HandoverParameters, draw_handover
from .integrity import IntegrityParameters, count_integrity
from .kills import KillParameters, draw_kill, look_at_kill
from .link_margin.runs import LinkMarginParameters, draw_link_margin, look_at_link_margin
from .localizer_pace import PaceParameters, compare_pace
from .safety.judgement import judge_safety
from .safety.scenario import SafetyParameters, draw_safety
from .threats import ThreatParameters, count_threats
from .track_code_errors import TrackCodeErrorParameters, count_track_code_errors
from .track_code_runs import TrackCodeRunParameters, draw_track_codes, look_at_track_codes
from .train_bus import (
    TrainBusLimitParameters,
    TrainBusParameters,
    examine_train_bus,
    find_detectable_size,
)

#: Studies that come with the corridor.
FOLDER: Final = Path(str(resources.files("rail_corridor.studies"))) / "builtin"

GENERATORS: Final[Mapping[str, GeneratorSource]] = {
    "handover": GeneratorSource(HandoverParameters, draw_handover),
    "kills": GeneratorSource(KillParameters, draw_kill, look_at_kill, judge_safety),
    "link_margin": GeneratorSource(LinkMarginParameters, draw_link_margin, look_at_link_margin),
    "track_code_runs": GeneratorSource(
        TrackCodeRunParameters, draw_track_codes, look_at_track_codes
    ),
    "safety": GeneratorSource(SafetyParameters, draw_safety, judge=judge_safety),
}
CALCULATIONS: Final[Mapping[str, CalculationSource]] = {
    "integrity": CalculationSource(IntegrityParameters, count_integrity),
    "localizer_pace": CalculationSource(PaceParameters, compare_pace),
    "threats": CalculationSource(ThreatParameters, count_threats),
    "track_code_errors": CalculationSource(TrackCodeErrorParameters, count_track_code_errors),
    "train_bus": CalculationSource(TrainBusParameters, examine_train_bus),
    "train_bus_limits": CalculationSource(TrainBusLimitParameters, find_detectable_size),
}
