"""What every medium has in common: a world that does not describe it is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import make_plan
from rail_msgs_py.parameters import ParameterError
from rail_world.doppler.medium_node import ReferenceMediumNode
from rail_world.track_code.medium_node import RailMediumNode
from rail_world.train_bus.medium_node import BusMediumNode
from rail_world.train_radio.backbone_node import BackboneNode
from rail_world.train_radio.medium_node import CbtcMediumNode


@pytest.mark.parametrize(
    ("kind", "missing"),
    [
        (RailMediumNode, "track_code"),
        (CbtcMediumNode, "train_radio"),
        (BackboneNode, "train_radio"),
        (ReferenceMediumNode, "doppler"),
        (BusMediumNode, "train_bus"),
    ],
)
def test_a_world_without_it_is_one_line(
    graph: Any, tmp_path: Path, kind: Any, missing: str
) -> None:
    make_plan(load_scenario("plain_line"), tmp_path)
    given = {"world_file": str(tmp_path / "world.json")}
    with pytest.raises(ParameterError, match=f"describes no {missing}") as caught:
        kind(context=graph.context, parameters=given, services=False)
    assert "\n" not in str(caught.value)
