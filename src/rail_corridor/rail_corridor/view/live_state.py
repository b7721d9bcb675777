"""What a viewer knows of a corridor: everything its topics have said, newest first."""

from __future__ import annotations

import json
import math
from collections import OrderedDict, deque
from typing import TYPE_CHECKING, Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from rail_msgs_py.position import figures_from_cdr as position_from_cdr
from rail_msgs_py.ranging.range_reading import RangeReading
from rail_msgs_py.stamps import clock_from_cdr
from rail_msgs_py.table import Table
from rail_msgs_py.topics.ranging import POSITION, RANGE
from rail_msgs_py.topics.tick import DIAGNOSTICS, FAILED, FINISHED
from rail_msgs_py.topics.world import CORRIDOR_PATH, SCENARIO, STATE
from rail_msgs_py.waveform import Waveform

from .health import Health
from .history import History, history_row
from .table_reader import TableReader
from .telegram_log import TelegramLog
from .wanted import STATE_DEPTH, TELEGRAMS, kind_of

if TYPE_CHECKING:
    from .symbols import BurstReader

#: Without a tick for so long [s of wall time], and for so many ticks, a run stands still.
STILL_S = 3.0
_STILL_TICKS = 4
_RATE_WINDOW_S = 3.0
#: What has been kept for late readers has come by then [s of wall time].
_SETTLED_S = 2.0
#: A drawn line needs no more points than this.
_MOST_POINTS = 600


class Picture:
    """The state of one corridor, fed with serialised messages as they are taken."""

    def __init__(self) -> None:
        self.line: dict[str, Any] = {}
        #: Grows when the line, or the run on it, is another one.
        self.run = 0
        self.paths: dict[str, list[list[float]]] = {}
        self.health = Health()
        self.history = History()
        self.bursts: BurstReader | None = None
        self.telegrams = TelegramLog()
        self.blocks: dict[str, bytes] = {}
        self.not_tables: set[str] = set()
        self._over = False
        self._readers: dict[str, TableReader] = {}
        self._forget()

    def _forget(self) -> None:
        self.trains: tuple[str, ...] = ()
        self.truth: OrderedDict[int, Any] = OrderedDict()
        self.positions: dict[str, tuple[int, str, tuple[float, float, float, float]]] = {}
        self.tables: dict[str, Table] = {}
        self.ranges: dict[str, RangeReading] = {}
        self.now_ns = -1
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
        elif kind is POSITION:
            stamp_ns, track, figures = position_from_cdr(raw)
            self.positions[name.split("/")[3]] = (stamp_ns, track, figures)
        elif kind is RANGE:
            self.ranges[name] = RangeReading.from_cdr(raw)
        elif kind in TELEGRAMS:
            self.telegrams.put(name, raw)
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

    # Asked by the page -------------------------------------------------------------------

    @property
    def now_s(self) -> float:
        """Simulated time of the newest tick."""
        return max(self.now_ns, 0) * 1e-9

    @property
    def ticking(self) -> bool:
        """Whether ticks run: from the second one on, and as long as the world is there."""
        return self.now_ns > 0 and not (self.gone or self.finished)

    @property
    def tracks(self) -> list[str]:
        """Names of the tracks, in the order that counts them."""
        return [track["name"] for track in self.line.get("tracks", ())]

    def drawn(self) -> dict[str, Any]:
        """What the page draws the line from; without an announcement the paths of its tracks."""
        line = {key: value for key, value in self.line.items() if key != "scenario"}
        if "tracks" not in line:
            line["tracks"] = [
                {"name": name, "length_m": _length_m(points), "from": None, "from_m": 0.0}
                for name, points in self.paths.items()
            ]
        return line | {"paths": self.paths}

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

    def true_row(self, train: str, stamp_ns: int | None = None) -> dict[str, float] | None:
        """Truth about a train at a tick, the newest if none is said; None if it is not known."""
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
        """Track and chainage of a train at a tick; None if that is not known or not on the line."""
        row = self.true_row(train, stamp_ns)
        if row is None or row["on_line"] <= 0.0:
            return None
        index = int(row["track_index"])
        tracks = self.tracks
        return (tracks[index] if index < len(tracks) else "", row["chainage_m"])

    def first_track(self, train: str) -> str:
        """Track that a train's route begins on; empty if it has not been told."""
        routes = {t["name"]: t.get("route") or ("",) for t in self.line.get("trains", ())}
        return str(routes.get(train, ("",))[0])

    def error_m(self, train: str, track: str, chainage_m: float, stamp_ns: int) -> float | None:
        """How far an estimate is ahead of the truth of its own tick, on the same track."""
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
        self.trains, self.now_ns, self._last_tick_s = table.rows, table.stamp_ns, wall_s
        self.truth[table.stamp_ns] = np.array(table.values)
        while len(self.truth) > STATE_DEPTH:
            self.truth.popitem(last=False)
        self._ticks.append((wall_s, self.now_s))
        while len(self._ticks) > 2 and self._ticks[1][0] < wall_s - _RATE_WINDOW_S:
            self._ticks.popleft()

    def _on_scenario(self, text: str) -> None:
        try:
            line = json.loads(text or "{}")
            bursts = _reader_of(line["bursts"]) if line.get("bursts") else None
        except (ValueError, KeyError, TypeError):
            return  # of another version: drawn from what the other topics say
        self.line, self.bursts = line, bursts
        self.run += 1
        trains = [train["name"] for train in line.get("trains", ())]
        self.telegrams = TelegramLog(trains, self.tracks)

    def _on_path(self, name: str, path: Any) -> None:
        """Centre line as rows of share of the length, x and y; its poses are evenly spaced."""
        last = len(path.poses) - 1
        step = max(1, math.ceil(last / _MOST_POINTS))
        points = []
        for index in [*range(0, last, step), last]:
            place = path.poses[index].pose.position
            share = index / max(last, 1)
            points.append([round(share, 6), round(place.x, 1), round(place.y, 1)])
        self.paths[name.split("/")[2]] = points
        self.run += 1

    def _on_array(self, name: str, raw: bytes) -> None:
        """A table, or the block of a scope; of what kind a stranger is, its layout tells."""
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
        self.telegrams = TelegramLog([t["name"] for t in self.line.get("trains", ())], self.tracks)
        self.run += 1


def _length_m(points: list[list[float]]) -> float:
    """Length of a path of share, x and y, along its chords."""
    steps = np.diff(np.array(points)[:, 1:], axis=0)
    return float(np.hypot(*steps.T).sum())


def _reader_of(described: dict[str, Any]) -> BurstReader:
    """Reader of the bursts of a train radio; it brings much of SciPy, which takes time to load."""
    from .symbols import BurstReader

    return BurstReader(described)
