"""One implementation inside of a corridor, judged after every tick."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rail_corridor.loading.overrides import Overrides
from rail_corridor.plan.parameter_files import parameter_file
from rail_corridor.stepped.topics import RowView, TableView, TopicHistory
from rail_msgs_py.node import SOFTWARE
from rail_msgs_py.topics.topic import Topic
from rail_testing.corridor import Corridor
from rail_testing.scenario_source import scenario_of

from .kind import EquipmentKind, Ports

#: Wall time without an answer after which it counts as failed [s].
_TIMEOUT_S = 10.0


@dataclass(frozen=True)
class Settings:
    """What the command line says.

    Parameters
    ----------
    kind : EquipmentKind
    command : tuple of str
        Starts the implementation; the corridor's own runs if empty.
    scenario : str, optional
        In the place of the kind's own.
    seed : int, optional
        Likewise.
    record : Path, optional
        Folder for recordings of what fails.
    """

    kind: EquipmentKind
    command: tuple[str, ...] = ()
    scenario: str | None = None
    seed: int | None = None
    record: Path | None = None


class Bench:
    """The fixture ``bench``: an implementation, and the corridor around it.

    Parameters
    ----------
    settings : Settings
    make : callable
        Makes a corridor of a scenario; it is closed with the test.
    """

    def __init__(self, settings: Settings, make: Callable[..., Corridor]) -> None:
        self.settings, self.kind, self._make = settings, settings.kind, make
        self._corridor: Corridor | None = None
        self._scratch: tempfile.TemporaryDirectory[str] | None = None
        self.node = ""
        self.parameters: dict[str, Any] = {}
        self._seen: dict[str, int] = {}

    # The run ------------------------------------------------------------------------------

    def start(
        self,
        *,
        tick_s: float | None = None,
        timeout_s: float = _TIMEOUT_S,
        **changes: Any,
    ) -> Corridor:
        """Start the corridor with the implementation in it, and stand before the first tick.

        Parameters
        ----------
        tick_s : float, optional
            In the place of the scenario's.
        timeout_s : float
            Wall time without an answer after which it counts as failed.
        **changes
            Sections of the scenario that are replaced.
        """
        settings = self.settings
        source = settings.scenario or dict(self.kind.scenario)
        scenario = scenario_of(source, Overrides(seed=settings.seed))
        data = {**scenario.model_dump(mode="json", exclude_unset=True), **changes}
        if tick_s is not None:
            data["tick_s"] = tick_s
        corridor = self._corridor = self._make(data, timeout_s=timeout_s)
        specs = [s for s in corridor.planned.nodes if s.kind == self.kind.node_kind]
        if not specs:
            pytest.fail(f"scenario {data['name']}: has no {self.kind.title}")
        spec = specs[-1]
        self.node, self.parameters = spec.name, dict(spec.parameters)
        if settings.command:
            self._scratch = tempfile.TemporaryDirectory(prefix="rail_conformance_")
            path = Path(self._scratch.name) / "parameters.yaml"
            path.write_text(parameter_file(spec))
            corridor.add(command=self._words(path), replaces=self.node)
        corridor.start()
        for name in (*self.ports.heard, *self.ports.outputs):
            assert corridor.topic(name) is not None  # of waveforms too, from now on
        return corridor

    def _words(self, parameters: Path) -> list[str]:
        """Command line of the implementation, with its name and its parameters as ROS has them."""
        namespace, _, name = self.node.rpartition("/")
        rules = ["-r", f"__ns:={namespace or '/'}", "-r", f"__node:={name}"]
        return [*self.settings.command, "--ros-args", *rules, "--params-file", str(parameters)]

    def close(self) -> None:
        """Remove what was written for the implementation."""
        if self._scratch is not None:
            self._scratch.cleanup()

    @property
    def corridor(self) -> Corridor:
        """The corridor, once it has been started."""
        assert self._corridor is not None, "bench.start() comes first"
        return self._corridor

    @property
    def place(self) -> str:
        """Train or site of the implementation."""
        return self.node.rpartition("/")[0].rpartition("/")[2]

    @property
    def ports(self) -> Ports:
        """Its topics."""
        return self.kind.ports(self)

    @property
    def tick_s(self) -> float:
        """Length of a tick [s]."""
        return self.corridor.tick_s

    def output(self, topic: Topic, **parts: object) -> TopicHistory:
        """Messages of one of its topics."""
        return self.corridor.topic(topic.name(**parts))

    # Judgement ----------------------------------------------------------------------------

    def refuse(self, words: str) -> None:
        """Fail the test."""
        __tracebackhide__ = True
        raised = self._raised()
        because = f"; it has raised {raised}" if raised else ""
        said = f"{self.node} at {self.corridor.time_s:g} s: {words}{because}"
        pytest.fail(said, pytrace=False)

    def _raised(self) -> str:
        """What its callbacks have raised last, as it has told of its health."""
        name = f"{self.node}: {SOFTWARE}"
        said = [each for each in self.corridor.health_events() if each["name"] == name]
        return str(said[-1]["message"]) if said else ""

    def require(self, words: str) -> None:
        """Fail the test if there is something to say."""
        __tracebackhide__ = True
        if words:
            self.refuse(words)

    def run(
        self,
        seconds: float,
        check: Callable[[], str] | None = None,
        *,
        returning: bool = False,
        claims: bool = True,
    ) -> None:
        """Run for a time, and judge each tick.

        Parameters
        ----------
        seconds : float
        check : callable, optional
            Says what else is wrong after a tick.
        returning : bool
            Whether it has just been started anew and is perhaps not heard at once.
        claims : bool
            Whether its claims are compared with the truth.
        """
        __tracebackhide__ = True
        for _ in range(max(1, round(seconds / self.tick_s))):
            if not self.corridor.step():
                return
            if returning and not self._heard():
                continue
            returning = False
            self.require(self.answer())
            self.require(self.kind.false_claim(self) if claims else "")
            self.require(check() if check is not None else "")

    def run_until_working(self, within_s: float, what: str, *, returning: bool = False) -> None:
        """Run until it does its work; each tick is judged."""
        __tracebackhide__ = True
        begun_s = self.corridor.time_s
        while not (self._all_heard() and self.kind.working(self)):
            if self.corridor.time_s - begun_s > within_s or self.corridor.finished:
                self.refuse(f"does not work within {within_s:g} s {what}{self._last_seen()}")
            self.run(self.tick_s, returning=returning and not self._heard())

    def _last_seen(self) -> str:
        shown = [
            repr(self.corridor.topic(name))
            for name, topic in self.ports.outputs.items()
            if topic.table and len(self.corridor.topic(name))
        ]
        return f"; last seen: {', '.join(shown)}" if shown else ""

    def _heard(self) -> bool:
        """Whether it has sent anything in the last tick."""
        last = self.corridor.ticks - 1
        return any(last in self.corridor.topic(name).ticks[-3:] for name in self.ports.outputs)

    def _all_heard(self) -> bool:
        return all(len(self.corridor.topic(name)) for name in self.ports.outputs)

    def answer(self) -> str:
        """What is wrong with its answer to the last tick: how many, of which time, in what form."""
        tick, stamp_ns = self.corridor.ticks - 1, round(self.corridor.time_s * 1e9)
        for name, topic in self.ports.outputs.items():
            history = self.corridor.topic(name)
            count = sum(1 for each in reversed(history.ticks[-8:]) if each == tick)
            if count != 1:
                return f"{name}: {count or 'no'} messages in a tick; it must be one"
            try:
                view = history.latest
            except (ValueError, IndexError) as error:
                return f"{name}: {error}"
            said_ns = getattr(view, "stamp_ns", stamp_ns)
            if abs(said_ns - stamp_ns) > 1000:
                said_s, now_s = said_ns * 1e-9, stamp_ns * 1e-9
                return f"{name}: has the stamp {said_s:g} s, in the tick of {now_s:g} s"
            if words := self._out_of_range(name, topic, view):
                return words
        return ""

    def _out_of_range(self, name: str, topic: Topic, view: Any) -> str:
        rows: tuple[RowView, ...] = ()
        if isinstance(view, RowView | TableView):
            if topic.columns and view.columns != topic.columns:
                wanted = ", ".join(topic.columns)
                return f"{name}: has columns {', '.join(view.columns)}, not {wanted}"
            rows = (view,) if isinstance(view, RowView) else view.rows
        ranges: Mapping[str, Any] = self.kind.ranges.get(topic.pattern, {})
        for row in rows:
            for column, value in row.as_dict().items():
                if column in ranges and not ranges[column].holds(value):
                    return f"{name}: {column} is {value:g}; it must be {ranges[column]}"
        samples = getattr(view, "samples", None)
        if samples is not None and samples.size and not np.isfinite(samples).all():
            return f"{name}: has samples that are no numbers"
        variance = getattr(view, "variance_m2", None)
        if variance is not None and not (variance > 0.0 or variance == inf):
            return f"{name}: has a variance of {variance:g} m^2"
        return ""

    # Switching ----------------------------------------------------------------------------

    @property
    def switchable(self) -> bool:
        """Whether it can be switched off and on."""
        return self.corridor.can_be_switched(self.node)
