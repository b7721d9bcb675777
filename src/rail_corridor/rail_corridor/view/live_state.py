"""What a viewer knows of a corridor: everything its topics have said, newest first."""

from __future__ import annotations

import json
import math
from collections import OrderedDict, deque
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from rail_corridor.equipment.live import SymbolReader
from rail_corridor.equipment.live_state import LiveState, View
from rail_corridor.equipment.registry import live_views
from rail_msgs_py.position import Position
from rail_msgs_py.stamps import clock_from_cdr
from rail_msgs_py.table import Table
from rail_msgs_py.topics.tick import DIAGNOSTICS, FAILED, FINISHED
from rail_msgs_py.topics.world import CORRIDOR_PATH, SCENARIO, STATE
from rail_msgs_py.waveform import Waveform

from .health import Health
from .history import History, history_row
from .layout import layout
from .message_log import MessageLog
from .table_reader import TableReader
from .wanted import STATE_DEPTH, events, kind_of

#: Without a tick for so long [s of wall time], and for so many ticks, a run stands still.
STILL_S = 3.0
_STILL_TICKS = 4
_RATE_WINDOW_S = 3.0
#: What has been kept for late readers has come by then [s of wall time].
_SETTLED_S = 2.0
#: A drawn line needs no more points than this.
_MOST_POINTS = 600


class LiveStateStore(LiveState):
    """The state of one corridor, fed with serialised messages as they are taken."""

    def __init__(self) -> None:
        self._line: dict[str, Any] = {}
        self._layout = layout({})
        #: Grows when the line, or the run on it, is another one.
        self.run = 0
        self.paths: dict[str, list[list[float]]] = {}
        self.health = Health()
        self.history = History()
        self.symbol_readers: tuple[SymbolReader, ...] = ()
        self._logs: dict[str, MessageLog] = {}
        self.blocks: dict[str, bytes] = {}
        self.not_tables: set[str] = set()
        self._over = False
        self._readers: dict[str, TableReader] = {}
        self._forget()

    def _forget(self) -> None:
        self.trains: tuple[str, ...] = ()
        self.truth: OrderedDict[int, Any] = OrderedDict()
        self._tables: dict[str, Table] = {}
        self._readings: dict[str, Any] = {}
        self._now_ns = -1
        self.finished = False
        self.gone = False
        self._first_tick_s = self._last_tick_s = math.nan
        self._ticks: deque[tuple[float, float]] = deque()

    # Fed by the bridge -------------------------------------------------------------------

    def feed(self, name: str, raw: bytes, wall_s: float) -> None:
        """Take one message; ``wall_s`` is the present on a steady clock."""
        if self._over:
            self._begin_run()
        kind = kind_of(name)
        if kind is STATE:
            self._on_state(raw, wall_s)
        elif kind in events():
            self._on_event(name, raw)
        elif kind is SCENARIO:
            self._on_scenario(deserialize_message(raw, String).data)
        elif kind is CORRIDOR_PATH:
            self._on_path(name, deserialize_message(raw, Path))
        elif kind is DIAGNOSTICS:
            self.health.on_diagnostics(
                deserialize_message(raw, DiagnosticArray), self._heard_s(wall_s)
            )
        elif kind is FAILED:
            self.health.on_failed(deserialize_message(raw, DiagnosticStatus), self._heard_s(wall_s))
        elif kind is FINISHED:
            self.finished = clock_from_cdr(raw) >= self.now_ns
        elif kind is not None and kind.view not in (None, Table, Waveform):
            self._readings[name] = kind.view.from_cdr(raw)
        else:
            self._on_array(name, raw)

    def look(self, *, writers: int) -> None:
        """After each round: notice a corridor that has gone, and write down where trains are.

        ``writers`` is the number of worlds that publish the truth.
        """
        if self.now_ns >= 0 and writers == 0 and not self.gone:
            self.gone = self._over = True
        if self.now_ns >= 0 and not self.gone:
            self.history.put(self.now_s, [history_row(self, name) for name in self.trains])

    # Asked by equipment ------------------------------------------------------------------

    @property
    def line(self) -> dict[str, Any]:
        """See `LiveState.line`."""
        return self._line

    @property
    def tables(self) -> dict[str, Table]:
        """See `LiveState.tables`."""
        return self._tables

    @property
    def tracks(self) -> list[str]:
        """See `LiveState.tracks`."""
        return [track["name"] for track in self.line.get("tracks", ())]

    @property
    def now_ns(self) -> int:
        """See `LiveState.now_ns`; below 0 before the first tick."""
        return self._now_ns

    def row(self, name: str) -> dict[str, float]:
        """See `LiveState.row`."""
        table = self.tables.get(name)
        return table.row(table.rows[0]) if table is not None and table.rows else {}

    def reading(self, name: str, view: type[View]) -> View | None:
        """See `LiveState.reading`."""
        found = self._readings.get(name)
        return found if isinstance(found, view) else None

    def position(self, train: str) -> Position | None:
        """See `LiveState.position`."""
        found = (self.reading(name, Position) for name in position_topics(train))
        return next((position for position in found if position is not None), None)

    # Asked by the page -------------------------------------------------------------------

    @property
    def now_s(self) -> float:
        """Simulated time of the newest tick."""
        return max(self.now_ns, 0) * 1e-9

    @property
    def ticking(self) -> bool:
        """Whether ticks run: from the second one on, and as long as the world is there."""
        return self.now_ns > 0 and not (self.gone or self.finished)

    def drawn(self) -> dict[str, Any]:
        """What the page draws; without an announcement the line has the paths of its tracks."""
        line = {key: value for key, value in self.line.items() if key != "scenario"}
        if "tracks" not in line:
            line["tracks"] = [
                {"name": name, "length_m": _length_m(points), "from": None, "from_m": 0.0}
                for name, points in self.paths.items()
            ]
        return line | self._layout | {"paths": self.paths}

    def status(self, wall_s: float) -> str:
        """One of waiting, starting, running, still, ended, gone."""
        if self.now_ns < 0:
            return "starting" if self.line and not self._over else "waiting"
        if self.finished:
            return "ended"
        if self.gone:
            return "gone"
        rate = self.rate() or 1.0
        patience_s = max(STILL_S, _STILL_TICKS * float(self.line.get("tick_s", 0.0)) / rate)
        return "still" if wall_s - self._last_tick_s > patience_s else "running"

    def silent_s(self, wall_s: float) -> float:
        """Wall time since the newest tick."""
        return wall_s - self._last_tick_s if self.now_ns >= 0 else 0.0

    def rate(self) -> float | None:
        """Simulated seconds per second of wall time, lately."""
        if len(self._ticks) < 2 or self._ticks[-1][0] - self._ticks[0][0] < 0.5:
            return None  # too short to say
        first, last = self._ticks[0], self._ticks[-1]
        return (last[1] - first[1]) / (last[0] - first[0])

    def log(self, panel: str) -> MessageLog:
        """Log of a panel, by its name."""
        return self._logs.setdefault(panel, MessageLog())

    def true_row(self, train: str, stamp_ns: int | None = None) -> dict[str, float] | None:
        """See `LiveState.true_row`."""
        if train not in self.trains or not self.truth:
            return None
        if stamp_ns is None:
            stamp_ns = next(reversed(self.truth))
        values = self.truth.get(stamp_ns)
        if values is None:
            return None
        row = values[self.trains.index(train)].tolist()
        return dict(zip(STATE.columns, row, strict=True))

    def true_place(self, train: str, stamp_ns: int) -> tuple[str, float] | None:
        """See `LiveState.true_place`."""
        row = self.true_row(train, stamp_ns)
        if row is None or row["on_line"] <= 0.0:
            return None
        index = int(row["track_index"])
        tracks = self.tracks
        return (tracks[index] if index < len(tracks) else "", row["chainage_m"])

    def first_track(self, train: str) -> str:
        """See `LiveState.first_track`."""
        routes = {t["name"]: t.get("route") or ("",) for t in self.line.get("trains", ())}
        return str(routes.get(train, ("",))[0])

    def error_m(self, train: str, track: str, chainage_m: float, stamp_ns: int) -> float | None:
        """See `LiveState.error_m`."""
        place = self.true_place(train, stamp_ns)
        if place is None or (place[0] and track and place[0] != track):
            return None
        return chainage_m - place[1]

    # -------------------------------------------------------------------------------------

    def _heard_s(self, wall_s: float) -> float:
        """Simulated time of what carries none; 0, "not known", for what may have waited for us."""
        return self.now_s if wall_s - self._first_tick_s > _SETTLED_S else 0.0

    def _on_state(self, raw: bytes, wall_s: float) -> None:
        table = self._reader("/world/state").read(raw)
        if table.stamp_ns < self.now_ns or (self.trains and table.rows != self.trains):
            self._begin_run()
        if self.now_ns < 0:
            self._first_tick_s = wall_s
        self.trains, self._now_ns, self._last_tick_s = table.rows, table.stamp_ns, wall_s
        self.truth[table.stamp_ns] = np.array(table.values)
        while len(self.truth) > STATE_DEPTH:
            self.truth.popitem(last=False)
        self._ticks.append((wall_s, self.now_s))
        while len(self._ticks) > 2 and self._ticks[1][0] < wall_s - _RATE_WINDOW_S:
            self._ticks.popleft()

    def _on_scenario(self, text: str) -> None:
        try:
            line = json.loads(text or "{}")
            readers = [view.symbol_reader(line) for view in live_views()]
            found = layout(line)
        except (ValueError, KeyError, TypeError):
            return  # of another version: drawn from what the other topics say
        self._line, self._layout = line, found
        self.symbol_readers = tuple(reader for reader in readers if reader is not None)
        self.run += 1
        self._logs = {}

    def _on_path(self, name: str, path: Any) -> None:
        """Centre line as rows of share of the length, x and y; its poses are evenly spaced."""
        last = len(path.poses) - 1
        step = max(1, math.ceil(last / _MOST_POINTS))
        points = []
        for index in [*range(0, last, step), last]:
            place = path.poses[index].pose.position
            fraction = index / max(last, 1)
            points.append([round(fraction, 6), round(place.x, 1), round(place.y, 1)])
        self.paths[name.split("/")[2]] = points
        self.run += 1

    def _on_event(self, name: str, raw: bytes) -> None:
        kind = kind_of(name)
        for view in live_views():
            if view.panel is not None and kind in view.events:
                self.log(view.panel.name).put(view.log_entries(self.line, name, raw))

    def _on_array(self, name: str, raw: bytes) -> None:
        """A table, or the block of a scope; of what kind a external node is, its layout tells."""
        kind = kind_of(name)
        if name in self.not_tables or (kind is not None and kind.view is Waveform):
            self.blocks[name] = raw
            return
        try:
            self.tables[name] = self._reader(name).read(raw)
        except ValueError:
            self.not_tables.add(name)
            self.blocks[name] = raw

    def _reader(self, name: str) -> TableReader:
        return self._readers.setdefault(name, TableReader())

    def _begin_run(self) -> None:
        self._over = False
        self._forget()
        self.health.clear()
        self.history.clear()
        self.blocks.clear()
        self._logs = {}
        self.run += 1


def position_topics(train: str) -> list[str]:
    """Topics that carry the measured position of a train."""
    topics = [view.position_topic for view in live_views() if view.position_topic is not None]
    return [topic.name(train=train) for topic in topics]


def _length_m(points: list[list[float]]) -> float:
    """Length of a path of share, x and y, along its chords."""
    steps = np.diff(np.array(points)[:, 1:], axis=0)
    return float(np.hypot(*steps.T).sum())
