"""Two things that Numba does again and again when it compiles, done once.

The first force after an installation waits for about 120 kernels to be compiled. A third of that
went on

- finding out what an operator on the same types means: asked anew at each place and in each
  round of type inference, 23,000 times in 4,000 cases;
- optimising inner kernels as wholes: each is optimised once more within every kernel that it
  becomes part of, up to the one that is called from Python, and only that one's code is run.

Neither changes what is computed: the wrenches are the same to the bit. Both rest on Numba's inner
names; where these are not as expected, nothing is done, and compiling takes longer.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any


def speed_up() -> list[str]:
    """Make Numba compile faster from now on; return the names of what could be done."""
    return [change.__name__ for change in (remember_calls, optimise_once) if change()]


def remember_calls() -> bool:
    """Have a function's signature for the same types be looked up once a kernel."""
    try:
        from numba.core.targetconfig import ConfigStack
        from numba.core.types.functions import BaseFunction

        find = BaseFunction.get_call_type
        if list(inspect.signature(find).parameters) != ["self", "context", "args", "kws"]:
            return False
        ConfigStack.top_or_none()
    except (ImportError, AttributeError):
        return False
    known: dict[Any, Any] = {}
    of: list[Any] = [None]

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        # What is found depends on the options of the kernel that is being compiled.
        options = ConfigStack.top_or_none()
        if of[0] is not options:
            known.clear()
            of[0] = options
        key = (self, context, args, tuple(kws.items()))
        try:
            found = known.get(key)
        except TypeError:  # something that cannot be hashed
            return find(self, context, args, kws)
        if found is None:
            found = find(self, context, args, kws)
            if of[0] is options:  # no other kernel was compiled meanwhile
                known[key] = found
        return found

    setattr(BaseFunction, find.__name__, get_call_type)
    return True


def optimise_once() -> bool:
    """Leave the optimisation of a module that only other kernels of ours call to these."""
    try:
        from numba.core.codegen import CPUCodeLibrary

        optimise: Callable[[Any], None] = CPUCodeLibrary._optimize_final_module
        if list(inspect.signature(optimise).parameters) != ["self"]:
            return False
    except (ImportError, AttributeError):
        return False

    def _optimize_final_module(self: Any) -> None:
        own = [
            function.name
            for function in self._final_module.functions
            if not function.is_declaration and function.linkage.name == "external"
        ]
        inner = any("asperity" in name for name in own)
        # Only what is called from elsewhere than kernels has such a wrapper.
        if not inner or any("cpython" in name or "cfunc" in name for name in own):
            optimise(self)

    setattr(CPUCodeLibrary, optimise.__name__, _optimize_final_module)
    return True
