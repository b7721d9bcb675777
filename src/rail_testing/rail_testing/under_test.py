"""The nodes of a tester: beside the corridor, or in the place of nodes of its own."""

from __future__ import annotations

import contextlib
import textwrap
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from rclpy.node import Node

from rail_corridor.errors import InputError
from rail_corridor.stepped.corridor import SteppedCorridor
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.node import SOFTWARE, CorridorMixin
from rail_msgs_py.topics.tick import DONE

from .adoption import Adoption, Past
from .command_process import CommandProcess, end_all

#: What is wrong with what a node has sent last; empty if nothing is.
Malformed = Callable[[str], str]


class NodeError(RuntimeError):
    """A callback of a node under test has raised."""


@dataclass
class UnderTest:
    """One node that a test has added.

    Attributes
    ----------
    node : rclpy Node
        Once the corridor has started, if it is in this process; until then what makes it.
    process : CommandProcess, optional
        The one that was started for it.
    """

    node: Any
    replaces: str | None
    attach: bool
    command: Sequence[str] | None
    name: str | None
    within_s: float | None
    adoption: Adoption | None = field(default=None, repr=False)
    process: CommandProcess | None = None
    done: Any = field(default=None, repr=False)
    made_by: Any = field(default=None, repr=False)
    sent: int = field(default=0, repr=False)
    #: Whether it was told that it has given no answer.
    told: bool = field(default=False, repr=False)

    @property
    def elsewhere(self) -> bool:
        """Whether it is in another process."""
        return self.node is None


class NodesUnderTest:
    """What a test has added to its corridor."""

    def __init__(self) -> None:
        self._entries: list[UnderTest] = []
        self._past: Past = lambda _: ()

    def add(
        self,
        node: Any,
        replaces: str | None,
        *,
        attach: bool,
        command: Sequence[str] | None,
        name: str | None,
        within_s: float | None,
    ) -> UnderTest:
        """Note a node; see `Corridor.add`."""
        if node is None and command is None and replaces is None and name is None:
            raise ValueError("a node, a command, or the name of what is replaced is needed")
        if node is not None and command is not None:
            raise ValueError("a node or a command, not both")
        if isinstance(command, str):
            raise ValueError(f"a command is a list of words, not {command!r}")
        if node is not None and not callable(node) and not isinstance(node, Node):
            raise TypeError(f"{node!r} is no node, and makes none")
        if within_s is not None and not within_s > 0.0:
            raise ValueError(f"within_s must be above zero, not {within_s!r}")
        if replaces is not None and replaces in self.replaced:
            raise InputError("is replaced already", field="replaces", value=replaces)
        self._entries.append(UnderTest(node, replaces, attach, command, name, within_s))
        return self._entries[-1]

    @property
    def replaced(self) -> tuple[str, ...]:
        """Full names of the nodes of the scenario that are not made."""
        return tuple(entry.replaces for entry in self._entries if entry.replaces)

    @property
    def commands(self) -> tuple[str, ...]:
        """Full names of the nodes of the scenario whose place a process of the test takes."""
        return tuple(e.replaces for e in self._entries if e.replaces and e.command is not None)

    @property
    def awaited(self) -> tuple[str, ...]:
        """Full names of further nodes, in processes of their own, that end a tick."""
        beside = [each for each in self._entries if each.elsewhere and not each.replaces]
        return tuple(each.name for each in beside if each.name is not None and each.attach)

    @property
    def patience(self) -> dict[str, float]:
        """Wall time that a tick waits for those that may be late, by the name of the replaced."""
        return {
            entry.replaces: entry.within_s
            for entry in self._entries
            if entry.replaces and entry.within_s is not None
        }

    def enter(self, session: SteppedCorridor, domain: int, past: Past) -> None:
        """Make the nodes, and connect them with a corridor that has not started."""
        session.patience, self._past = self.patience, past
        for entry in self._entries:
            if entry.command is not None:
                entry.process = CommandProcess(entry.command, domain)
                entry.process.start()
            if entry.node is not None:
                entry.made_by = entry.node if callable(entry.node) else None
                self._bring_in(entry, session)

    def _bring_in(self, entry: UnderTest, session: SteppedCorridor) -> None:
        """Make a node, if it is told how, and let it take part."""
        again = entry.done is not None
        entry.node = self._made(entry, session)
        session.add_node(entry.node, entry.replaces)
        if isinstance(entry.node, CorridorMixin):
            return
        if entry.attach and entry.adoption is None:
            self._adopt(entry, entry.node, session)
        if entry.replaces and not again:
            self._answer_for(entry, entry.replaces, session)

    def process_of(self, name: str) -> CommandProcess | None:
        """The process that was started for a node; None if none was."""
        for entry in self._entries:
            if name == (entry.replaces or entry.name):
                return entry.process
        return None

    def forgive(self, name: str) -> None:
        """Tell once more that a node gives no answer: it has been started anew."""
        for entry in self._entries:
            if name == (entry.replaces or entry.name):
                entry.told = False

    def maker_of(self, name: str, session: SteppedCorridor) -> Callable[[], None] | None:
        """What makes a node of the test anew; None for one of the scenario's own."""
        for entry in self._entries:
            if name != (entry.replaces or entry.name):
                continue
            if entry.made_by is None:
                reason = "was not made here: give its class, or what makes it, to have it restarted"
                raise InputError(reason, field="node", value=name)

            def make(entry: UnderTest = entry) -> None:
                entry.node, entry.adoption = entry.made_by, None
                self._bring_in(entry, session)

            return make
        return None

    def _made(self, entry: UnderTest, session: SteppedCorridor) -> Any:
        """The node itself, made if it is told how."""
        node = entry.node
        if not callable(node):
            return node
        with _default_context(session.context):
            if isinstance(node, type) and issubclass(node, CorridorMixin) and entry.replaces:
                namespace, _, name = entry.replaces.rpartition("/")
                made = node(
                    name,
                    namespace=namespace,
                    context=session.context,
                    parameters=session.spec(entry.replaces).parameters,
                    services=False,
                )
            elif entry.attach and isinstance(node, type) and issubclass(node, Node):
                # Adopted before it begins, so that what it says at once is heard.
                made = object.__new__(node)
                self._adopt(entry, made, session)
                begin: Callable[[], None] = made.__init__
                begin()
            else:
                made = node()
        if hasattr(made, "switch_on"):
            made.switch_on()
        return made

    def _adopt(self, entry: UnderTest, node: Any, session: SteppedCorridor) -> None:
        """Let an ordinary node have its messages in time."""
        entry.adoption = Adoption(node, session.delivery, session.context.tap, self._past)

    def _answer_for(self, entry: UnderTest, name: str, session: SteppedCorridor) -> None:
        """Say on behalf of an ordinary node what it does not know that it has to say."""
        session.announce_ready(name)
        if session.is_sink(name) and entry.attach:
            entry.done = session.observer.publisher(DONE, node=name).send
            session.when_tick_begins(lambda stamp_ns: self._answer(entry, session, stamp_ns))

    @staticmethod
    def _answer(entry: UnderTest, session: SteppedCorridor, stamp_ns: int) -> None:
        """Say that a tick is done once everything of it has been handed over."""
        done = entry.done
        session.delivery.when_idle(lambda: session.call(lambda: done(header_to_cdr(stamp_ns))))

    def after_tick(
        self,
        session: SteppedCorridor,
        killed: Container[str],
        malformed: Malformed = lambda _: "",
    ) -> None:
        """Raise what their callbacks have raised, or that one gives no answer.

        Parameters
        ----------
        session : SteppedCorridor
        killed : container of str
            Nodes that the test itself has ended.
        malformed : callable
            Says what is wrong with what a node has sent last, which nobody could read.
        """
        failures = session.observer.failures
        for entry in self._entries:
            ended = None if entry.process is None else entry.process.ended
            if ended is not None:
                words = textwrap.shorten(" ".join(map(str, entry.command or ())), 160)
                raise NodeError(self._line(entry, session, f"ended with {ended}: {words}"))
            for failed in failures:
                if failed["node"] in (entry.replaces, entry.name):
                    self._raise_failure(entry, failed, session, killed, malformed)
            if entry.adoption is not None and entry.adoption.errors:
                error = entry.adoption.errors.pop(0)
                said = f"{type(error).__name__}: {error}"
                raise NodeError(self._line(entry, session, said)) from error
            self._see_that_it_answers(entry, session, killed)
            if isinstance(entry.node, CorridorMixin):
                health = entry.node.health_of(SOFTWARE)
                if health is not None:
                    raise NodeError(self._line(entry, session, health.message))

    def _see_that_it_answers(
        self, entry: UnderTest, session: SteppedCorridor, killed: Container[str]
    ) -> None:
        """An ordinary node that the bench answers for must have sent something in the tick."""
        if entry.adoption is None or entry.replaces is None or not session.ticks:
            return
        before, entry.sent = entry.sent, entry.adoption.sent
        if entry.sent == before and entry.within_s is None and entry.replaces not in killed:
            said = "has sent nothing in this tick: every tick needs a message on each output"
            raise NodeError(self._line(entry, session, said))

    def _raise_failure(
        self,
        entry: UnderTest,
        failed: Any,
        session: SteppedCorridor,
        killed: Container[str],
        malformed: Malformed,
    ) -> None:
        """Equipment that is given up is no result, unless it may be late or was ended."""
        if entry.told or entry.within_s is not None or failed["node"] in killed:
            return
        entry.told = True
        said = malformed(failed["node"]) or failed["reason"]
        raise NodeError(self._line(entry, session, said))

    @staticmethod
    def _line(entry: UnderTest, session: SteppedCorridor, said: str) -> str:
        name = entry.replaces or entry.name or "the command"
        if entry.node is not None and not entry.replaces:
            name = entry.node.get_fully_qualified_name()
        when = f"at tick {session.ticks - 1}" if session.ticks else "before the first tick"
        return f"{name} {when}: {said}"

    def close(self) -> None:
        """End the processes that were started."""
        end_all(entry.process for entry in self._entries if entry.process is not None)


@contextlib.contextmanager
def _default_context(context: Any) -> Iterator[None]:
    """Let nodes that name no context be made in that of the corridor."""
    from rclpy import utilities

    before = utilities.g_default_context
    utilities.g_default_context = context
    try:
        yield
    finally:
        utilities.g_default_context = before
