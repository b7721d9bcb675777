"""Faults of a train bus, counted: found, located and named; and how small one can be to be found.

Trains, places and faults are those of `rail_signals.train_bus.study`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from pydantic import Field, field_validator

from rail_corridor.study.strict import Strict, one_of
from rail_signals.train_bus.faults import KINDS
from rail_signals.train_bus.study.campaign import HEALTHY, draw_case, examine
from rail_signals.train_bus.study.detection_limits import detectable_size, fault_of_size

#: What a train can have, and what can be reported of it.
CONDITIONS: Final = (*KINDS, HEALTHY)
#: What trains are drawn from beside their number: others for every use.
_EXAMINED: Final = (2, 0)
_LIMITS: Final = (1, 100)
_CHECKED: Final = (1, 200)
_EVEN: Final = 0.5

#: Unit of the size of a fault: its resistance [ohm]; the capacitance of 5 m, or the impedance of
#: a run, off by so much [%].
SIZES: Final[Mapping[str, Literal["ohm", "%"]]] = MappingProxyType(
    {"bad_splice": "ohm", "loose_connector": "ohm", "water_ingress": "%", "wrong_cable": "%"}
)


class TrainBusParameters(Strict):
    """Trains whose bus has one fault of a kind, or none."""

    fault: str = Field(HEALTHY, description="kind of the fault, or healthy")
    snr_db: float = Field(60.0, ge=0.0, le=120.0, description="signal to noise of one trace")
    trains: int = Field(1, ge=1, le=10_000, description="one after the other in one run")

    @field_validator("fault")
    @classmethod
    def _is_one(cls, value: str) -> str:
        return one_of(CONDITIONS, value, "fault")


class TrainBusLimitParameters(Strict):
    """A kind of fault whose size is looked for at which it has an even chance to be found."""

    kind: Literal["bad_splice", "loose_connector", "water_ingress", "wrong_cable"] = "bad_splice"
    snr_db: float = Field(60.0, ge=0.0, le=120.0, description="signal to noise of one trace")
    of_size: float | None = Field(
        None, gt=0.0, le=10_000.0, description="of a fault that is to be found, ohm or %"
    )


def examine_train_bus(parameters: TrainBusParameters, seed: int) -> Mapping[str, float]:
    """Trains in which a fault is found, located and named rightly, and what is reported.

    Parameters
    ----------
    parameters : TrainBusParameters
    seed : int

    Returns
    -------
    mapping
        Trains ``examined``, of these ``faulty`` ones and of those the ones whose fault was
        ``found``, ``located`` and ``named`` rightly; ``healthy`` ones and the ``flagged`` of
        those; and under ``reported_open`` and so on those of which this was reported.
    """
    fault, trains = parameters.fault, parameters.trains
    kinds = "faulty", "found", "located", "named", "healthy", "flagged"
    counts = dict.fromkeys(("examined", *kinds, *(f"reported_{each}" for each in CONDITIONS)), 0)
    for number in range(seed * trains, (seed + 1) * trains):
        rng = _rng_of(_EXAMINED, CONDITIONS.index(fault), number)
        result = examine(draw_case(fault, rng, parameters.snr_db), rng)
        is_reported = result.reported != HEALTHY
        counts["examined"] += 1
        counts[f"reported_{result.reported}"] += 1
        if fault == HEALTHY:
            counts["healthy"] += 1
            counts["flagged"] += is_reported
        else:
            counts["faulty"] += 1
            counts["found"] += is_reported
            counts["located"] += result.is_located
            counts["named"] += result.reported == fault
    return counts


def find_detectable_size(
    parameters: TrainBusLimitParameters, seed: int
) -> Mapping[str, float | None]:
    """Size of a fault with an even chance to be found, somewhere in a random train.

    Parameters
    ----------
    parameters : TrainBusLimitParameters
    seed : int

    Returns
    -------
    mapping
        ``size``, by theory, in the unit of `SIZES`; ``found``, whether an interpretation finds a
        fault of the size asked for in another train, None if none is.
    """
    kind, number = parameters.kind, list(SIZES).index(parameters.kind)
    scale = 0.01 if SIZES[kind] == "%" else 1.0
    rng = _rng_of(_LIMITS, number, seed)
    size = detectable_size(draw_case(kind, rng, parameters.snr_db), rng, _EVEN) / scale
    if parameters.of_size is None:
        return {"size": size, "found": None}
    rng = _rng_of(_CHECKED, number, seed)
    case = draw_case(kind, rng, parameters.snr_db)
    case = replace(case, fault=fault_of_size(case, scale * parameters.of_size, rng))
    return {"size": size, "found": examine(case, rng).reported != HEALTHY}


def _rng_of(use: tuple[int, int], kind: int, number: int) -> np.random.Generator:
    series, first = use
    return np.random.default_rng([series, first + kind, number])
