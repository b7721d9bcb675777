"""Integrity of the localizer, counted: trains on a simulated line, one sensor of each faulty.

The fault begins after 5 to 40 s and lasts. Of the positions that are claimed to survive a fault
of that sensor, those are counted that were misleading; and of the readings that were off by much,
how long they went on until the fault was found. Positions of one train are not independent: the
trains that were misled are counted as well.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from pydantic import Field, field_validator

from rail_corridor.study.strict import Strict, one_of
from rail_signals.arrays import FloatArray
from rail_signals.localizer.settings import LocalizerSettings, Sensor
from rail_signals.localizer.study.campaign import stated_s, tally
from rail_signals.localizer.study.faults import CASES, FaultKind
from rail_signals.localizer.study.worlds import AS_BELIEVED, WORLDS

NO_FAULT: Final = "none"

#: Faults of the localizer's sensors by name, as ``range bias``; None: without any.
FAULTS: Final[Mapping[str, tuple[Sensor, FaultKind] | None]] = MappingProxyType(
    {
        NO_FAULT: None,
        **{f"{sensor.name.lower()} {kind.value}": (sensor, kind) for sensor, kind in CASES},
    }
)


class IntegrityParameters(Strict):
    """Trains on a simulated line, each with one fault of one sensor."""

    fault: str = Field(NO_FAULT, description="sensor and kind, as range bias, or none")
    world: str = Field(AS_BELIEVED, description="how the sensors err without a fault")
    trains: int = Field(100, ge=1, le=10_000, description="side by side in one run")
    ticks: int = Field(1500, ge=500, le=100_000, description="of 0.1 s, for every train")

    @field_validator("fault")
    @classmethod
    def _is_a_fault(cls, value: str) -> str:
        return one_of(FAULTS, value, "fault")

    @field_validator("world")
    @classmethod
    def _is_a_world(cls, value: str) -> str:
        return one_of(WORLDS, value, "world")


def count_integrity(parameters: IntegrityParameters, seed: int) -> Mapping[str, float | None]:
    """Positions that were claimed and misleading, and delays until a fault was found.

    Parameters
    ----------
    parameters : IntegrityParameters
    seed : int

    Returns
    -------
    mapping
        As `rail_signals.localizer.study.campaign.Tally` counts; the quantiles of the delay None
        where it is not known or has no end.
    """
    number = list(FAULTS).index(parameters.fault)
    sensor, kind = FAULTS[parameters.fault] or (None, None)
    counted = tally(
        LocalizerSettings(direction=1 - 2 * (number % 2)),
        WORLDS[parameters.world],
        sensor,
        kind,
        runs=parameters.trains,
        ticks=parameters.ticks,
        rng=np.random.default_rng([seed, number]),
    )
    levels_m, errors_m = counted.protection_m, counted.error_m
    return {
        "positions": counted.positions,
        "claimed": counted.claimed,
        "protected": counted.protected,
        "misleading": counted.misleading,
        "misleading_trains": counted.misleading_runs,
        "misleading_speeds": counted.misleading_speeds,
        "false_alarms": counted.false_alarms,
        "wrong_exclusions": counted.wrong_exclusions,
        "healthy_h": counted.healthy_s / 3600.0,
        "due": counted.due,
        "late": counted.late,
        "excluded": counted.excluded,
        "delay_p50_s": _not_exceeded_by(counted.delays_s, 0.5),
        "delay_p95_s": _not_exceeded_by(counted.delays_s, 0.95),
        "delay_max_s": _not_exceeded_by(counted.delays_s, 1.0),
        "stated_s": None if sensor is None or kind is None else stated_s(sensor, kind),
        "protection_mean_m": float(levels_m.mean()) if levels_m.size else None,
        "protection_p95_m": float(np.percentile(levels_m, 95)) if levels_m.size else None,
        "rmse_m": float(np.sqrt(np.mean(errors_m**2))) if errors_m.size else None,
    }


def _not_exceeded_by(delays_s: FloatArray, share: float) -> float | None:
    """The delay that so many do not exceed; None where there is none, or it has no end."""
    if not delays_s.size:
        return None
    found = float(np.sort(delays_s)[math.ceil(share * delays_s.size) - 1])
    return found if math.isfinite(found) else None
