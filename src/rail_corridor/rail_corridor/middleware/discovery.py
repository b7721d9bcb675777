"""Settings of the middleware that a process needs before it initialises ROS."""

from __future__ import annotations

import os
from importlib import resources
from typing import Literal

#: Hosts of the other processes of a corridor -> range of discovery, and profile of the middleware.
#: That for several hosts repairs losses in milliseconds; on one host, where nothing is lost, it
#: only costs. A corridor of one process needs no shared memory.
_SETTINGS = {
    "none": ("LOCALHOST", "fastdds_alone.xml"),
    "this": ("LOCALHOST", "fastdds.xml"),
    "all": ("SUBNET", "fastdds_hosts.xml"),
}


def discover_on(hosts: Literal["none", "this", "all"]) -> None:
    """Limit discovery to this host unless the user, or a split corridor, asks otherwise.

    Parameters
    ----------
    hosts : 'none', 'this' or 'all'
        Where other processes of the corridor are.
    """
    reach, profile = _SETTINGS[hosts]
    path = str(resources.files(__package__) / profile)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", reach)
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", path)
