"""What the live page knows of a corridor, as equipment may read it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeVar

from rail_msgs_py.position import Position
from rail_msgs_py.table import Table

View = TypeVar("View")


class LiveState(Protocol):
    """What the page knows of a corridor; equipment reads it, and never changes it."""

    @property
    def line(self) -> Mapping[str, Any]:
        """What has been announced; empty before that, or of another version."""

    @property
    def tables(self) -> Mapping[str, Table]:
        """Newest table of each topic by its name."""

    @property
    def tracks(self) -> Sequence[str]:
        """Names of the tracks, in the order that counts them."""

    @property
    def now_ns(self) -> int:
        """Stamp of the newest tick."""

    def row(self, name: str) -> Mapping[str, float]:
        """First row of the newest table of a topic, by columns; empty without one."""

    def reading(self, name: str, view: type[View]) -> View | None:
        """Newest message of a topic that is no table, None if there is none of this view."""

    def position(self, train: str) -> Position | None:
        """Where the wayside measured a train."""

    def true_row(self, train: str, stamp_ns: int | None = None) -> Mapping[str, float] | None:
        """Truth about a train at a tick, the newest unless given; None if it is not known."""

    def true_place(self, train: str, stamp_ns: int) -> tuple[str, float] | None:
        """Track and chainage of a train at a tick; None if not known or not on the line."""

    def first_track(self, train: str) -> str:
        """Track that a train's route begins on; empty if that is not known."""

    def error_m(self, train: str, track: str, chainage_m: float, stamp_ns: int) -> float | None:
        """How far an estimate is ahead of the truth of its own tick, on the same track."""
