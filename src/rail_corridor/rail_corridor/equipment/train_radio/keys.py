"""Keys of train control by radio: one for each pair of a train and the zone controller.

Only who plans a run has them all. A train is handed its own, the controller those of its trains
(`rail_corridor.equipment.train_radio.nodes`); base stations, radios, media and the world none.

With a file (``cbtc.keys``, made by ``rail keys``) they are those in it. Without one they are
derived from a root secret by HKDF-SHA256 (RFC 5869), one pair's key telling nothing of another's -
but the root follows from the seed, as every draw does, so that whoever has the scenario can make
them again. Against such a one only a file helps.
"""

from __future__ import annotations

import hashlib
import os
import secrets
from pathlib import Path
from typing import Final

from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF

from rail_corridor.errors import InputError, did_you_mean
from rail_corridor.scenario.model import Scenario
from rail_corridor.yaml_file import load_yaml
from rail_msgs_py.train_radio.safe_frame import SHORTEST_KEY_BYTES
from rail_msgs_py.train_radio.train_channel import CONTROLLER_IDENTITY, key_of

from .section import CBTC

KEY_BYTES: Final = 32
_SALT: Final = b"rail corridor keys of pairs 1"


def pair_keys(scenario: Scenario) -> dict[str, str]:
    """Key of each train and its controller, hexadecimal digits, by the name of the train.

    Raises
    ------
    InputError
        If the file of keys cannot be read, or lacks one, or has one that is none.
    """
    return scenario.derive(_pair_keys)


def _pair_keys(scenario: Scenario) -> dict[str, str]:
    plan = CBTC.of(scenario)
    trains = [train.name for train in scenario.trains]
    if plan is not None and plan.keys is not None:
        return _from_file(Path(plan.keys), trains)
    root = _root(scenario.seed)
    return {name: _derived(root, number) for number, name in enumerate(trains, start=1)}


def _root(seed: int) -> bytes:
    return hashlib.sha256(f"root of the keys of seed {seed}".encode()).digest()


def _derived(root: bytes, train: int) -> str:
    label = f"train {train} and controller {CONTROLLER_IDENTITY}"
    return HKDF(SHA256(), KEY_BYTES, _SALT, label.encode()).derive(root).hex()


def _from_file(path: Path, trains: list[str]) -> dict[str, str]:
    found = load_yaml(path)
    for name in found:
        if name not in trains:
            reason = f"there is no such train{did_you_mean(name, trains)}"
            raise InputError(reason, file=str(path), field=name)
    keys: dict[str, str] = {}
    for name in trains:
        key = found.get(name)
        if key is None:
            raise InputError("a key is needed", file=str(path), field=name)
        reason = _fault(key)
        if not reason and key.lower() in keys.values():
            reason = "is another train's as well"
        if reason:  # the key itself is not shown
            raise InputError(reason, file=str(path), field=name, value="...")
        keys[name] = key.lower()
    return keys


def _fault(key: object) -> str:
    """What is wrong with a key; empty if nothing."""
    if not isinstance(key, str):
        return f"must be text of {2 * SHORTEST_KEY_BYTES} hexadecimal digits or more, in quotes"
    try:
        key_of(key)
    except ValueError as error:
        return str(error).removeprefix("secret: ")
    return ""


def write_keys(scenario: Scenario, path: Path) -> int:
    """Draw a key for each pair and write them to a new file that only its owner may read.

    Returns
    -------
    int
        How many.

    Raises
    ------
    InputError
        If trains have no train control by radio, or the file is there already.
    """
    if CBTC.of(scenario) is None:
        raise InputError("has no train control by radio, which keys are for", field="cbtc")
    lines = [f'{train.name}: "{secrets.token_hex(KEY_BYTES)}"\n' for train in scenario.trains]
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise InputError("is there already, and is not overwritten", file=str(path)) from None
    except OSError as error:
        raise InputError(error.strerror or "cannot be written", file=str(path)) from None
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write("# Keys of each train and the zone controller; secret.\n")
        file.writelines(lines)
    return len(lines)
