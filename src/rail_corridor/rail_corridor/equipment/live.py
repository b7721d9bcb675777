"""What the live page asks of equipment, and what it offers to it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, Protocol

from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.waveform import Waveform

from .live_elements import (
    Card,
    ElementState,
    ErrorTrace,
    LineRow,
    LogEntry,
    Panel,
    PanelSpec,
    TableCard,
    TrainColumn,
    TrainRow,
    Writers,
)
from .live_state import LiveState


class SymbolReader(Protocol):
    """Reads the symbols of bursts, for the I/Q plane of the scope."""

    def symbols(self, block: Waveform, antenna: int) -> dict[str, Any] | None:
        """Symbols of a block; None if it holds none that it knows."""


class LiveView:
    """What one kind of equipment shows on the live page; a class derives and says what differs.

    Tables in the namespace of a train have a card without being named here, by the names of their
    columns. What is read while nobody looks at a train is to be little: `overview`.
    """

    #: Read for every train and every place, all the time.
    overview: ClassVar[tuple[Topic, ...]] = ()
    #: Topics of which every message counts; read while the log of `panel` is open.
    events: ClassVar[tuple[Topic, ...]] = ()
    #: Tables that are shown in plain words.
    tables: ClassVar[tuple[TableCard, ...]] = ()
    columns: ClassVar[tuple[TrainColumn, ...]] = ()
    panel: ClassVar[PanelSpec | None] = None
    error_trace: ClassVar[ErrorTrace | None] = None
    #: The measured positions that trains are drawn at, and what measures them; the first that
    #: has them is asked.
    position_topic: ClassVar[Topic | None] = None
    position_label: ClassVar[str] = ""
    #: Paragraphs of the help.
    introduction: ClassVar[tuple[str, ...]] = ()

    def details(self, state: LiveState, train: str) -> Iterable[str]:
        """Names of topics outside of a train's namespace that are read while it is picked."""
        return ()

    def cards(self, state: LiveState, train: str) -> Iterable[Card]:
        """Cards of a train beside those of its tables."""
        return ()

    def train_row(self, state: LiveState, train: str, writers: Writers) -> TrainRow:
        """What it adds to a train in the table and on the line."""
        return TrainRow()

    def error(self, state: LiveState, train: str) -> tuple[float, float, float] | None:
        """Error of `error_trace`: estimate, low and high end of its interval, minus truth [m]."""
        return None

    def line_rows(self, line: Mapping[str, Any]) -> Sequence[LineRow]:
        """Its rows of the drawing of the line, from what has been announced."""
        return ()

    def states(self, state: LiveState) -> Mapping[str, Mapping[str, ElementState]]:
        """States of their elements by row and name; one without a state may be left out."""
        return {}

    def panel_contents(self, state: LiveState, train: str) -> Panel | None:
        """Contents of `panel`; None where the corridor has none of the equipment."""
        return None

    def has_log(self, line: Mapping[str, Any]) -> bool:
        """Whether the corridor has equipment whose messages the log of `panel` shows."""
        return False

    def log_entries(self, line: Mapping[str, Any], name: str, raw: bytes) -> Iterable[LogEntry]:
        """What a serialised message of one of the `events` says; nothing if it cannot be read."""
        return ()

    def symbol_reader(self, line: Mapping[str, Any]) -> SymbolReader | None:
        """Reader of the bursts of its waveforms.

        Raises
        ------
        ValueError, KeyError, TypeError
            If the announcement is of another version.
        """
        return None
