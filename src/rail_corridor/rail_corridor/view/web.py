"""The page and its messages over HTTP; everything it is made of is served from here."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson
import uvicorn
from fastapi import FastAPI, Request, Response
from fastapi.middleware.trustedhost import TrustedHostMiddleware
from fastapi.staticfiles import StaticFiles
from nicegui import ui

from .address import is_loopback
from .bridge import Bridge
from .frame import Asked

STATIC = Path(__file__).parent / "static"
#: Wall time between two rounds of reading: as often as a browser asks.
POLL_S = 0.2
_NO_STORE = {"Cache-Control": "no-store"}


class CorridorView(ui.element, component="static/corridor_view.js"):
    """The whole page; it asks for messages by itself and draws them."""


def make_app(bridge: Bridge, host: str, domain: int) -> FastAPI:
    """Web application of one bridge."""
    app = FastAPI(openapi_url=None)
    if is_loopback(host) and ":" not in host:
        # Another site cannot make a browser read this page under a name of its own.
        names = ["localhost", "127.0.0.1", host]
        app.add_middleware(TrustedHostMiddleware, allowed_hosts=names)

    @app.get("/live")
    async def live(request: Request) -> Response:
        """Everything that has changed since the browser last asked."""
        values = request.query_params
        try:
            asked = _asked(values)
        except ValueError as error:
            return _json({"problem": str(error)}, 400)
        return _json(bridge.frame(values.get("browser", ""), asked) | {"domain": domain})

    @app.post("/switch")
    async def switch(request: Request) -> Response:
        """Switch equipment off or on."""
        # A form of another site cannot send this type without being asked first.
        if not request.headers.get("content-type", "").startswith("application/json"):
            return _json({"problem": "application/json expected"}, 415)
        try:
            wanted = orjson.loads(await request.body())
            node, on = str(wanted["node"]), bool(wanted["on"])
        except (ValueError, KeyError, TypeError):
            return _json({"problem": "node and on expected"}, 400)
        problem = await asyncio.to_thread(bridge.switch, node, on=on)
        return _json({"problem": problem, "node": node, "on": on}, 409 if problem else 200)

    app.mount("/assets", StaticFiles(directory=STATIC), name="assets")

    @ui.page("/", title="Rail corridor")
    def page() -> None:
        ui.add_head_html('<link rel="stylesheet" href="/assets/view.css">')
        ui.colors(primary="#0072B2", negative="#B93A12", positive="#00795A")
        ui.query(".nicegui-content").style("padding: 0; gap: 0")
        CorridorView().style("width: 100%")

    ui.run_with(
        app,
        title="Rail corridor",
        dark=None,
        favicon="🚆",
        tailwind=False,
        binding_refresh_interval=None,
        message_history_length=0,
        show_welcome_message=False,
        gzip_middleware_factory=None,
        reconnect_timeout=30.0,
    )
    return app


def serve(bridge: Bridge, bound: socket.socket, host: str, domain: int) -> None:
    """Serve until SIGINT or SIGTERM."""
    config = uvicorn.Config(
        make_app(bridge, host, domain),
        log_level="warning",
        access_log=False,
        # Browsers stay connected: they are not waited for.
        timeout_graceful_shutdown=1,
    )
    asyncio.run(_serve(_Server(config), bridge, bound))


async def _serve(server: _Server, bridge: Bridge, bound: socket.socket) -> None:
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, server.end)
    reading = asyncio.create_task(_read(bridge))
    try:
        await server.serve(sockets=[bound])
    finally:
        reading.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await reading


async def _read(bridge: Bridge) -> None:
    """Read the topics indefinitely, at a steady pace."""
    loop = asyncio.get_running_loop()
    due_s = loop.time()
    while True:
        bridge.poll()
        due_s = max(due_s + POLL_S, loop.time() + 0.25 * POLL_S)
        await asyncio.sleep(due_s - loop.time())


class _Server(uvicorn.Server):
    """Leaves the signals to who runs it: to be interrupted is how a viewer ends."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield

    def end(self) -> None:
        """Stop serving."""
        self.should_exit = True


def _asked(values: Any) -> Asked:
    """What a browser asks for.

    Raises
    ------
    ValueError
        If a value is not a number; the line quotes it.
    """
    fields: dict[str, Any] = {}
    for name, default in Asked.__dataclass_fields__.items():
        if name in values:
            text = values[name]
            fields[name] = text if isinstance(default.default, str) else int(text)
    return Asked(**fields)


def _json(message: Any, status: int = 200) -> Response:
    body = orjson.dumps(message, option=orjson.OPT_SERIALIZE_NUMPY)
    return Response(body, status, _NO_STORE, "application/json")
