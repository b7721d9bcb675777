"""The table of a profile: kinds of nodes, what a tick costs each in every stage, the floors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from .attribution import STAGES, TRANSPORT, Stage


@dataclass(frozen=True)
class Cost:
    """What a tick costs the nodes of one kind [ms]."""

    kind: str
    nodes: int
    ms: Mapping[Stage, float]

    @property
    def total_ms(self) -> float:
        """Over all stages."""
        return sum(self.ms.values())


@dataclass(frozen=True)
class TickCosts:
    """What a tick costs.

    Parameters
    ----------
    rows : tuple of Cost
        The dearest first; the last is that outside all callbacks.
    tick_s : float
        Simulated time of a tick.
    tick_ms, wall_tick_ms : float
        CPU time of the thread in a tick that is not sampled, and wall time.
    sampling : float
        By what share a tick took longer while it was sampled.
    samples : int
    hand_over_ms, middleware_ms, arithmetic_ms : float
        The floors: of transport within the process and by the middleware, and of arithmetic.
    """

    rows: tuple[Cost, ...]
    tick_s: float
    tick_ms: float
    wall_tick_ms: float
    sampling: float
    samples: int
    hand_over_ms: float
    middleware_ms: float
    arithmetic_ms: float

    @property
    def transport_ms(self) -> float:
        """Floor of transport."""
        return self.hand_over_ms + self.middleware_ms

    @property
    def floor_ms(self) -> float:
        """Transport alone and arithmetic alone, one after the other."""
        return self.transport_ms + self.arithmetic_ms

    def values(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "kinds": [{"kind": row.kind, "nodes": row.nodes, **_stages(row)} for row in self.rows],
            "tick_s": self.tick_s,
            "tick_ms": self.tick_ms,
            "wall_tick_ms": self.wall_tick_ms,
            "sampling": self.sampling,
            "samples": self.samples,
            "hand_over_floor_ms": self.hand_over_ms,
            "middleware_floor_ms": self.middleware_ms,
            "transport_floor_ms": self.transport_ms,
            "arithmetic_floor_ms": self.arithmetic_ms,
            "ratio": self.tick_ms / self.floor_ms,
        }


def _stages(row: Cost) -> dict[str, float]:
    return {f"{stage}_ms": row.ms.get(stage, 0.0) for stage in STAGES}


def costs_of(
    samples: Iterable[tuple[str, Stage, float]], nodes: Mapping[str, int], tick_ms: float
) -> tuple[Cost, ...]:
    """Costs of the kinds of nodes, such that their sum is that of a tick.

    Parameters
    ----------
    samples : iterable of kind, stage, and time in any unit
    nodes : mapping
        Number of nodes of each kind.
    tick_ms : float
    """
    spent: dict[str, dict[Stage, float]] = {kind: {} for kind in (*nodes, TRANSPORT)}
    for kind, stage, share in samples:
        of_kind = spent.setdefault(kind, {})
        of_kind[stage] = of_kind.get(stage, 0.0) + share
    total = sum(sum(of_kind.values()) for of_kind in spent.values())
    scale = tick_ms / total if total else 0.0
    rows = [
        Cost(kind, nodes.get(kind, 0), {stage: share * scale for stage, share in of_kind.items()})
        for kind, of_kind in spent.items()
    ]
    return tuple(sorted(rows, key=lambda row: (row.kind == TRANSPORT, -row.total_ms, row.kind)))


def print_costs(costs: TickCosts, title: str, console: Console) -> None:
    """Show the table, and the floors beside it."""
    # Eighty columns are enough, if the kinds of nodes may take two lines.
    table = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        show_footer=True,
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    footers = _cells(costs.rows, costs.tick_ms)
    table.add_column("ms a tick", footer="whole tick")
    nodes = str(sum(row.nodes for row in costs.rows))
    table.add_column("nodes", footer=nodes, justify="right", no_wrap=True)
    for heading, footer in zip((*STAGES, "all", "share"), footers, strict=True):
        table.add_column(heading, footer=footer, justify="right", no_wrap=True)
    for row in costs.rows:
        table.add_row(row.kind, str(row.nodes or "-"), *_cells((row,), costs.tick_ms))
    console.print(table)
    for line in lines_of(costs):
        console.print(line, highlight=False, soft_wrap=True)


def lines_of(costs: TickCosts) -> list[str]:
    """What stands below the table."""
    return [
        f"floors: transport {costs.transport_ms:.3f} ms ({costs.hand_over_ms:.3f} in the process, "
        f"{costs.middleware_ms:.3f} by the middleware), arithmetic {costs.arithmetic_ms:.3f} ms; "
        f"a tick takes {costs.tick_ms / costs.floor_ms:.2f} times both",
        f"CPU time of one thread; {costs.wall_tick_ms:.3f} ms of wall time, "
        f"{costs.tick_s * 1e3 / costs.wall_tick_ms:.1f} times real time",
        f"{costs.samples} samples, which made a tick {costs.sampling:+.1%} longer (the sums are of "
        "ticks without)",
    ]


def _cells(rows: Iterable[Cost], tick_ms: float) -> list[str]:
    by_stage = [sum(row.ms.get(stage, 0.0) for row in rows) for stage in STAGES]
    total = sum(by_stage)
    return [*(f"{value:.3f}" for value in (*by_stage, total)), f"{total / tick_ms:.1%}"]
