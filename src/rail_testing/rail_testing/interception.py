"""Messages that are dropped, delayed, altered or forged on their way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from rclpy.serialization import deserialize_message, serialize_message

from rail_msgs_py.delivery import Line, Sendable, serialised


class InterceptorError(RuntimeError):
    """A function that intercepts has raised, or returned what is no message."""


@dataclass(frozen=True)
class Late:
    """A message that comes some ticks later, as it was.

    Parameters
    ----------
    message : message of ROS
    ticks : int
    """

    message: Any
    ticks: int = 1

    def __post_init__(self) -> None:
        if not isinstance(self.ticks, int) or self.ticks < 1:
            raise ValueError(f"a message comes one tick late or more, not {self.ticks!r}")


#: What becomes of a message: None drops it; a message, or several, go on; `Late` ones wait.
Interceptor = Callable[[Any], Any]


class Interception:
    """What is done with the messages of one topic, until it is taken away.

    Parameters
    ----------
    line : Line
        The topic within the process.
    kind : message class
    function : callable
        Takes each message as a ROS message, which it may change; see `Interceptor`.
    """

    def __init__(self, line: Line, kind: Any, function: Interceptor) -> None:
        self._line, self._kind, self._function = line, kind, function
        self._waiting: list[list[Any]] = []
        #: What the function has raised, or returned that is no message; the message then passed.
        self.error: Exception | None = None
        #: Messages seen so far, and those that did not go on as they were.
        self.seen = self.changed = 0
        line.intercept = self._pass

    def _pass(self, sent: Sendable) -> Iterator[bytes]:
        raw = serialised(sent)
        self.seen += 1
        try:
            answer = list(self._checked(self._function(deserialize_message(raw, self._kind))))
        except Exception as error:
            self.error = self.error or error
            return iter((raw,))
        due = [each for each in self._waiting if each[0] <= 0]
        self._waiting = [each for each in self._waiting if each[0] > 0]
        out = [bytes(serialize_message(message)) for _, message in due]
        for each in answer:
            if isinstance(each, Late):
                self._waiting.append([each.ticks, each.message])
            else:
                out.append(bytes(serialize_message(each)))
        self.changed += out != [raw]
        return iter(out)

    def _checked(self, answer: Any) -> Iterator[Any]:
        """What the function has returned; TypeError for what is no message of the topic."""
        for each in _several(answer):
            message = each.message if isinstance(each, Late) else each
            if not isinstance(message, self._kind):
                raise TypeError(f"returned {message!r}, which is no {self._kind.__name__}")
            yield each

    def tick(self) -> None:
        """A tick has passed: what waits is due that much sooner, before the next message."""
        for each in self._waiting:
            each[0] -= 1

    def remove(self) -> None:
        """Let everything pass again; what waits is lost."""
        self._line.intercept = None


def _several(answer: Any) -> Iterable[Any]:
    if answer is None:
        return ()
    return answer if isinstance(answer, list | tuple) else (answer,)
