"""Where the detection points lie, and the sections between them.

Points divide every track evenly, from a margin after its begin to a margin before its end; what is
outside of them is not watched. A branch begins in the section that its junction lies in: that one
has a third point, the first of the branch.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from rail_corridor.scenario.model import Scenario
from rail_world.line.network import Network

from .section import AXLE_COUNTERS, AxleCounterPlan


@dataclass(frozen=True)
class DetectionPoint:
    """A wheel sensor beside a track, at a chainage [m]."""

    name: str
    track: str
    at_m: float


@dataclass(frozen=True)
class Span:
    """A part of a track [m] that belongs to a section."""

    track: str
    start_m: float
    end_m: float


@dataclass(frozen=True)
class CountedSection:
    """A section: its parts, and for each point at a border the way that leads in.

    ``borders`` holds name of the point and +1 where axles enter towards increasing chainage.
    """

    name: str
    spans: tuple[Span, ...]
    borders: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Layout:
    """All detection points and sections of a scenario."""

    points: tuple[DetectionPoint, ...] = ()
    sections: tuple[CountedSection, ...] = ()


def layout_of(scenario: Scenario) -> Layout:
    """Points and sections in the order of the tracks; none without the section in the file."""
    return scenario.derive(_placed)


def _placed(scenario: Scenario) -> Layout:
    plan = AXLE_COUNTERS.of(scenario)
    return Layout() if plan is None else place(scenario.network, plan)


def place(network: Network, plan: AxleCounterPlan) -> Layout:
    """Divide every track; one that is shorter than both margins has no points."""
    points: list[DetectionPoint] = []
    on_track: dict[str, list[DetectionPoint]] = {}
    for name, track in network.tracks.items():
        first_m, last_m = plan.margin_m, track.length_m - plan.margin_m
        on_track[name] = []
        if last_m <= first_m:
            continue
        count = math.ceil((last_m - first_m) / plan.length_m - 1e-9)
        for at_m in np.linspace(first_m, last_m, count + 1).tolist():
            found = DetectionPoint(f"dp{len(points) + 1}", name, at_m)
            points.append(found)
            on_track[name].append(found)
    sections: list[CountedSection] = []
    for name in network.tracks:
        for begin, end in itertools.pairwise(on_track[name]):
            spans = [Span(name, begin.at_m, end.at_m)]
            borders = [(begin.name, 1), (end.name, -1)]
            for junction in network.junctions_on(name):
                behind = on_track[junction.branch][:1]
                if behind and begin.at_m < junction.at_m < end.at_m:
                    spans.append(Span(junction.branch, 0.0, behind[0].at_m))
                    borders.append((behind[0].name, -1))
            number = len(sections) + 1
            sections.append(CountedSection(f"acs{number}", tuple(spans), tuple(borders)))
    return Layout(tuple(points), tuple(sections))
