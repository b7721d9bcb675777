"""Settings of the middleware that a process needs before it initialises ROS."""

from __future__ import annotations

import os
from importlib import resources
from typing import Literal

_PROFILE = "fastdds.xml"


def discover_on(hosts: Literal["this", "all"]) -> None:
    """Limit discovery to this host unless the user, or a split corridor, asks otherwise."""
    wide = "SUBNET" if hosts == "all" else "LOCALHOST"
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", wide)
    profile = str(resources.files(__package__) / _PROFILE)
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", profile)
