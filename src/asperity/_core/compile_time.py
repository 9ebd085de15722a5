"""Patches of Numba that shorten compilation, and one that shortens a tick.

The first force after an installation waits for about 140 kernels to be compiled. Without these
patches that takes more than twice as long; half of the time goes on

- resolving the same operator on the same types again, at each place and in each round of type
  inference: 23,000 times for 4,000 distinct cases;
- optimising an inner kernel as a module, and again within every kernel that it is linked into,
  although only the code of the one called from Python runs;
- generating machine code for inner kernels, which nothing calls directly;
- two small functions that are called millions of times: the variables of an instruction, and the
  options of a kernel;
- garbage collection with next to no garbage, and events that nothing listens to.

None of them changes a result: wrenches are the same to the bit. `own_parts` may change the last
bits; it saves a fifth of a tick instead of time to compile.

The patches replace private names of Numba. They are applied only to the versions in `TESTED`, and
each one only where the signature that it replaces is as expected; otherwise compilation, or a
tick, takes longer. Measurements: docs/design/compile_cache.md.
"""

from __future__ import annotations

import gc
import inspect
import logging
from collections.abc import Callable
from typing import Any

import numba

TESTED = ("0.68",)
"""Versions of Numba, major and minor, that the patches were tested with."""


def speed_up(version: str = numba.__version__) -> list[str]:
    """Apply the patches; return the names of those that could be applied.

    Parameters
    ----------
    version : str
        Of Numba. None is applied to a version that is not in `TESTED`.
    """
    if ".".join(version.split(".")[:2]) not in TESTED:
        logging.getLogger(__name__).info(
            "Numba %s is not among the tested versions %s: compilation takes longer",
            version,
            ", ".join(TESTED),
        )
        return []
    changes = (
        remember_calls, mark_inner, optimise_once, own_parts, emit_once, list_options,
        list_variables, leave_garbage, tell_listeners,
    )  # fmt: skip
    return [change.__name__ for change in changes if change()]


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


_INNER = "asperity-inner:"
"""How the names of the code libraries of inner kernels begin; the cache on disk keeps them."""
_PACKAGE_SYMBOL = "_ZN8asperity"
"""How the names of compiled functions of this package begin."""


def mark_inner() -> bool:
    """Mark the code libraries of inner kernels by their names."""
    try:
        from numba.core.typed_passes import BaseNativeLowering

        lower = BaseNativeLowering.run_pass
        if list(inspect.signature(lower).parameters) != ["self", "state"]:
            return False
    except (ImportError, AttributeError):
        return False

    def run_pass(self: Any, state: Any) -> Any:
        flags, module = state.flags, state.func_id.modname
        inner = flags.no_cpython_wrapper and flags.no_cfunc_wrapper and not flags.no_compile
        if inner and not flags.nrt and not module.startswith("numba"):
            _refuse_arrays(state)
        if inner and state.library is None and module.startswith("asperity"):
            name = _INNER + state.func_id.func_qualname
            state.library = state.targetctx.codegen().create_library(name)
            state.library.enable_object_caching()
        return lower(self, state)

    setattr(BaseNativeLowering, lower.__name__, run_pass)
    return True


def _refuse_arrays(state: Any) -> None:
    """Refuse an inner kernel that returns an array: the caller would let go what it never held."""
    from numba.core import types
    from numba.core.errors import TypingError

    parts = [state.return_type]
    while parts:
        part = parts.pop()
        parts += list(getattr(part, "types", ()))
        if isinstance(part, types.Array):
            name = f"{state.func_id.modname}.{state.func_id.func_qualname}"
            raise TypingError(f"{name} is an inner kernel: it must not return an array")


def _is_inner(library: Any) -> bool:
    return bool(library.name.startswith(_INNER))


def optimise_once() -> bool:
    """Leave the optimisation of an inner kernel to the kernels that it is linked into."""
    try:
        from numba.core.codegen import CPUCodeLibrary

        optimise: Callable[[Any], None] = CPUCodeLibrary._optimize_final_module
        if list(inspect.signature(optimise).parameters) != ["self"]:
            return False
    except (ImportError, AttributeError):
        return False

    def _optimize_final_module(self: Any) -> None:
        if not _is_inner(self):
            optimise(self)

    setattr(CPUCodeLibrary, optimise.__name__, _optimize_final_module)
    return True


def own_parts() -> bool:
    """Give every function that a kernel is linked from internal linkage.

    Numba leaves inner kernels visible to others. So LLVM has to keep each as it is, with all its
    arguments: seven numbers for every array of a structure, of which most need a few. What is a
    kernel's own can lose arguments that are not needed or always the same, and becomes part of its
    only caller.
    """
    try:
        from llvmlite.binding import Linkage
        from numba.core.codegen import CPUCodeLibrary

        optimise: Callable[[Any], None] = CPUCodeLibrary._optimize_final_module
        shared, own = Linkage.linkonce_odr, Linkage.internal
        if list(inspect.signature(optimise).parameters) != ["self"]:
            return False
    except (ImportError, AttributeError):
        return False

    def _optimize_final_module(self: Any) -> None:
        functions = [f for f in self._final_module.functions if not f.is_declaration]
        if not _is_inner(self) and any(f.name.startswith(_PACKAGE_SYMBOL) for f in functions):
            for function in functions:
                if function.linkage == shared:
                    function.linkage = own
        optimise(self)

    setattr(CPUCodeLibrary, optimise.__name__, _optimize_final_module)
    return True


def emit_once() -> bool:
    """Make no machine code of inner kernels; their bitcode is what others are built from.

    An inner kernel's environment (what its errors are made of) is then known to no machine code
    until a kernel that it is part of has some; so that one's are all set when it is made.
    """
    try:
        from numba import _dynfunc
        from numba.core.codegen import CPUCodeLibrary, JITCPUCodegen
        from numba.core.cpu import CPUContext

        finish = CPUCodeLibrary._finalize_final_module
        executable = CPUContext.get_executable
        serialised = CPUCodeLibrary.serialize_using_object_code
        set_one = JITCPUCodegen.set_env
        hooks = {finish: ["self"], executable: ["self", "library", "fndesc", "env"],
                 serialised: ["self"], set_one: ["self", "env_name", "env"]}  # fmt: skip
        if any(list(inspect.signature(f).parameters) != names for f, names in hooks.items()):
            return False
        steps = (
            CPUCodeLibrary._finalize_dynamic_globals,
            CPUCodeLibrary._verify_declare_only_symbols,
        )
        make, bitcode = _dynfunc.make_function, CPUCodeLibrary.serialize_using_bitcode
    except (ImportError, AttributeError):
        return False

    def _finalize_final_module(self: Any) -> None:
        if not _is_inner(self):
            finish(self)
            return
        for step in steps:
            step(self)
        self._finalized = True

    environments: dict[str, Any] = {}

    def set_env(self: Any, env_name: str, env: Any) -> None:
        environments[env_name] = env
        if self._engine.get_global_value_address(env_name):
            set_one(self, env_name, env)

    def get_executable(self: Any, library: Any, fndesc: Any, env: Any) -> Any:
        library._ensure_finalized()
        if _is_inner(library):
            environments[self.get_env_name(fndesc)] = env
            name = fndesc.qualname.split(".")[-1]
            return make(fndesc.lookup_module(), name, "an inner kernel", 0, env, (library,))
        made = executable(self, library, fndesc, env)
        for variable in library._final_module.global_variables:
            if variable.name in environments:
                library.codegen.set_env(variable.name, environments[variable.name])
        return made

    def serialize_using_object_code(self: Any) -> Any:
        self._ensure_finalized()
        return bitcode(self) if _is_inner(self) else serialised(self)

    setattr(CPUCodeLibrary, finish.__name__, _finalize_final_module)
    setattr(CPUContext, executable.__name__, get_executable)
    setattr(CPUCodeLibrary, serialised.__name__, serialize_using_object_code)
    setattr(JITCPUCodegen, set_one.__name__, set_env)
    return True


def list_options() -> bool:
    """Compare the options of kernels by what is set, not by asking for each by its name."""
    try:
        from numba.core.targetconfig import TargetConfig

        values = TargetConfig.values
        if list(inspect.signature(values).parameters) != ["self"]:
            return False
    except (ImportError, AttributeError):
        return False
    defaults: dict[type, dict[str, Any]] = {}

    def of(self: Any) -> dict[str, Any]:
        kind = type(self)
        if kind not in defaults:
            defaults[kind] = {name: option.default for name, option in kind.options.items()}
        return defaults[kind] | self._values

    setattr(TargetConfig, values.__name__, of)
    return True


def list_variables() -> bool:
    """Find the variables that an instruction names by the types of its parts."""
    try:
        from numba.core.ir import Inst, Var

        find = Inst._rec_list_vars
        if list(inspect.signature(find).parameters) != ["self", "val"]:
            return False
    except (ImportError, AttributeError):
        return False
    kinds: dict[type, int] = {}

    def collect(value: Any, out: list[Any]) -> None:
        kind = kinds.get(type(value))
        if kind is None:
            known = (Var, Inst, (list, tuple), dict)
            kind = next((i for i, of in enumerate(known) if isinstance(value, of)), len(known))
            kinds[type(value)] = kind
        if kind == 0:
            out.append(value)
        elif kind == 1:
            out += value.list_vars()
        elif kind == 2:
            for part in value:
                collect(part, out)
        elif kind == 3:
            for part in value.values():
                collect(part, out)

    def _rec_list_vars(self: Any, val: Any) -> list[Any]:
        out: list[Any] = []
        collect(val, out)
        return out

    setattr(Inst, find.__name__, _rec_list_vars)
    return True


def leave_garbage() -> bool:
    """Collect no garbage while a kernel is compiled: of 30 s that took four."""
    try:
        from numba.core.dispatcher import Dispatcher

        compile_one = Dispatcher.compile
        if list(inspect.signature(compile_one).parameters) != ["self", "sig"]:
            return False
    except (ImportError, AttributeError):
        return False

    def compile(self: Any, sig: Any) -> Any:
        collects = gc.isenabled()
        gc.disable()
        try:
            return compile_one(self, sig)
        finally:
            # Kernels that this one calls were compiled within it, and found it disabled.
            if collects:
                gc.enable()

    setattr(Dispatcher, compile_one.__name__, compile)
    return True


class _Nobody:
    """What stands for an event that nobody listens to."""

    def __enter__(self) -> None:
        return

    def __exit__(self, *_: object) -> None:
        return


def tell_listeners() -> bool:
    """Make no events that nobody listens to, and no log lines that go nowhere."""
    try:
        from numba.core import event, ssa

        tell = (event.trigger_event, event.start_event, event.end_event)
        if any(list(inspect.signature(f).parameters)[:2] != ["kind", "data"] for f in tell):
            return False
        registered, log = event._registered, ssa._logger
    except (ImportError, AttributeError):
        return False
    nobody = _Nobody()

    def if_heard(make: Callable[..., Any]) -> Callable[..., Any]:
        def event_of(kind: str, *args: Any, **named: Any) -> Any:
            # Names without the prefix are made whole by Numba; it does not use them itself.
            unheard = kind.startswith("numba:") and not registered.get(kind)
            return nobody if unheard else make(kind, *args, **named)

        return event_of

    for make in tell:
        setattr(event, make.__name__, if_heard(make))
    if not log.isEnabledFor(logging.DEBUG):
        log.disabled = True  # it would be called half a million times
    return True
