"""How kernels are compiled: with Numba's passes, and code libraries that leave out repeated work.

The first force after an installation waits for 200 to 300 kernels to be compiled. Numba optimises
each of them and makes machine code of it, together with all that it calls, although only the code
of those called from Python runs. Here

- an `InnerLibrary` holds a kernel that only other kernels call: code to be linked into those, after
  the passes that simplify single functions;
- a `KernelLibrary` holds a kernel called from Python, with all functions linked into it as its own;
- a `SeparateLibrary` holds a large kernel that only kernels call: they call its machine code,
  which is made once and by another process than theirs, instead of linking a copy;
- kernels of many functions are optimised at LLVM's first level, which takes half the time of its
  third; their ticks are as fast;
- a call of the same function with the same types is resolved once a kernel, and a constant among
  its arguments has the type of a variable: one copy of a kernel serves all;
- no garbage is collected while kernels are compiled.

Nothing in Numba is replaced: these are compilers and passes as its manual describes them under
"Customizing the Compiler". The libraries override methods that another version of Numba may not
have, so with a version that is not in `TESTED` Numba's own compiler is used. Results then differ in
the last bits at most, but compilation takes twice as long (docs/design/compile_cache.md).
"""

from __future__ import annotations

import functools
import gc
import importlib
import logging
import time
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import binding, ir
from numba.core import event, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.errors import TypingError
from numba.core.typed_passes import NopythonTypeInference
from numba.core.types.misc import unliteral

from asperity._core.shared_compilation import claimed, left_to_others, stop_if_left

TESTED = ("0.68",)
"""Versions of Numba, major and minor, that the libraries were tested with."""
_FIRST_LEVEL: dict[str, Any] = {"opt": 1, "loop_vectorize": False, "slp_vectorize": False}
"""LLVM's first level of optimisation."""
_MANY = 100
"""Functions of a kernel from which on it is optimised at the first level."""


class InnerLibrary(JITCodeLibrary):
    """The code of a kernel that only kernels call, to be linked into those.

    Machine code is made of its environment alone: the variable by which Numba finds what errors
    consist of.
    """

    _final_module: Any
    _environments: list[str]

    def finalize(self) -> None:
        """Link what the kernel calls."""
        variables = self._final_module.global_variables
        self._environments = [v.name for v in variables if v.linkage == binding.Linkage.common]
        super().finalize()

    def _optimize_functions(self, module: Any) -> None:
        """Simplify functions as Numba does, but not those that are only declared."""
        module.data_layout = self._codegen._data_layout
        manager, builder = self._codegen._function_pass_manager(**_FIRST_LEVEL)
        for function in module.functions:
            if not function.is_declaration:
                manager.run(function, builder)

    def _optimize_final_module(self) -> None:
        """Leave this to the kernels that this one is linked into."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True
        self._get_module_for_linking()
        module = self._codegen._create_empty_module(self.name)
        pointer = ir.IntType(8).as_pointer()
        for name in self._environments:
            variable = ir.GlobalVariable(module, pointer, name)
            variable.linkage, variable.initializer = "common", ir.Constant(pointer, None)
        self._final_module = binding.parse_assembly(str(module))
        super()._finalize_final_module()


class KernelLibrary(JITCodeLibrary):
    """The code of a kernel that is called from Python.

    Numba leaves the functions that are linked into a kernel visible to others, so LLVM has to keep
    each with all its arguments: seven numbers for every array. Here they have internal linkage.
    """

    def _optimize_final_module(self) -> None:
        count = 0
        for function in self._final_module.functions:
            if function.is_declaration:
                continue
            count += 1
            if function.linkage == binding.Linkage.linkonce_odr:
                function.linkage = binding.Linkage.internal
        if count < _MANY:
            super()._optimize_final_module()
            return
        manager, builder = self._codegen._module_pass_manager(**_FIRST_LEVEL)
        manager.run(self._final_module, builder)


class SeparateLibrary(KernelLibrary):
    """The code of a kernel that only kernels call, not to be linked into those."""

    _shared_module: Any

    def _get_module_for_linking(self) -> Any:
        """Return nothing to link: callers have declared the function themselves."""
        self._ensure_finalized()
        if self._shared_module is None:
            self._shared_module = binding.parse_assembly(
                str(self._codegen._create_empty_module(self.name))
            )
        return self._shared_module


def _load(module: str, name: str, arguments: Any) -> None:
    """Make the machine code of a separate kernel available to one that calls it."""
    getattr(importlib.import_module(module), name).compile(arguments)


_WAIT = 0.01
"""Time between two looks at a kernel that another process compiles [s]."""
_PATIENCE = 60.0
"""A process that has waited this long for others [s], which may be stopped, shares no more."""


def _is_kernel(called: Any, kind: type[CompilerBase] | None = None) -> bool:
    """Return whether what is called is one of our kernels, of a kind if one is given."""
    compiler = getattr(getattr(called, "_compiler", None), "pipeline_class", None)
    return isinstance(compiler, type) and issubclass(compiler, kind or _Compiler)


class _TypingContext:
    """Numba's typing context, in which calls and attributes of the same types are resolved once.

    A kernel that another process is compiling counts as a call that cannot be resolved yet.
    """

    waited = 0.0
    """How long this process has waited for others [s]."""

    def __init__(self, context: Any) -> None:
        self._context = context
        self._calls: dict[Any, Any] = {}
        self._attributes: dict[Any, Any] = {}
        self._elsewhere: list[Any] = []
        self._helped: set[Any] = set()
        self.needed: dict[Any, Callable[[], None]] = {}
        """What loads the separate kernels that this one calls, directly or not."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a call, or None."""
        if _is_kernel(getattr(func, "dispatcher", None)):
            args = tuple(unliteral(given) for given in args)
        key = (func, args, tuple(kws.items()))
        found = self._calls.get(key)
        if found is None:
            found = self._calls[key] = self._resolve(func, args, kws)
            self._note_separate(getattr(func, "dispatcher", None), args)
        return found

    def _note_separate(self, called: Any, args: Any) -> None:
        """Keep what loads a called kernel if it is separate, else the separate ones it calls."""
        if _is_kernel(called, SeparateCompiler):
            names = (called.py_func.__module__, called.py_func.__qualname__)
            self.needed[names, args] = functools.partial(_load, *names, args)
        elif _is_kernel(called) and args in called.overloads:
            for load in called.overloads[args].reload_init:
                self.needed[load.args[:2], load.args[2]] = load

    def _resolve(self, func: Any, args: Any, kws: Any) -> Any:
        kernel: Any = getattr(func, "dispatcher", None)
        shares = _is_kernel(kernel) and _TypingContext.waited < _PATIENCE
        if not shares or tuple(args) in kernel.overloads:
            return self._context.resolve_function_type(func, args, kws)
        with claimed(kernel) as granted:
            if granted:
                return self._context.resolve_function_type(func, args, kws)
        self._elsewhere.append((func, args, kws))
        raise TypingError(f"{kernel.py_func.__name__} is being compiled by another process")

    def help_others(self) -> bool:
        """Help with one of the kernels that other processes compile, or wait a moment.

        Return False if there is none.
        """
        elsewhere, self._elsewhere = self._elsewhere, []
        for func, args, kws in elsewhere:
            if (func, args) not in self._helped:
                self._helped.add((func, args))
                with left_to_others(func.dispatcher):
                    self._context.resolve_function_type(func, args, kws)
                return True
        if elsewhere:
            time.sleep(_WAIT)
            _TypingContext.waited += _WAIT
        return bool(elsewhere)

    def resolve_getattr(self, typ: Any, attr: str) -> Any:
        """Return the type of an attribute, or None."""
        found = self._attributes.get((typ, attr))
        if found is None:
            found = self._attributes[typ, attr] = self._context.resolve_getattr(typ, attr)
        return found


def _with_room(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function with room for the frames of all that it calls."""
    return function(*arguments)


# CPython keeps frames in pieces of 16 KB, and asks the system for a piece whenever a call crosses
# into it: a million times for all kernels, an eighth of their compilation. One large frame brings
# a piece that has room for all calls within it.
_with_room.__code__ = _with_room.__code__.replace(co_stacksize=1 << 15)


class _InferTypes(NopythonTypeInference):
    """Type inference, after which the library is chosen that the kernel is compiled into."""

    library: type[JITCodeLibrary]

    def run_pass(self, state: Any) -> bool:
        context = state.typingctx
        state.typingctx = shared = _TypingContext(context)
        try:
            changed: bool = _with_room(self._infer, state, shared)
        finally:
            state.typingctx = context
        stop_if_left(state.func_id.modname, state.func_id.func_qualname)
        state.reload_init.extend(shared.needed.values())
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return changed

    def _infer(self, state: Any, shared: _TypingContext) -> bool:
        while True:
            try:
                changed: bool = super().run_pass(state)
            except TypingError:
                if not shared.help_others():
                    raise
            else:
                return changed


@register_pass(mutates_CFG=True, analysis_only=False)
class _InferInnerTypes(_InferTypes):
    _name = "asperity_inner_type_inference"
    library = InnerLibrary

    def run_pass(self, state: Any) -> bool:
        changed = super().run_pass(state)
        if not state.flags.nrt:
            _refuse_arrays(state)
        return changed


@register_pass(mutates_CFG=True, analysis_only=False)
class _InferSeparateTypes(_InferInnerTypes):
    _name = "asperity_separate_type_inference"
    library = SeparateLibrary

    def run_pass(self, state: Any) -> bool:
        state.func_id.unique_id = int(state.pipeline.sources, 16)
        return super().run_pass(state)


@register_pass(mutates_CFG=True, analysis_only=False)
class _InferKernelTypes(_InferTypes):
    _name = "asperity_type_inference"
    library = KernelLibrary


def _refuse_arrays(state: Any) -> None:
    """Refuse an inner kernel that returns an array: the caller would let go what it never held."""
    parts = [state.return_type]
    while parts:
        part = parts.pop()
        parts += list(getattr(part, "types", ()))
        if isinstance(part, types.Array):
            name = f"{state.func_id.modname}.{state.func_id.func_qualname}"
            raise TypingError(f"{name} is an inner kernel: it must not return an array")


class _Compiler(CompilerBase):
    infer: type[_InferTypes]

    def define_pipelines(self) -> list[Any]:
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [
            (self.infer if step is NopythonTypeInference else step, description)
            for step, description in manager.passes
        ]
        manager.finalize()
        return [manager]


class InnerCompiler(_Compiler):
    """Numba's compiler, for kernels that only kernels call."""

    infer = _InferInnerTypes


class KernelCompiler(_Compiler):
    """Numba's compiler, for kernels called from Python."""

    infer = _InferKernelTypes


class SeparateCompiler(InnerCompiler):
    """Numba's compiler, for large kernels that only kernels call by the address of their code.

    Machine code finds them by names, which must be the same in every process: so that a name ends
    with the hash of the sources, in place of Numba's count.
    """

    infer = _InferSeparateTypes
    sources: str
    """Hash of the sources of a kernel, hex digits."""

    @classmethod
    def of(cls, sources: str) -> type[SeparateCompiler]:
        """Return the compiler for a kernel with this hash of its sources."""
        return type(cls.__name__, (cls,), {"sources": sources})


class _LeaveGarbage(event.Listener):
    """Collects no garbage while kernels are compiled, which leave next to none."""

    def __init__(self) -> None:
        self._depth, self._collects = 0, False

    def on_start(self, _: Any) -> None:
        """Stop collecting when the outermost kernel begins."""
        if self._depth == 0:
            self._collects = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, _: Any) -> None:
        """Collect again when it has ended, but not at once all that was made."""
        self._depth -= 1
        if self._depth == 0 and self._collects:
            if gc.get_freeze_count() == 0:  # else a program keeps objects from being collected
                gc.freeze()
                gc.unfreeze()  # all objects are old now
            gc.enable()


event.register("numba:compile", _LeaveGarbage())


def compilers(version: str = numba.__version__) -> tuple[type[CompilerBase], type[CompilerBase]]:
    """Return the compilers for kernels called from Python and for inner ones.

    Parameters
    ----------
    version : str
        Of Numba. If it is not in `TESTED`, they are Numba's own.
    """
    if is_tested(version):
        return KernelCompiler, InnerCompiler
    logging.getLogger(__name__).info(
        "Numba %s is not among the tested versions %s: compilation takes longer",
        version, ", ".join(TESTED),
    )  # fmt: skip
    return Compiler, Compiler


def is_tested(version: str = numba.__version__) -> bool:
    """Return whether the libraries were tested with this version of Numba."""
    return ".".join(version.split(".")[:2]) in TESTED
