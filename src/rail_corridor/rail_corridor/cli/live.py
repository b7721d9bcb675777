"""``rail topics``, ``rail echo``, ``rail hz``, ``rail plot``: a corridor looked into."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from .completion import complete_file, complete_recording, complete_topic, complete_trace
from .usage import UsageError, check_choice, check_library, check_writable

_FORMATS: tuple[Literal["text", "csv", "json"], ...] = ("text", "csv", "json")
_PICTURES = (".png", ".svg", ".pdf")
TopicArgument = Annotated[
    str,
    typer.Argument(
        help="Absolute name of a topic.", metavar="TOPIC", autocompletion=complete_topic
    ),
]


def add_to(app: typer.Typer) -> None:
    """Add the commands to an application."""
    app.command()(topics)
    app.command()(echo)
    app.command()(hz)
    app.command()(plot)


def topics() -> None:
    """List the topics of the running corridor, and what they carry."""
    from .live_tools import list_topics

    raise typer.Exit(list_topics())


def echo(
    topic: TopicArgument,
    field: Annotated[
        str | None,
        typer.Option(
            "--field",
            help="Only these: columns of a table (of one row as row.column), attributes of a "
            "view as range_m, or with --raw paths as header.stamp.sec.",
            metavar="A,B",
        ),
    ] = None,
    row: Annotated[
        str | None, typer.Option("--row", help="Only this row of a table.", metavar="NAME")
    ] = None,
    where: Annotated[
        str | None,
        typer.Option(
            "--where",
            help="Only messages, or rows, for which this holds: comparisons of fields, numbers "
            "and 'strings', with and, or, not.",
            metavar="'A > 3'",
        ),
    ] = None,
    every: Annotated[
        int, typer.Option("--every", help="Each N-th message of those.", metavar="N")
    ] = 1,
    count: Annotated[
        int | None,
        typer.Option("--count", help="Stop after so many messages shown.", metavar="N"),
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Stop after one message.")] = False,
    form: Annotated[
        str | None, typer.Option("--format", help="text, csv or json.", metavar="FORM")
    ] = None,
    raw: Annotated[bool, typer.Option("--raw", help="Show the message as it is.")] = False,
) -> None:
    """Show the messages of a topic, decoded; or chosen fields of chosen messages."""
    for option, number in (("--every", every), ("--count", count)):
        if number is not None and number < 1:
            raise UsageError(f"{option}: {number}: must be at least 1")
    chosen = check_choice("--format", form, _FORMATS) or "text"
    check_topic(topic)
    from .filters import Filter
    from .selection import Selection, field_names_in

    selection = Selection(
        () if field is None else field_names_in(field),
        row,
        None if where is None else Filter(where),
        every,
        1 if once else count,
        chosen,
        raw,
    )
    from .live_tools import echo_topic

    raise typer.Exit(echo_topic(topic, selection))


def hz(topic: TopicArgument) -> None:
    """Show how often a topic is published, in wall and in simulated time."""
    check_topic(topic)
    from .live_tools import topic_rate

    raise typer.Exit(topic_rate(topic))


def plot(
    traces: Annotated[
        list[str],
        typer.Argument(
            help="What is drawn, as /train_a/odometer.speed_mps; of a table with several rows "
            "TOPIC.row.column, or all of them.",
            metavar="TOPIC.FIELD...",
            autocompletion=complete_trace,
        ),
    ],
    recording: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="From a recording; otherwise from the corridor that is running.",
            metavar="FILE.mcap",
            autocompletion=complete_recording,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="A picture, instead of dots in the terminal.",
            metavar="FILE.png",
            autocompletion=complete_file,
        ),
    ] = None,
    last: Annotated[
        float,
        typer.Option("--last", help="Simulated time that the terminal shows live.", metavar="S"),
    ] = 60.0,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds",
            help="End a live plot after so much simulated time; otherwise Ctrl-C does.",
            metavar="S",
        ),
    ] = None,
) -> None:
    """Draw fields over simulated time, one panel for each unit: live, or of a recording."""
    for option, value in (("--last", last), ("--seconds", seconds)):
        if value is not None and not 0.0 < value <= 1e6:
            raise UsageError(f"{option}: {value}: must be above 0, at most 1e6 s")
    if recording is not None and seconds is not None:
        raise UsageError("--seconds: of a recording everything is drawn")
    if out is not None:
        if out.suffix.lower() not in _PICTURES:
            raise UsageError(f"--out: {out}: must end in {', '.join(_PICTURES)}")
        check_writable("--out", out)
    if recording is not None:
        check_library()
    from .plots import PlotOptions, plot_live, plot_recording
    from .series import traces_in

    wanted = [trace for text in traces for trace in traces_in(text)]
    if recording is not None:
        raise typer.Exit(plot_recording(wanted, recording, out))
    raise typer.Exit(plot_live(wanted, PlotOptions(out, last, seconds)))


def check_topic(topic: str) -> None:
    """Raise UsageError for what cannot be the absolute name of a topic."""
    if not topic.startswith("/"):
        raise UsageError(f"{topic}: must be an absolute name, as /{topic}")
