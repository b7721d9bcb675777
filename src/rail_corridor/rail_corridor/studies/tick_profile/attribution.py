"""Whose a sample is: the kind of node whose callback is under way, and the stage of its leaf."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Final, Literal, NamedTuple

Stage = Literal["transport", "arithmetic", "interpreter"]
STAGES: Final[tuple[Stage, ...]] = ("transport", "arithmetic", "interpreter")
#: Kind of what is under way for no node in particular.
TRANSPORT: Final = "transport"

_ARITHMETIC: Final = {"rail_signals", "numpy", "scipy"}
_TRANSPORT: Final = {"rail_msgs_py", "rclpy", "rpyutils"}
_DELIVERY: Final = "rail_msgs_py.delivery"
#: Spins the executor, whose own code is compiled.
_LAUNCHER: Final = "rail_corridor.run.launcher"
#: What works for whoever calls it, as compiled kernels' dispatchers do.
_OF_THE_CALLER: Final = {"", "numba", "llvmlite"} | sys.stdlib_module_names


def stage_of(module: str) -> Stage | None:
    """Stage of a frame by its module, None for one that works for its caller.

    Transport is what brings messages from node to node: rail_msgs_py and the middleware.
    Arithmetic is rail_signals, NumPy, SciPy, and what rail_world computes: media, kernels, motion.
    The rest is the nodes' own Python.

    >>> stage_of("rail_msgs_py.delivery"), stage_of("rail_world.ranging.path_kernels")
    ('transport', 'arithmetic')
    >>> stage_of("rail_world.ranging.medium_node"), stage_of("functools")
    ('interpreter', None)
    """
    package = module.partition(".")[0]
    if package in _OF_THE_CALLER:
        return None
    if package in _TRANSPORT or module == _LAUNCHER or package.endswith(("_msgs", "_interfaces")):
        return "transport"
    computes = package == "rail_world" and not module.endswith("_node")
    return "arithmetic" if computes or package in _ARITHMETIC else "interpreter"


def modules_by_file() -> dict[str, str]:
    """Names of the modules that are loaded, by their files."""
    loaded = list(sys.modules.items())
    return {file: name for name, module in loaded if (file := getattr(module, "__file__", None))}


class Attribution(NamedTuple):
    """Whose a sample is; ``begin`` is the index of the first frame of the callback, or -1."""

    kind: str
    stage: Stage
    begin: int


class Attributor:
    """Attributes stacks to kinds of nodes and stages.

    Parameters
    ----------
    kinds : mapping
        Kind of node by the module, or package, that its callbacks begin in.
    modules : mapping
        Name of the module by its file.
    """

    def __init__(self, kinds: Mapping[str, str], modules: Mapping[str, str]) -> None:
        self._kinds, self._modules = kinds, modules

    def attribute(self, files: Sequence[str], reader: str = "") -> Attribution:
        """Whose a stack is.

        Parameters
        ----------
        files : sequence of str
            Of its functions, the root first.
        reader : str
            Module of the node that is being handed a message: what is done for it before and after
            its callback.
        """
        modules = [self._modules.get(file, "") for file in files]
        stages = (stage_of(module) for module in reversed(modules))
        stage: Stage = next((stage for stage in stages if stage is not None), "interpreter")
        for begin, module in enumerate(modules):
            kind = kind_of(module, self._kinds)
            if kind is not None:
                return Attribution(kind, stage, begin)
        kind = kind_of(reader, self._kinds)
        if kind is not None and _DELIVERY in modules:
            return Attribution(kind, stage, modules.index(_DELIVERY))
        return Attribution(TRANSPORT, stage, -1)


def kind_of(module: str, kinds: Mapping[str, str]) -> str | None:
    """Kind of node by the module, or a package around it; None if it is of none.

    >>> kind_of("rail_corridor.report.intake", {"rail_corridor.report": "report"})
    'report'
    """
    while module and module not in kinds:
        module = module.rpartition(".")[0]
    return kinds.get(module)
