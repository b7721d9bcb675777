"""``rail view`` in a real browser, and beside a corridor that must not notice it.

The tests of this module share one viewer, and the last two of them a corridor.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.error import HTTPError
from urllib.parse import urlencode, urlsplit
from urllib.request import Request, urlopen

import pytest

from . import waiting
from .browser import Browser, find_browser

if TYPE_CHECKING:
    from .conftest import Rail

pytestmark = pytest.mark.system

#: Between two looks; each costs the viewer an answer.
_LOOK_S = 0.1
until = partial(waiting.until, look_s=_LOOK_S)


@dataclass(frozen=True)
class View:
    """A viewer that runs, and the address of its page."""

    process: subprocess.Popen[str]
    address: str

    def live(self, **asked: Any) -> dict[str, Any]:
        """Return what the page would be told."""
        with urlopen(f"{self.address}live?{urlencode(asked)}", timeout=30.0) as answer:
            message: dict[str, Any] = json.load(answer)
        return message

    def switch(self, node: str, *, on: bool, kind: str = "application/json") -> dict[str, Any]:
        """Ask for equipment to be switched."""
        body = json.dumps({"node": node, "on": on}).encode()
        request = Request(f"{self.address}switch", body, {"Content-Type": kind}, method="POST")
        try:
            with urlopen(request, timeout=30.0) as answer:
                return dict(json.load(answer))
        except HTTPError as error:
            return {"status": error.code, **json.load(error)}


@pytest.fixture(scope="module")
def view(module_rail: Rail) -> View:
    """Return a viewer on a port that is free."""
    process = module_rail.start("view", "--port", 0)
    found = until(lambda: re.search(r"http://\S+/", module_rail.output(process)) or process.poll())
    assert isinstance(found, re.Match), module_rail.errors(process)
    return View(process, found[0])


@pytest.fixture(scope="module")
def corridor(module_rail: Rail) -> subprocess.Popen[str]:
    """Return a corridor at twice real time, in a process for each place."""
    options = ("--rate", 2, "--duration", 600, "--processes", "site")
    return module_rail.start("run", "plain_line", *options)


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    """Return a headless browser."""
    program = find_browser()
    if program is None:
        pytest.skip("no Chromium is installed; on Debian: apt install chromium")
    made = Browser(program, tmp_path / "profile")
    yield made
    made.close()


def test_who_looks_changes_nothing(module_rail: Rail, view: View) -> None:
    assert view.live()["status"] == "waiting"
    second = module_rail.start("view", "--port", urlsplit(view.address).port)
    assert module_rail.finish(second) == 2
    assert "is in use" in module_rail.errors(second)
    run = ("plain_line", "--duration", 5, "--processes", "one")
    scopes = ("/wayside/wrs1/zone1/tx", "/train_a/vrs/tx")
    seen: list[dict[str, Any]] = []

    def look(done: threading.Event) -> None:
        while not done.wait(_LOOK_S):
            for scope in scopes:
                asked = {"train": "train_a", "tab": "scope", "scope": scope, "browser": scope}
                seen.append(view.live(**asked))

    def watched() -> dict[str, Any]:
        done = threading.Event()
        looking = threading.Thread(target=look, args=(done,))
        looking.start()
        try:
            return module_rail.report(*run, "--rate", 2)
        finally:
            done.set()
            looking.join()

    def shown() -> set[str]:
        return {m["scope"]["topic"] for m in seen if "samples" in m.get("scope", {})}

    reports = [watched()]
    while not shown():  # on a busy machine a run may be over before a viewer has found it
        assert len(reports) < 4
        reports.append(watched())
    assert shown() <= set(scopes)
    reports.append(module_rail.report(*run))
    assert [(r["missing_ticks"], r["failures"]) for r in reports] == [(0, [])] * len(reports)
    assert len({report["digest"] for report in reports}) == 1


def test_a_page_follows_a_corridor(view: View, browser: Browser, corridor: object) -> None:
    browser.size(1366, 768)
    browser.open(view.address)
    state = "document.querySelector('.cv')?.dataset"

    def status_is(status: str) -> None:
        browser.until(lambda: browser.value(f"{state}?.status") == status)

    # Trains are in the table, measured, and move; the drawings are made.
    status_is("running")
    browser.until(lambda: re.search(r"train_a\s+\d+\.\d+ km\s+0\.\d\d", browser.text(".cv-table")))
    first = browser.value(f"Number({state}.time)")
    browser.until(lambda: browser.value(f"Number({state}.time)") > first + 0.5)
    drawn = "Number(document.querySelector('.cv-line canvas').dataset.trains)"
    browser.until(lambda: browser.value(drawn) == 1)
    rows = "Number(document.querySelector('.cv-main canvas').dataset.rows)"
    browser.until(lambda: browser.value(rows) > 2)
    assert "Phase ranging" in browser.text(".cv-sensors")

    browser.click(".q-tab", "Scope")
    browser.until(lambda: "960 samples at 4 MS/s" in browser.text(".cv-scope"))
    browser.click(".q-tab", "Faults")
    browser.until(lambda: "/wayside/wrs2" in browser.text(".cv-main"))
    browser.click(".cv-switch:has(.name) .q-btn", "switch off")
    browser.until(lambda: "switch on" in browser.text(".cv-switch"))
    browser.until(lambda: re.search(r"\d+ warning", browser.text(".cv-head")))
    browser.click(".cv-switch .q-btn", "switch on")
    browser.until(lambda: "switch off" in browser.text(".cv-switch"))

    # On a phone nothing is wider than the screen, in dark colours either.
    browser.size(390, 844, phone=True)
    browser.scheme("dark")
    browser.until(lambda: browser.value(f"{state}.dark") == "true")
    for tab in ("Time", "Scope", "Track codes", "Telegrams", "Health", "Faults"):
        browser.click(".q-tab", tab)
        wide = browser.value("document.documentElement.scrollWidth")
        assert wide <= 390, (tab, wide)

    assert browser.errors == []
    hosts = {urlsplit(request).netloc for request in browser.requests}
    assert hosts - {""} == {urlsplit(view.address).netloc}
    # A viewer that does not answer is told, and found again.
    browser.offline(True)
    status_is("lost")
    browser.offline(False)
    status_is("running")


def test_what_vanishes_is_told(
    module_rail: Rail, view: View, corridor: subprocess.Popen[str]
) -> None:
    def card() -> dict[str, Any]:
        message = view.live(train="train_a", browser="c")
        found = [c for c in message.get("cards", ()) if c["topic"] == "/train_a/vrs/channel"]
        return found[0] if found else {"state": ""}

    until(lambda: card()["state"] == "ok")
    until(lambda: "/train_a/vrs" in view.live()["lists"]["equipment"])
    assert "already" in view.switch("/train_a/vrs", on=True)["problem"]
    assert view.switch("/train_a/vrs", on=False)["problem"] == ""
    until(lambda: view.live()["off"] == ["/train_a/vrs"])
    processes = module_rail.processes().items()
    (train,) = (pid for pid, name in processes if name == "rail_train_a")
    os.kill(train, signal.SIGKILL)
    until(lambda: "/train_a/vrs" in view.live()["failed"])
    until(lambda: card()["state"] in ("gone", "stale") and card()["age_s"] > 1.0)

    assert view.switch("/world", on=False)["problem"] == "there is no such equipment to switch"
    assert view.switch("/train_a/vrs", on=False, kind="text/plain")["status"] == 415
    elsewhere = Request(f"{view.address}live", headers={"Host": "elsewhere.example"})
    for wrong in (f"{view.address}live?rows=x", f"{view.address}live?zoom=", elsewhere):
        with pytest.raises(HTTPError) as refused:
            urlopen(wrong)
        assert refused.value.code == 400

    corridor.send_signal(signal.SIGINT)
    until(lambda: view.live()["status"] == "gone")
    view.process.send_signal(signal.SIGTERM)
    assert module_rail.finish(view.process) == 0
    assert module_rail.errors(view.process) == ""
