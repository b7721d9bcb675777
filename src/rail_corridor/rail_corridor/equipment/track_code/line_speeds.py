"""The 16 speeds that the codes of a line can tell, and those that its blocks allow.

Going back from a place to stand, the code of each block may allow one more step of the table, and
no more than the block takes back (`rail_wayside.track_code.code_logic`). The reaction before that
eats part of each block, so that the speed of short blocks has a bound, however many are free. The
usual table serves most lines. Where a limit is not in it, or its steps are too high for the
blocks, the line has a table of its own: its limits, and steps that its blocks can take.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf
from typing import Final

from rail_corridor.scenario.model import Scenario
from rail_signals.track_code.scales import (
    LEAST_BRAKING_MPS2,
    SPEEDS_KMH,
    CodeScales,
    deceleration_mps2,
)
from rail_wayside.track_code.code_logic import Block, CodeLogic, entry_limit_mps

from .placement import Circuit, circuits_of
from .section import TRACK_CIRCUITS

_TABLE: Final = len(SPEEDS_KMH)
#: Free blocks in a row, more than any code needs to rise to its bound.
_ROW: Final = 40
_STEP_KMH: Final = 5.0
#: As `CodeLogic` has them.
_REACTION_S: Final = 4.5
_OVERSPEED_MPS: Final = 1.7


def allowed_kmh(
    circuits: Iterable[Circuit], braking_mps2: float, speeds_kmh: tuple[float, ...]
) -> dict[str, float]:
    """Speed that codes allow in each circuit if all ahead are like it, and free, by name [km/h]."""
    scales = CodeScales(speeds_kmh=speeds_kmh)
    found: dict[tuple[float, float, float], float] = {}
    allowed = {}
    for circuit in circuits:
        kind = _kind(circuit)
        if kind not in found:
            logic = CodeLogic([Block(*kind)] * _ROW, braking_mps2=braking_mps2, scales=scales)
            speed = logic.fields([False] * (_ROW - 1))["speed"]
            found[kind] = speeds_kmh[speed >> 4]
        allowed[circuit.name] = found[kind]
    return allowed


def holds_trains(circuit: Circuit, braking_mps2: float) -> bool:
    """Whether the braking that codes count on is more than the fall of a circuit takes."""
    step_permil = CodeScales().gradient_step_permil
    coded = step_permil * (circuit.gradient_permil // step_permil)
    return deceleration_mps2(braking_mps2, coded) >= LEAST_BRAKING_MPS2


def speeds_of(scenario: Scenario) -> tuple[float, ...]:
    """The table of a scenario [km/h]; the usual one without track circuits."""
    return scenario.derive(_speeds)


def _speeds(scenario: Scenario) -> tuple[float, ...]:
    plan = TRACK_CIRCUITS.of(scenario)
    return SPEEDS_KMH if plan is None else line_speeds(circuits_of(scenario), plan.braking_mps2)


def line_speeds(circuits: Sequence[Circuit], braking_mps2: float) -> tuple[float, ...]:
    """The table for a line [km/h], 16 rising speeds from 0.

    The falls of the circuits must be ones that can be told (`holds_trains`).
    """
    limits = sorted({round(3.6 * c.limit_mps, 6) for c in circuits if c.limit_mps > 0.0})
    own = _own_table(circuits, braking_mps2, limits)
    within = all(limit in SPEEDS_KMH or limit > SPEEDS_KMH[-1] for limit in limits)
    if within:
        usual = allowed_kmh(circuits, braking_mps2, SPEEDS_KMH)
        better = allowed_kmh(circuits, braking_mps2, own)
        if all(usual[name] >= min(better[name], SPEEDS_KMH[-1]) for name in usual):
            return SPEEDS_KMH
    return own


def _own_table(
    circuits: Sequence[Circuit], braking_mps2: float, limits: Sequence[float]
) -> tuple[float, ...]:
    for least_step_kmh in (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 40.0, inf):
        steps = _steps(circuits, braking_mps2, limits, least_step_kmh)
        if len(steps) <= _TABLE:
            break
    table = sorted(steps)[:_TABLE]
    while len(table) < _TABLE:
        table.append(_between(table))
        table.sort()
    return tuple(table)


def _steps(
    circuits: Sequence[Circuit],
    braking_mps2: float,
    limits: Sequence[float],
    least_step_kmh: float,
) -> set[float]:
    """Limits, and the steps up to them; blocks that can only take smaller ones stay below."""
    scales = CodeScales()
    steps = {0.0, *limits}
    kinds = {_kind(circuit) for circuit in circuits}
    end_kmh = 0.0
    while kinds:
        tops = {kind: _entry_kmh(kind, braking_mps2, end_kmh, scales) for kind in kinds}
        # A first step, however small, is one: trains move.
        least = end_kmh + (least_step_kmh if end_kmh else 1.0)
        kinds = {k for k, top in tops.items() if top >= min(least, 3.6 * k[1] - 1e-6)}
        if not kinds:
            break
        end_kmh = _below(min(tops[kind] for kind in kinds), end_kmh, limits)
        steps.add(end_kmh)
        kinds = {kind for kind in kinds if 3.6 * kind[1] > end_kmh + 1e-6}
    return steps


def _between(table: Sequence[float]) -> float:
    """A round speed in the widest gap of a table, past its end if there is none."""
    widest = max(range(1, len(table)), key=lambda i: table[i] - table[i - 1], default=0)
    if widest and table[widest] - table[widest - 1] > _STEP_KMH:
        middle = 0.5 * (table[widest - 1] + table[widest])
        return max(_STEP_KMH * (middle // _STEP_KMH), table[widest - 1] + 1.0)
    return table[-1] + _STEP_KMH


def _kind(circuit: Circuit) -> tuple[float, float, float]:
    """What the codes of a circuit depend on: coded length, limit, coded gradient."""
    scales = CodeScales()
    length_m = max(1.0, scales.length_step_m * scales.length_index(circuit.length_m))
    step = scales.gradient_step_permil
    gradient_permil = step * (scales.gradient_index(circuit.gradient_permil) - scales.gradient_zero)
    return length_m, circuit.limit_mps, gradient_permil


def _entry_kmh(
    kind: tuple[float, float, float], braking_mps2: float, end_kmh: float, scales: CodeScales
) -> float:
    """The most at the entrance of a block whose end allows a speed [km/h]."""
    length_m, limit_mps, gradient_permil = kind
    coded_m = scales.length_step_m * scales.length_index(length_m)
    braking = deceleration_mps2(braking_mps2, gradient_permil)
    top = entry_limit_mps(coded_m, braking, end_kmh / 3.6, _REACTION_S, _OVERSPEED_MPS)
    return 3.6 * min(top, limit_mps)


def _below(top_kmh: float, end_kmh: float, limits: Sequence[float]) -> float:
    """Largest limit or round speed up to one, above another; whole ones where there is none."""
    candidates = [limit for limit in limits if end_kmh < limit <= top_kmh + 1e-6]
    for step in (_STEP_KMH, 1.0):
        rounded = step * ((top_kmh + 1e-6) // step)
        if rounded > end_kmh:
            candidates.append(rounded)
    if not candidates:
        return top_kmh
    return max(candidates, key=lambda kmh: (kmh % _STEP_KMH == 0.0 or kmh in limits, kmh))
