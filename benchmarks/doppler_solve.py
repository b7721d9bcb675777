"""Positions per CPU-second of the Doppler solver, beside scipy.optimize on the same function.

A line of 12 km with straights, clothoids and arcs down to 400 m, stations every 600 m, 20 m off
the track, five in reach. Each row draws places, speeds from 20 to 500 km/h, offsets up to 0.5 ppm
and noise of the shifts by the link budget. All sides start from shifts and variances and must end
at the train.

The function is that of the solver: chi-square of the shifts at the best speed and offset. The
peers call it plainly: `scipy.optimize.brute` with as many points as the solver's grid has there and
its usual finish (global, as the solver is); `minimize_scalar` within 100 m of the train and
`least_squares` in chainage, speed and offset from 30 m beside it, which find one minimum and would
not see that there is another. The faster of what finds the train is the peer.

CPU time of one process is counted, in turns; the figure is the median of the rounds.
The bound is the solver's arithmetic alone, in one compiled loop: the profile of the grid and, from
the true place, one minimum. ``doppler.slowest`` is the slowest single answer over all cases, the
best of three for each draw; its bound is what it must not exceed.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rail_signals.arrays import FloatArray

# Before NumPy is loaded; harmless, and without effect, where it is loaded already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from rail_signals.compiled import compiled
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.doppler.bound import shift_variance_hz2
from rail_signals.doppler.shift_kernel import Known, cost_minimum, cost_profile
from rail_signals.doppler.solver import DopplerSolver, NoFixReason, Prior
from rail_signals.doppler.surveyed_line import SurveyedLine
from rail_signals.doppler.tone_plan import TonePlan
from rail_world.line.alignment import Alignment, Element

PLAN = TonePlan()
SPACING_M, ASIDE_M, REACH_M = 600.0, 20.0, 1500.0
#: Per sample, at the spacing.
SNR = 1e3
DRAWS = 24
ROUNDS = 7
PEER_ROUNDS = 2
WINDOW_M = 100.0


@dataclass(frozen=True)
class Draw:
    """Shifts of one block, and the truth."""

    heard: NDArray[np.int64]
    shift_hz: FloatArray
    variance_hz2: FloatArray
    offset: Prior | None
    window_m: tuple[float, float] | None
    direction: int
    chainage_m: float
    speed_mps: float


@dataclass(frozen=True)
class Case:
    """What a positioner knows: how many stations, the offset, where it was, which way it runs."""

    most: int = 6
    known_offset: bool = True
    window: bool = True
    direction: bool = True


CASES = {
    # The rule on a run; then put into service, anywhere on the line, in either direction.
    "doppler.solve": Case(),
    "doppler.solve_anywhere": Case(known_offset=False, window=False, direction=False),
}


def solver_of_a_line() -> DopplerSolver:
    """A line of straights, clothoids and arcs, and its stations."""
    elements = []
    for radius_m in (800.0, -600.0, 400.0, -1200.0):
        elements += [
            Element.from_radii(1200.0, None, None),
            Element.from_radii(120.0, None, radius_m),
            Element.from_radii(560.0, radius_m, radius_m),
            Element.from_radii(120.0, radius_m, None),
            Element.from_radii(1000.0, None, None),
        ]
    alignment = Alignment(elements)
    s = np.linspace(0.0, alignment.length_m, int(np.ceil(alignment.length_m / 5.0)) + 1)
    x, y, heading = alignment.pose(s)
    line = SurveyedLine(s, x, y, np.zeros_like(s), heading)
    feet = np.arange(0.0, line.end_m, SPACING_M)
    places, slopes, _ = line.at(feet)
    side = np.where(np.arange(feet.size) % 2, ASIDE_M, -ASIDE_M)
    places += np.column_stack([-side * slopes[:, 1], side * slopes[:, 0], 6.0 + 0.0 * feet])
    return DopplerSolver(PLAN, line, places, np.arange(feet.size) % PLAN.slots)


def draws(
    rng: np.random.Generator, solver: DopplerSolver, case: Case, *, number: int = DRAWS
) -> list[Draw]:
    """Draw answers that the solver gives."""
    line = solver.line
    found: list[Draw] = []
    while len(found) < number:
        s = float(rng.uniform(300.0, line.end_m - 300.0))
        v = float(rng.uniform(20.0, 500.0)) / 3.6 * float(rng.choice([-1.0, 1.0]))
        offset_hz = float(rng.uniform(-1300.0, 1300.0))
        distance = line.distances(solver.stations_m, s)
        heard = np.argsort(distance)[: case.most]
        heard = heard[distance[heard] < REACH_M]
        tone_hz = np.array([PLAN.tone_hz(int(slot)) for slot in solver.slots[heard]])
        way = v * PLAN.averaging_time_s
        rate = line.rates(solver.stations_m[heard], [s - way, s + way]).mean(axis=0)
        variance = shift_variance_hz2(PLAN, SNR * (SPACING_M / distance[heard]) ** 2)
        shift = -tone_hz / SPEED_OF_LIGHT_M_PER_S * v * rate + tone_hz / PLAN.carrier_hz * offset_hz
        shift += np.sqrt(variance) * rng.standard_normal(len(heard))
        prior = Prior(offset_hz + 0.1 * rng.standard_normal(), 0.1) if case.known_offset else None
        near = (s - 70.0, s + 50.0) if case.window else None
        direction = int(np.sign(v)) if case.direction else 0
        draw = Draw(heard, shift, variance, prior, near, direction, s, v)
        answer = _solve(solver, draw)
        if answer.reason is not NoFixReason.NONE:
            continue
        fix = answer.fix
        if abs(fix.chainage_m - s) > 6 * fix.sigma_m:
            raise RuntimeError(f"solver: {fix.chainage_m:.2f} m instead of {s:.2f} m")
        found.append(draw)
    return found


def _solve(solver: DopplerSolver, draw: Draw) -> Any:
    return solver.solve(
        draw.heard,
        draw.shift_hz,
        draw.variance_hz2,
        offset=draw.offset,
        window_m=draw.window_m,
        direction=draw.direction,
    )


class Plain:
    """The same function, written down plainly."""

    def __init__(self, solver: DopplerSolver, draw: Draw) -> None:
        self._line, self._draw = solver.line, draw
        self._stations = solver.stations_m[draw.heard]
        tone_hz = np.array([PLAN.tone_hz(int(slot)) for slot in solver.slots[draw.heard]])
        self._per_mps = -tone_hz / SPEED_OF_LIGHT_M_PER_S
        self._scale = tone_hz / PLAN.carrier_hz
        self._root = 1.0 / np.sqrt(draw.variance_hz2)

    def residuals(self, unknowns: FloatArray) -> FloatArray:
        """Weighted residuals of chainage, speed and offset."""
        s, v, d = unknowns
        way = v * PLAN.averaging_time_s
        rate = self._line.rates(self._stations, [s - way, s + way]).mean(axis=0)
        rest = self._root * (self._draw.shift_hz - self._per_mps * rate * v - self._scale * d)
        prior = self._draw.offset
        return rest if prior is None else np.append(rest, (d - prior.mean) / prior.sigma)

    def cost(self, chainage: Any) -> float:
        """Chi-square at the best speed and offset."""
        rate = self._line.rates(self._stations, float(np.ravel(chainage)[0]))
        matrix = self._root[:, None] * np.stack((self._per_mps * rate, self._scale), axis=1)
        right = self._root * self._draw.shift_hz
        prior = self._draw.offset
        if prior is not None:
            matrix = np.vstack((matrix, [0.0, 1.0 / prior.sigma]))
            right = np.append(right, prior.mean / prior.sigma)
        best = np.linalg.lstsq(matrix, right, rcond=None)[0]
        return float(np.sum((right - matrix @ best) ** 2))


def _brute(solver: DopplerSolver, draw: Draw) -> float:
    low, high = draw.window_m or (solver.line.start_m, solver.line.end_m)
    points = int(np.ceil((high - low) / solver.grid_step_m)) + 1
    cost = Plain(solver, draw).cost
    found = optimize.brute(cost, ((low, high),), Ns=points, finish=optimize.fmin, disp=False)
    return float(np.ravel(found)[0])


def _bounded(solver: DopplerSolver, draw: Draw) -> float:
    bounds = (draw.chainage_m - WINDOW_M, draw.chainage_m + 0.7 * WINDOW_M)
    found = optimize.minimize_scalar(
        Plain(solver, draw).cost, bounds=bounds, method="bounded", options={"xatol": 1e-3}
    )
    return float(found.x)


def _least_squares(solver: DopplerSolver, draw: Draw) -> float:
    offset_hz = draw.offset.mean if draw.offset else 0.0
    start = [draw.chainage_m + 0.3 * WINDOW_M, 0.9 * draw.speed_mps, offset_hz]
    residuals = Plain(solver, draw).residuals
    return float(optimize.least_squares(residuals, start, x_scale=[1.0, 0.1, 1.0]).x[0])


PEERS: dict[str, Callable[[DopplerSolver, Draw], float]] = {
    "brute": _brute,
    "minimize_scalar": _bounded,
    "least_squares": _least_squares,
}


@compiled
def _repeat(
    times: int,
    cubics: FloatArray,
    start_m: float,
    per_m: float,
    tau_s: float,
    rates: FloatArray,
    heard: NDArray[np.int64],
    received: FloatArray,
    known: Known,
    window: tuple[int, int, float, float],
    near: tuple[float, float],
) -> float:
    """Arithmetic of one answer, so many times: profile and one minimum; sum of the costs."""
    first, last, low_m, high_m = window
    total = 0.0
    for _ in range(times):
        _, cost, _ = cost_profile(rates, heard, first, last, received, known, 0)
        at = (near[0], near[1], known[2])
        best = cost_minimum(
            cubics, start_m, per_m, received, tau_s, known, at, low_m, high_m, np.inf
        )
        total += best[1] + cost[0]
    return total


def _bound(solver: DopplerSolver, case: list[Draw], times: int = 100) -> float:
    """Answers per CPU-second of the arithmetic alone."""
    line = solver.line
    grid = np.arange(line.start_m, line.end_m + 1e-6, solver.grid_step_m)
    rates = line.rates(solver.stations_m, grid).T.copy()
    spent_s = 0.0
    for draw in case:
        tone_hz = np.array([PLAN.tone_hz(int(slot)) for slot in solver.slots[draw.heard]])
        columns = [draw.shift_hz, 1.0 / draw.variance_hz2, -tone_hz / SPEED_OF_LIGHT_M_PER_S]
        rest = np.column_stack([*columns, tone_hz / PLAN.carrier_hz])
        received = np.hstack([solver.stations_m[draw.heard], rest])
        offset = draw.offset or Prior(0.0, 1e-6 * PLAN.max_offset_ppm * PLAN.carrier_hz)
        known = (0.0, (2.0 * PLAN.max_speed_mps) ** -2, offset.mean, offset.sigma**-2)
        low_m, high_m = draw.window_m or (line.start_m, line.end_m)
        first, last = np.searchsorted(grid, [low_m, high_m]).tolist()
        place = float(grid[np.argmin(np.abs(grid - draw.chainage_m))])
        road = (line.cubics, line.start_m, 1.0 / line.step_m, PLAN.averaging_time_s, rates)
        window = (first, last, low_m, high_m)
        shifts = (draw.heard, received, known, window, (place, draw.speed_mps))
        _repeat(1, *road, *shifts)
        spent_s += _cpu_s(lambda road=road, shifts=shifts: _repeat(times, *road, *shifts))  # type: ignore[misc]
    return times * len(case) / spent_s


def rows() -> list[dict[str, Any]]:
    """Measure, and return one row per figure."""
    rng = np.random.default_rng(29)
    solver = solver_of_a_line()
    found = [_row(solver, name, draws(rng, solver, case)) for name, case in CASES.items()]
    return [*found, _slowest(rng, solver)]


def _row(solver: DopplerSolver, name: str, case: list[Draw]) -> dict[str, Any]:
    """Measure one case on all sides."""
    ours: list[float] = []
    bounds: list[float] = []
    peers: dict[str, list[float]] = {peer: [] for peer in PEERS}
    found: dict[str, float] = {}
    for turn in range(ROUNDS):  # in turns, so that all see the same machine
        ours.append(len(case) / _cpu_s(lambda: [_solve(solver, draw) for draw in case]))
        bounds.append(_bound(solver, case))
        if turn >= PEER_ROUNDS:
            continue
        for peer, call in PEERS.items():
            start = time.process_time()
            places = [call(solver, draw) for draw in case]
            peers[peer].append(len(case) / (time.process_time() - start))
            near = [abs(s - d.chainage_m) < 20.0 for s, d in zip(places, case, strict=True)]
            found[peer] = statistics.fmean(near)
    rates = {peer: statistics.median(values) for peer, values in peers.items()}
    # A peer that does not find the train is not faster, it is wrong.
    right = [peer for peer in rates if found[peer] >= 0.95]
    best = max(right, key=lambda peer: rates[peer]) if right else None
    label = ", ".join(f"{p} {rates[p]:.0f}/s finds {found[p]:.0%}" for p in rates)
    mine = statistics.median(ours)
    return {
        "name": name,
        "unit": "positions/CPU-s",
        "ours": mine,
        "peer_name": f"scipy {best} ({label})",
        "peer": rates[best] if best else None,
        "ratio": mine / rates[best] if best else None,
        "bound": statistics.median(bounds),
    }


def _slowest(rng: np.random.Generator, solver: DopplerSolver) -> dict[str, Any]:
    """Slowest single answer over stations, knowledge, window and direction; the bound is 1 ms."""
    worst = 0.0
    for most in (3, 4, 6):
        for known in (True, False):
            for window in (True, False):
                if most == 3 and not (known and window):
                    continue
                case = Case(most, known, window, window)
                for draw in draws(rng, solver, case, number=20):
                    took = min(_cpu_s(lambda d=draw: _solve(solver, d)) for _ in range(3))  # type: ignore[misc]
                    worst = max(worst, took)
    return {
        "name": "doppler.slowest",
        "unit": "us",
        "ours": 1e6 * worst,
        "peer_name": "none",
        "peer": None,
        "ratio": None,
        "bound": 1000.0,
    }


def _cpu_s(call: Callable[[], object]) -> float:
    """CPU time of a call [s]."""
    start = time.process_time()
    call()
    return time.process_time() - start


def main() -> None:
    """Print the rows."""
    for row in rows():
        ratio = f"ratio {row['ratio']:.1f}" if row["ratio"] else ""
        print(
            f"{row['name']:24} {row['ours']:8.0f} {row['unit']:16} {row['peer_name']} {ratio}"
            f" bound {row['bound']:.0f}"
        )


if __name__ == "__main__":
    main()
