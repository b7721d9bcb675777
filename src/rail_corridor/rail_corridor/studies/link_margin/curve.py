"""The curve of theory: brakings an hour over the level of the train radio."""

from __future__ import annotations

import numpy as np

from rail_corridor.equipment.train_radio.nodes import burst_format
from rail_corridor.equipment.train_radio.section import CBTC
from rail_corridor.loading.schema import parse_scenario
from rail_signals.arrays import FloatArray

from .runs import STRETCH_FROM, TICK_S, LinkMarginParameters, scenario_data
from .theory import brakings_per_hour, line_es_n0_db

_LEVELS_DB = np.arange(4.0, 34.1, 0.5)


def rate_curve(scheme: str) -> tuple[FloatArray, FloatArray]:
    """Median Es/N0 [dB] and brakings per hour that theory gives on the line of the study."""
    scenario = parse_scenario(scenario_data(LinkMarginParameters(scheme=scheme)))
    plan = CBTC.of(scenario)
    assert plan is not None
    line_db = line_es_n0_db(scenario, STRETCH_FROM)
    line_db = line_db - np.median(line_db)
    losses = int(plan.timeout_s / TICK_S + 1e-9)
    rates = [
        brakings_per_hour(plan.scheme, line_db + level, burst_format(plan), losses, TICK_S)
        for level in _LEVELS_DB
    ]
    return _LEVELS_DB, np.array(rates)
