"""``rail view`` as a command: what it is given, and how it ends."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from rail_corridor.errors import InputError
from rail_corridor.middleware.discovery import discover_on

from .address import bind, is_loopback

#: Domains whose ports lie within the range of a host's.
MOST_DOMAIN = 232


def view(
    port: Annotated[
        int, typer.Option("--port", help="Port of the page; 0 = any that is free.", metavar="N")
    ] = 8080,
    host: Annotated[
        str,
        typer.Option(
            "--host", help="Address to listen on; others can then reach the page.", metavar="H"
        ),
    ] = "127.0.0.1",
    domain: Annotated[
        int | None,
        typer.Option("--domain", help="ROS domain; that of ROS_DOMAIN_ID by default.", metavar="N"),
    ] = None,
) -> None:
    """Show a running or replayed corridor on a live page, until interrupted."""
    raise typer.Exit(run_view(host, port, domain))


def run_view(host: str, port: int, domain: int | None) -> int:
    """Serve the page until interrupted; returns the exit code.

    Raises
    ------
    InputError
        If the address cannot be served on, or the domain is not valid.
    """
    number = _domain(domain)
    if not 0 <= port <= 65535:
        reason = "must be from 1 to 65535, or 0 for any that is free"
        raise InputError(reason, field="--port", value=port)
    with bind(host, port) as bound:
        discover_on("this")
        try:
            from .bridge import Bridge
            from .web import serve
        except ModuleNotFoundError as error:
            if (error.name or "").partition(".")[0] not in ("nicegui", "fastapi", "uvicorn"):
                raise
            raise InputError(
                "is not installed, and the page is built on it: pip install nicegui",
                field="rail view",
                value=error.name,
            ) from None
        bridge = Bridge(number)
        try:
            _announce(host, bound.getsockname()[1], number)
            serve(bridge, bound, host, number)
        finally:
            bridge.close()
    return 0


def _domain(requested: int | None) -> int:
    field = "--domain" if requested is not None else "ROS_DOMAIN_ID"
    text = str(requested) if requested is not None else os.environ.get("ROS_DOMAIN_ID") or "0"
    if not (text.isdecimal() and int(text) <= MOST_DOMAIN):
        raise InputError(f"must be from 0 to {MOST_DOMAIN}", field=field, value=text)
    return int(text)


def _announce(host: str, port: int, domain: int) -> None:
    shown = f"[{host}]" if ":" in host else host
    print(
        f"rail view: http://{shown}:{port}/ shows ROS domain {domain}; Ctrl-C ends it", flush=True
    )
    if not is_loopback(host):
        print("rail view: who can reach this address can switch equipment off", file=sys.stderr)
