"""What one kind of equipment says about itself: everything the corridor asks of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from rich.console import RenderableType

from rail_corridor.run_data import RecordSpec, RunData
from rail_corridor.scenario.faults import Fault
from rail_corridor.scenario.model import Scenario, Section
from rail_msgs_py.topics.topic import Topic
from rail_world.line.description_base import Description
from rail_world.line.drawing import Drawing

from .live import LiveView
from .map_scene import MapMarkers, MapScene, TrackEstimate
from .node_spec import NodeKind, NodeSpec
from .run_figures import RunFigures


@dataclass(frozen=True)
class Supervision:
    """What trains obey.

    Node on board that commands them, whether drivers see what it permits, the standard deviation
    of the error of the wheels it counts by; within which way of one that stands a train stands
    behind it; and whether it tells speed restrictions, so that there are no boards on the line.
    """

    node: str
    cab_signals: bool
    odometer_error: float
    queue_m: float = 200.0
    tells_restrictions: bool = False


@dataclass(frozen=True)
class SectionOption:
    """An option of the command line that sets a field of a section.

    Parameters
    ----------
    option : str
        As it is typed.
    section, field : str
    replaces : tuple of str
        Fields of the section that it takes the place of.
    """

    option: str
    section: str
    field: str
    replaces: tuple[str, ...] = ()

    @property
    def path(self) -> str:
        """Path of the field in the file."""
        return f"{self.section}.{self.field}"


@dataclass(frozen=True)
class PlanContext:
    """What the nodes of all equipment are planned with.

    Parameters
    ----------
    world_file : str
        Path of the file that media read.
    timeout_s : float
        Wall time after which the world gives a node up; the others wait for fractions of it.
    subsystems : tuple of Subsystem
        All there are.
    """

    world_file: str
    timeout_s: float
    subsystems: tuple[Subsystem, ...]

    def medium(self, kind: str, **parameters: object) -> NodeSpec:
        """A medium under its usual name."""
        common = {"world_file": self.world_file, "timeout_s": 2 * self.timeout_s / 5}
        return NodeSpec(kind, f"/world/{kind}", "world", common | parameters)

    def offers(self, kind: str, scenario: Scenario, train: str = "") -> dict[str, Any]:
        """Parameters that a node gets because of other equipment; see `Subsystem.offer`."""
        merged: dict[str, Any] = {}
        for subsystem in self.subsystems:
            merged |= subsystem.offer(kind, scenario, train)
        return merged

    def supervision(self, scenario: Scenario) -> Supervision | None:
        """What trains obey, None if they run by themselves."""
        found = (subsystem.supervision(scenario) for subsystem in self.subsystems)
        return next((each for each in found if each is not None), None)


class Subsystem:
    """One kind of equipment; a class derives from this and says what differs.

    The corridor asks every subsystem of the registry in turn and knows none by name. What a
    subsystem is not concerned with it leaves out: every method has an answer that says "nothing".
    """

    #: Name of its folder, and of its part of the world file.
    name: ClassVar[str]
    sections: ClassVar[tuple[Section[Any], ...]] = ()
    faults: ClassVar[tuple[type[Fault], ...]] = ()
    options: ClassVar[tuple[SectionOption, ...]] = ()
    nodes: ClassVar[tuple[NodeKind, ...]] = ()
    topics: ClassVar[tuple[Topic, ...]] = ()
    #: Figures of its report that are zero, or none, in a safe run: ``trains.*.atp.overspeed_s``.
    hazards: ClassVar[tuple[str, ...]] = ()
    #: The topic of those that the report reads from which `map_estimate` is taken.
    locates_by: ClassVar[Topic | None] = None
    #: Folder of scenarios that come with it, which then run by their names; None if none do.
    scenarios: ClassVar[Path | None] = None

    def present(self, scenario: Scenario) -> bool:
        """Whether a scenario has it."""
        return any(section.of(scenario) is not None for section in self.sections)

    def check(self, scenario: Scenario, train_fields: Sequence[str]) -> None:
        """Raise InputError, without a file, for the first thing that does not fit together.

        Parameters
        ----------
        scenario : Scenario
        train_fields : sequence of str
            For each train the path of its fields in the file.
        """

    def supervision(self, scenario: Scenario) -> Supervision | None:
        """What trains obey because of it, None if it leaves them alone."""
        return None

    def odometer_error(self, scenario: Scenario) -> float | None:
        """Error of the wheels of trains whose odometers it reads, None if it reads none."""
        return None

    def plan(self, scenario: Scenario, context: PlanContext) -> Sequence[NodeSpec]:
        """Its nodes."""
        return ()

    def offer(self, kind: str, scenario: Scenario, train: str) -> Mapping[str, Any]:
        """Parameters that a node of another kind gets because this equipment is there."""
        return {}

    def world(self, scenario: Scenario) -> Mapping[str, Description]:
        """Its parts of the world, by the names under which its media ask for them."""
        return {}

    def drawing(self, scenario: Scenario) -> Drawing:
        """What it adds to the map."""
        return Drawing()

    def announcement(self, scenario: Scenario) -> Mapping[str, Any]:
        """What is announced of it on ``/world/scenario``, as JSON."""
        return {}

    def summary(self, scenario: Scenario) -> Iterable[RenderableType]:
        """What ``rail check`` shows of it."""
        return ()

    def records(self, scenario: Scenario) -> Sequence[RecordSpec]:
        """What the report reads of it."""
        return ()

    def train_report(self, scenario: Scenario, data: RunData, train: int) -> dict[str, Any]:
        """Sections of the report of one train."""
        return {}

    def run_report(self, scenario: Scenario, data: RunData) -> dict[str, Any]:
        """Sections of the report of the whole run."""
        return {}

    def events(self, scenario: Scenario, data: RunData) -> Iterable[dict[str, Any]]:
        """What went wrong by the truth: ``time_s, kind, train, track, at_m, message`` each."""
        return ()

    def tables(self, report: Mapping[str, Any]) -> Iterable[RenderableType]:
        """What the report shows of it on the screen."""
        return ()

    def live(self) -> LiveView:
        """What it shows on the live page; made once, and only by those who draw it."""
        return LiveView()

    def map_markers(self, scene: MapScene) -> MapMarkers:
        """What it adds to the trains in RViz and Foxglove."""
        return MapMarkers()

    def map_estimate(self, scene: MapScene, train: int) -> TrackEstimate | None:
        """Where it thinks a train to be, None if it does not know; see `locates_by`."""
        return None

    def run_figures(self) -> RunFigures:
        """What it adds to the figures of a run; made only by those who draw them."""
        return RunFigures()
