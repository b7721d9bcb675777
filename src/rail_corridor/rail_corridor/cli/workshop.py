"""The commands of the workshop, which need no corridor: ``rail tdr``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_file
from .usage import UsageError, check_choice, check_writable

_FIGURES = (".png", ".svg", ".pdf")
_ENDS = ("terminated", "open", "short")


def add_to(app: typer.Typer) -> None:
    """Add the commands to the application."""
    app.command()(tdr)


def tdr(
    trace: Annotated[
        Path,
        typer.Argument(
            help="The trace: CSV, or Touchstone .s1p.",
            metavar="TRACE.csv",
            autocompletion=complete_file,
        ),
    ],
    profile: Annotated[
        str,
        typer.Option(
            "--profile",
            help="Profile of a cable by itself, or of each car of a train: CM2,CM3.",
            metavar="NAME,...",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", help="Draw a figure.", metavar="FIGURE.png")
    ] = None,
    end: Annotated[
        str, typer.Option("--end", help="At the far end: terminated, open, short.", metavar="HOW")
    ] = "terminated",
    node: Annotated[
        bool, typer.Option("--node", help="The one cable ends at a node, as in its car.")
    ] = False,
    rise_ns: Annotated[
        float, typer.Option("--rise-ns", help="Rise time of the edge, 10 to 90 %.", metavar="NS")
    ] = 20.0,
    incident_v: Annotated[
        float | None,
        typer.Option("--incident-v", help="Size of the edge, for traces in volts.", metavar="V"),
    ] = None,
) -> None:
    """Judge a measured reflectogram of a bus cable; exit code 0 pass, 1 fail.

    The CSV has a header: time_s, time_us or time_ns, then reflection, ohms or volts.
    """
    check_choice("--end", end, _ENDS)
    if not 0.1 <= rise_ns <= 1000.0:
        raise UsageError(f"--rise-ns: {rise_ns:g}: must be from 0.1 to 1000")
    if incident_v is not None and not 1e-3 <= incident_v <= 1000.0:
        raise UsageError(f"--incident-v: {incident_v:g}: must be from 0.001 to 1000")
    if out is not None:
        if out.suffix.lower() not in _FIGURES:
            raise UsageError(f"--out: {out}: must end in {', '.join(_FIGURES)}")
        check_writable("--out", out)

    from rich.console import Console

    from rail_corridor.workshop.workshop import Workshop, diagnose, print_diagnosis

    names = tuple(name.strip() for name in profile.split(","))
    workshop = Workshop(names, end, rise_ns * 1e-9, incident_v, node)  # type: ignore[arg-type]
    diagnosis = diagnose(trace, workshop)
    print_diagnosis(diagnosis, workshop, Console())
    if out is not None:
        from rail_corridor.workshop.figure import draw_diagnosis

        draw_diagnosis(diagnosis, out)
        typer.echo(out)
    raise typer.Exit(0 if diagnosis.passed else 1)
