"""The tick itself: its start, its end, who is ready and who has failed."""

from __future__ import annotations

from typing import Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String

from .qos import ESTIMATE, LATCHED, STREAM
from .topic import Topic

CLOCK: Final = Topic(
    "/clock",
    Clock,
    STREAM,
    None,
    "world",
    "every node that acts on the clock",
    "Start of a tick.",
)
DONE: Final = Topic(
    "{node}/done",
    Header,
    STREAM,
    None,
    "every node that ends the tick",
    "world",
    "The node has finished the tick of this stamp.",
)
FINISHED: Final = Topic(
    "/world/finished",
    Header,
    LATCHED,
    None,
    "world",
    "the report",
    "The run has reached its end.",
)
OBSERVED: Final = Topic(
    "/report/observed",
    Header,
    LATCHED,
    None,
    "the report",
    "world",
    "The report has read everything up to this stamp; the world does not run far ahead of it.",
)
READY: Final = Topic(
    "/ready",
    String,
    LATCHED,
    None,
    "every node",
    "world",
    "Name of a node whose topics are all connected.",
    shared=True,
)
#: What a stream lacks, on ``/waiting``.
NO_SENDER: Final = "no sender"
NO_READER: Final = "no reader"
WAITING: Final = Topic(
    "/waiting",
    DiagnosticStatus,
    LATCHED,
    None,
    "every node that is not connected for long",
    "world",
    "The topics that a node lacks a sender or a reader of before the first tick.",
    shared=True,
)
FAILED: Final = Topic(
    "/failed",
    DiagnosticStatus,
    LATCHED,
    None,
    "every node that waits for others, the report for the launcher",
    "every node that waits for others, the report",
    "A node that is not waited for any longer, and why.",
    shared=True,
)
DIAGNOSTICS: Final = Topic(
    "/diagnostics",
    DiagnosticArray,
    ESTIMATE,
    None,
    "every node",
    "people, the report",
    "Health, published when it changes and in every simulated second (REP 107).",
    shared=True,
)

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (
    CLOCK,
    DONE,
    FINISHED,
    OBSERVED,
    READY,
    WAITING,
    FAILED,
    DIAGNOSTICS,
)
