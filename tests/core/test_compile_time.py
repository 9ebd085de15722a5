"""What is left out when kernels are compiled does not change what they compute."""

import gc
import os
import subprocess
import sys

import numpy as np
import pytest
from numba.core.compiler import Compiler
from numba.core.errors import TypingError

from asperity._core.compile_time import InnerCompiler, KernelCompiler, compilers
from asperity._core.kernels import inner_kernel, kernel

PARTS = """
import asperity._core.compile_time as compile_time
if {plain}:
    compile_time.TESTED = ()
import asperity._core.kernels
import asperity.geometry.rigid_body as rigid
import numpy as np
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary
rng = np.random.default_rng(3)
pose = np.concatenate([rng.standard_normal(3), [0.5, 0.5, -0.5, 0.5]])
print(rigid.centre_of_mass(pose, rng.standard_normal(3)).tobytes().hex())
for of in (rigid._fill_centre, rigid.fill_lever_arm):
    print(*(type(made.library).__name__ for made in of.overloads.values()))
ours = [m for of in (CPUCodeLibrary, JITCodeLibrary) for m in vars(of).values()
        if getattr(m, "__module__", "numba").startswith("asperity")]
print(ours)
"""


def test_numbers_are_those_of_numbas_own_compiler(tmp_path):
    """And nothing in Numba is replaced."""
    printed = []
    for plain in (False, True):
        done = subprocess.run(
            [sys.executable, "-c", PARTS.format(plain=plain)],
            capture_output=True, text=True, check=True,
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / str(plain))},
        )  # fmt: skip
        printed.append(done.stdout.splitlines())
    assert printed[0][0] == printed[1][0]
    assert printed[0][1:] == ["KernelLibrary", "InnerLibrary", "[]"]
    assert printed[1][1:] == ["JITCodeLibrary", "JITCodeLibrary", "[]"]


@inner_kernel
def _folded(values, by):
    total = values[0] * by
    for i in range(1, values.size):
        total = total + values[i] * by - i // 2
    return total


@kernel
def _of_all_kinds(whole, real, flags):
    # The same operators on whole numbers, floats, truths and tuples, in one kernel.
    pair = (whole[0] + 1, real[0] + 1.0)
    count = 0
    for flag in flags:
        count += flag and pair[0] < pair[1]
    return _folded(whole, 3), _folded(real, 0.5), count, pair[0] * pair[1], -whole[1] % 3


def test_operators_keep_to_the_types_they_are_on():
    whole, real = np.array([1, -5, 7, 9]), np.array([2.25, 0.5, -3.0])
    flags = np.array([True, False, True])
    assert _of_all_kinds(whole, real, flags) == (34, -1.125, 2, 6.5, 2)
    assert _of_all_kinds(real, whole, flags)[:2] == (-1.75, 4.0)


@inner_kernel
def _first_two(values):
    return values[:2], values.size


@kernel
def _of_the_first_two(values):
    part, count = _first_two(values)
    return part[0] + part[1] + count


def test_an_inner_kernel_that_returns_an_array_is_refused():
    """No reference to it would have been counted, and one would be given back."""
    with pytest.raises(TypingError, match="_first_two is an inner kernel: it must not return"):
        _of_the_first_two(np.ones(3))


def printed(name, good, bad, counts, folder):
    """Return what a program prints that calls the kernel `name` of the module `outer_name`.

    Its result for the argument `good`, the error for `bad`, and `counts`; it runs in a folder, and
    keeps its cache there.
    """
    code = (
        f"from outer_{name} import {name}\nimport numpy as np\nprint({name}({good}))\n"
        f"try:\n    {name}({bad})\nexcept ValueError as e:\n    print(e.args)\n{counts}"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=folder,
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


KERNELS = """
from asperity._core.kernels import inner_kernel, kernel
@inner_kernel
def half(n):
    if n % 2:
        raise ValueError("not even")
    return n // 2
@inner_kernel
def quarter(n):
    return half(half(n))
@kernel
def {name}(n):
    return quarter(n) + {more}
"""


def test_inner_kernels_come_from_the_cache_for_others_and_their_errors_with_them(tmp_path):
    """Bitcode of a first program's inner kernels is what a second one's kernel is made from."""
    inner, outer = KERNELS.split("@kernel")
    (tmp_path / "inner_ones.py").write_text(inner)
    head = "from inner_ones import quarter\nfrom asperity._core.kernels import kernel\n@kernel"
    for name, more in (("first", 1), ("second", 2)):
        (tmp_path / f"outer_{name}.py").write_text(head + outer.format(name=name, more=more))
    counts = "import inner_ones; print(sum(inner_ones.quarter._cache_hits.values()))"
    told = [printed(name, "12", "6", counts, tmp_path) for name in ("first", "second", "second")]
    error = "('not even',)"
    # The third finds its own kernel and asks for no inner one.
    assert told == [["4", error, "0"], ["5", error, "1"], ["5", error, "0"]]


SEPARATE = """
from asperity._core.kernels import inner_kernel, separate_kernel
@separate_kernel
def half(n):
    if n % 2:
        raise ValueError("not even")
    return n // 2
@separate_kernel
def total(values):
    s = 0.0
    for v in values:
        s += v
    return s + half(values.size)
@inner_kernel
def between(values):
    return 2.0 * total(values)
"""
SEPARATE_CALLER = """
from separate_ones import between, half
from asperity._core.kernels import kernel
@kernel
def {name}(values):
    return between(values) + half(4) + {more}
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere separate kernels are inner ones")
def test_separate_kernels_are_called_where_they_lie_and_found_again(tmp_path):
    """By kernels of this process or another, from the cache or without their own part of it."""
    (tmp_path / "separate_ones.py").write_text(SEPARATE)
    for name, more in (("first", 1), ("second", 2)):
        (tmp_path / f"outer_{name}.py").write_text(SEPARATE_CALLER.format(name=name, more=more))

    def run(name):
        counts = (
            "from separate_ones import total\nprint(sum(total._cache_hits.values()), "
            f"sum(total._cache_misses.values()), sum({name}._cache_hits.values()))"
        )
        return printed(name, "np.arange(4.0)", "np.ones(3)", counts, tmp_path)

    error = "('not even',)"
    assert run("first") == ["19.0", error, "0 1 0"]
    assert run("second") == ["20.0", error, "1 0 0"]
    assert run("second") == ["20.0", error, "1 0 1"]
    # As after a cache that was tidied, or copied in part.
    removed = [*(tmp_path / "cache").rglob("*.total-*"), *(tmp_path / "cache").rglob("*.half-*")]
    assert len(removed) > 2
    for file in removed:
        file.unlink()
    assert run("second") == ["20.0", error, "0 1 1"]


def test_another_version_of_numba_compiles_with_its_own():
    assert compilers("0.68.9") == (KernelCompiler, InnerCompiler)
    assert compilers("0.99.0") == compilers("0.6") == (Compiler, Compiler)


@pytest.mark.parametrize("is_frozen", [False, True])
def test_garbage_is_collected_again_after_a_kernel(is_frozen):
    # Objects that a program has frozen stay so.
    if is_frozen:
        gc.freeze()
    try:
        kept = 0.9 * gc.get_freeze_count()

        @kernel
        def doubled(x):
            return 2.0 * x

        assert doubled(2.0) == 4.0
        assert gc.isenabled()
        assert gc.get_freeze_count() >= kept
        assert is_frozen or gc.get_freeze_count() == 0
    finally:
        gc.unfreeze()
