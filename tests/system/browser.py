"""A real browser without a window, driven by its own debugging protocol (CDP).

Chromium is started on a profile of its own, and told what to do over a pair of pipes: no driver
between, no port, and every request that a page makes is seen.
"""

from __future__ import annotations

import base64
import itertools
import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-dev-shm-usage", "--remote-debugging-pipe", "--mute-audio"),
)
#: The browser reads commands from its descriptor 3 and writes answers to 4.
_START = (
    "import os, sys; os.dup2(int(sys.argv[1]), 3); os.dup2(int(sys.argv[2]), 4);"
    "os.execv(sys.argv[3], sys.argv[3:])"
)
_PATIENCE_S = 60.0


def find_browser() -> str | None:
    """Return the path of an installed browser, None if there is none.

    A program that only asks for a snap, as Ubuntu has under these names, is none.
    """
    return next((path for path in map(shutil.which, NAMES) if path and _tells_version(path)), None)


def _tells_version(program: str) -> bool:
    try:
        told = subprocess.run(
            [program, "--version"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_PATIENCE_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return told.returncode == 0


class Browser:
    """One page in one browser."""

    def __init__(self, program: str, profile: Path) -> None:
        (theirs_in, mine_out), (mine_in, theirs_out) = os.pipe(), os.pipe()
        self._process = subprocess.Popen(
            [
                *(sys.executable, "-ISc", _START, str(theirs_in), str(theirs_out)),
                *(program, *FLAGS, f"--user-data-dir={profile}", "about:blank"),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(theirs_in, theirs_out),
            env={**os.environ, "HOME": str(profile)},
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._in, self._out, self._held = mine_in, mine_out, b""
        self._numbers = itertools.count(1)
        self._session: dict[str, str] = {}
        #: Addresses that the page has asked for, and what has gone wrong in it.
        self.requests: list[str] = []
        self.errors: list[str] = []
        pages = self.until(
            lambda: [
                t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page"
            ]
        )
        target = pages[0]["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = {"sessionId": attached["sessionId"]}
        for domain in ("Page", "Network", "Runtime"):
            self.call(f"{domain}.enable")

    def open(self, address: str) -> None:
        """Go to a page."""
        self.call("Page.navigate", url=address)

    def size(self, width: int, height: int, *, phone: bool = False) -> None:
        """Give the page the size of a screen [CSS pixels]."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=2 if phone else 1,
            mobile=phone,
        )

    def scheme(self, name: str) -> None:
        """Prefer light or dark colours, as the system of a user does."""
        self.call(
            "Emulation.setEmulatedMedia",
            features=[{"name": "prefers-color-scheme", "value": name}],
        )

    def offline(self, off: bool) -> None:
        """Take the page off the network, or back to it."""
        self.call(
            "Network.emulateNetworkConditions",
            offline=off,
            latency=0,
            downloadThroughput=-1,
            uploadThroughput=-1,
        )

    def value(self, expression: str) -> Any:
        """Return the value of a JavaScript expression, awaited if it is a promise."""
        found = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def text(self, selector: str) -> str:
        """Return the text of an element, empty if there is none."""
        quoted = json.dumps(selector)
        return str(self.value(f"document.querySelector({quoted})?.innerText ?? ''"))

    def click(self, selector: str, words: str = "") -> None:
        """Click on the first element of a kind that holds some words."""
        quoted = f"{json.dumps(selector)}, {json.dumps(words)}"
        found = self.value(
            "((kind, words) => { const all = [...document.querySelectorAll(kind)];"
            " const one = all.find((e) => e.innerText.includes(words)); one?.click();"
            f" return Boolean(one); }})({quoted})"
        )
        assert found, f"no {selector} with {words!r}"

    def until(self, condition: Callable[[], Any], patience_s: float = _PATIENCE_S) -> Any:
        """Return what a condition gives once it is true; fail after a long time."""
        deadline_s = time.monotonic() + patience_s
        while not (value := condition()):
            assert time.monotonic() < deadline_s, f"waited {patience_s} s in vain"
            self._listen(0.1)
        return value

    def picture(self, path: Path, *, whole: bool = False) -> None:
        """Write what the page looks like as PNG."""
        found = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(found["data"]))

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol and return its result."""
        number = next(self._numbers)
        command = {"id": number, "method": method, "params": parameters, **self._session}
        os.write(self._out, json.dumps(command).encode() + b"\0")
        while True:
            message = self._receive(_PATIENCE_S)
            assert message is not None, f"{method}: no answer within {_PATIENCE_S} s"
            if message.get("id") == number:
                assert "error" not in message, (method, message["error"])
                result: dict[str, Any] = message["result"]
                return result
            self._note(message)

    def close(self) -> None:
        """End the browser and everything it has started."""
        self._session = {}
        try:
            self.call("Browser.close")
            self._process.wait(timeout=10.0)
        except Exception:
            self._process.kill()
        self._process.wait()
        os.close(self._in)
        os.close(self._out)

    def _listen(self, patience_s: float) -> None:
        """Take what the browser says by itself."""
        message = self._receive(patience_s)
        if message is not None:
            self._note(message)

    def _receive(self, patience_s: float) -> dict[str, Any] | None:
        """Return the next message, None if none comes in time."""
        deadline_s = time.monotonic() + patience_s
        while b"\0" not in self._held:
            left_s = max(0.0, deadline_s - time.monotonic())
            if not select.select([self._in], [], [], left_s)[0]:
                return None
            read = os.read(self._in, 1 << 20)
            assert read, "the browser has ended"
            self._held += read
        text, _, self._held = self._held.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        return message

    def _note(self, message: dict[str, Any]) -> None:
        parameters = message.get("params", {})
        if message.get("method") == "Network.requestWillBeSent":
            self.requests.append(parameters["request"]["url"])
        elif message.get("method") == "Network.webSocketCreated":
            self.requests.append(parameters["url"])
        elif message.get("method") == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(parameters["exceptionDetails"])[:500])
        elif message.get("method") == "Runtime.consoleAPICalled" and parameters["type"] == "error":
            self.errors.append(json.dumps(parameters["args"])[:500])
