"""``python -m rail_testing.conformance``: as ``rail conformance``."""

from __future__ import annotations

import typer

from rail_corridor.cli.main import run_application

from .command import conformance

application = typer.Typer(pretty_exceptions_enable=False)
application.command()(conformance)

if __name__ == "__main__":
    run_application(application)
