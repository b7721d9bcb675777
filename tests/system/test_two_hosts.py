"""Wayside and trains apart: the digest is that of one host, also where packets are lost."""

from __future__ import annotations

import importlib
import signal
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory

    from .conftest import Rail

pytestmark = pytest.mark.system
ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ("plain_line", "--duration", "3")


def whole(corridor: CorridorFactory) -> str:
    """Return the digest of one host."""
    return corridor("plain_line", duration_s=3.0).run_to_end().digest


#: Of packets, either way.
LOSS = 0.01


@pytest.fixture
def two_hosts(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the study of two hosts."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("two_hosts")


def test_two_halves_give_the_digest_of_one_run(rail: Rail, corridor: CorridorFactory) -> None:
    onboard = rail.start("run", *SCENARIO, "--only", "onboard")
    halves = rail.report(*SCENARIO, "--only", "wayside")
    if onboard.poll() is None:
        onboard.send_signal(signal.SIGINT)
    rail.finish(onboard)
    assert halves["digest"] == whole(corridor)
    assert halves["complete"] and halves["failures"] == [] and halves["missing_ticks"] == 0


def test_a_lossy_network_between_two_hosts_changes_nothing(
    rail: Rail, two_hosts: ModuleType, corridor: CorridorFactory
) -> None:
    lossy_link = importlib.import_module("lossy_link")
    try:
        row = two_hosts.run_two_hosts(
            # Paced, so that losses of discovery are repaired before the trains' half ends.
            [*SCENARIO, "--rate", "0.2", "--processes", "one"],
            LOSS,
            patience_s=60.0,
            environment=rail.environment,
        )
    except lossy_link.NoLinkError as error:
        pytest.skip(f"this machine permits no lossy link: {error}")
    assert row["digest"] == whole(corridor)
    assert row["complete"] and row["failures"] == [] and row["missing_ticks"] == 0
    # The wire itself says what it carried and lost: several waveforms a tick, each of some packets.
    assert row["packets"] > 30 * 20
    assert 0.5 * LOSS < row["dropped"] / row["packets"] < 2.0 * LOSS
