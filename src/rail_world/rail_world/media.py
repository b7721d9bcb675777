"""How a medium gets to know its part of the world."""

from __future__ import annotations

from rail_msgs_py.parameters import ParameterError

from .world_file import Part, WorldFile, read_world_file


def read_part(path: str, name: str, kind: type[Part]) -> tuple[WorldFile, Part]:
    """World file, and the part of it that the media of one kind of equipment know.

    Raises
    ------
    ParameterError
        If it has no such part.
    """
    world = read_world_file(path)
    try:
        return world, world.part(name, kind)
    except LookupError as error:
        raise ParameterError(f"world_file: {path}: {error}") from None
