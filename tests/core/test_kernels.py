"""The compile cache must never return machine code of older sources."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SOURCES = Path(__file__).resolve().parents[2] / "src" / "asperity"


def run(package, cache):
    environment = os.environ | {"PYTHONPATH": str(package.parent), "NUMBA_CACHE_DIR": str(cache)}
    code = "from asperity.caller import outer; print(outer(1.0), outer._cache.cache_path)"
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    value, folder = done.stdout.split()
    return float(value), folder


@pytest.fixture
def package(tmp_path):
    package = tmp_path / "asperity"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "_core").mkdir()
    for name in (
        "__init__.py", "kernels.py", "compile_time.py", "shared_compilation.py", "file_lock.py",
        "cores.py",
    ):  # fmt: skip
        (package / "_core" / name).write_text((SOURCES / "_core" / name).read_text())
    return package


def test_an_edit_of_a_callee_in_another_file_is_seen(package, tmp_path):
    (package / "callee.py").write_text(
        "from asperity._core.kernels import kernel\n@kernel\ndef inner(x):\n    return x + 1.0\n"
    )
    (package / "caller.py").write_text(
        "from asperity._core.kernels import kernel\nfrom asperity.callee import inner\n"
        "@kernel\ndef outer(x):\n    return 10.0 * inner(x)\n"
    )
    first, old = run(package, tmp_path / "cache")
    again, same = run(package, tmp_path / "cache")
    assert (first, again, same) == (20.0, 20.0, old)
    callee = package / "callee.py"
    # Of another length: by that and by the second Python tells whether its bytecode is of it.
    callee.write_text(callee.read_text().replace("+ 1.0", "+ 2.000"))
    edited, new = run(package, tmp_path / "cache")
    assert new != old
    assert edited == 30.0


def test_the_same_sources_elsewhere_are_not_compiled_again(package, tmp_path):
    """Another clone, or a wheel in another environment."""
    (package / "caller.py").write_text(
        "from asperity._core.kernels import kernel\n@kernel\ndef outer(x):\n    return 3.0 * x\n"
    )
    elsewhere = tmp_path / "elsewhere" / "asperity"
    shutil.copytree(package, elsewhere)
    first = run(package, tmp_path / "cache")

    def written():
        return {f: f.stat().st_mtime_ns for f in (tmp_path / "cache").rglob("*.nb[ic]")}

    made = written()
    assert len(made) == 2
    assert run(elsewhere, tmp_path / "cache") == first
    assert written() == made


def test_other_fields_of_a_structure_are_seen_by_kernels_that_do_not_import_it(package, tmp_path):
    """Fields are known by their number; and a structure is found again by name and place."""
    (package / "callee.py").write_text(
        "from asperity._core.kernels import kernel\n"
        "@kernel\ndef first(pair):\n    return pair.one\n"
    )
    caller = package / "caller.py"
    caller.write_text(
        "from asperity._core.kernels import kernel\nfrom asperity.callee import first\n"
        "from asperity.pair import Pair\n"
        "@kernel\ndef inner(pair):\n    return first(pair)\n"
        "class outer:\n"
        "    _cache = first._cache\n"
        "    def __new__(cls, x):\n        return inner(Pair(one=x, two=-x))\n"
    )
    pair = package / "pair.py"
    pair.write_text(
        "from typing import NamedTuple\nclass Pair(NamedTuple):\n    one: float\n    two: float\n"
    )
    first, old = run(package, tmp_path / "cache")
    assert first == 1.0
    pair.write_text(pair.read_text().replace("    two", '    "Of two."\n    two'))
    told, same = run(package, tmp_path / "cache")
    assert (told, same) == (1.0, old)
    pair.write_text(
        "from typing import NamedTuple\nclass Pair(NamedTuple):\n    two: float\n    one: float\n"
    )
    swapped, new = run(package, tmp_path / "cache")
    assert swapped == 1.0
    assert new != old
    pair.rename(package / "pairs.py")
    caller.write_text(caller.read_text().replace("asperity.pair ", "asperity.pairs "))
    assert run(package, tmp_path / "cache")[0] == 1.0


def test_an_edit_compiles_anew_only_what_stands_on_it(monkeypatch):
    """Editing what a kernel does not import leaves its machine code valid."""
    import asperity._core.kernels as compiled

    files = ("contact/narrow_phase/bounds/overlap.py", "contact/geom_tick.py", "texture/spline.py")
    bound, tick, spline = (SOURCES / name for name in files)
    compiled.source_hash.cache_clear()
    before = [compiled.source_hash(file) for file in (bound, tick, spline)]
    seen = compiled._source

    def edited(path):
        digest, imports = seen(path)
        return (digest[::-1] if path == bound else digest), imports

    monkeypatch.setattr(compiled, "_source", edited)
    compiled.source_hash.cache_clear()
    after = [compiled.source_hash(file) for file in (bound, tick, spline)]
    compiled.source_hash.cache_clear()
    assert [a != b for a, b in zip(after, before, strict=True)] == [True, True, False]


def imports_for_itself(node):
    """Whether a function imports from the package when it is called."""
    return isinstance(node, ast.FunctionDef) and any(
        isinstance(part, ast.ImportFrom) and (part.module or "").startswith("asperity")
        for part in ast.walk(node)
    )


def test_what_functions_import_for_themselves_is_in_no_kernel():
    """The hash of a module's kernels leaves it out: so no kernel may be made within a function, \
nor may a module's constant come of a function that imports."""
    for file in SOURCES.rglob("*.py"):
        tree = ast.parse(file.read_text("utf-8"))
        for node in ast.walk(tree):
            inner = ast.walk(node) if isinstance(node, ast.FunctionDef) else ()
            for part in inner:
                marks = part.decorator_list if isinstance(part, ast.FunctionDef) else ()
                names = [ast.unparse(mark) for mark in marks] if part is not node else []
                assert not any(name.endswith("kernel") for name in names), (file, part.name)
        own = {node.name for node in ast.walk(tree) if imports_for_itself(node)}
        for statement in tree.body:
            if isinstance(statement, ast.FunctionDef | ast.ClassDef):
                continue
            typed = isinstance(statement, ast.If) and ast.unparse(statement.test) == "TYPE_CHECKING"
            for part in ast.walk(statement):
                called = part.func if isinstance(part, ast.Call) else None
                assert not (isinstance(called, ast.Name) and called.id in own), (file, called.id)
                hidden = isinstance(part, ast.ImportFrom) and part is not statement and not typed
                assert not (hidden and (part.module or "").startswith("asperity")), file


def test_an_edit_of_a_reader_of_files_leaves_the_kernels_of_contact_valid(monkeypatch):
    import asperity._core.kernels as compiled

    kernels = [
        file for file in SOURCES.rglob("*.py")
        if file.parent.name != "files" and "studies" not in file.parts
        and "kernel\ndef " in file.read_text("utf-8")
    ]  # fmt: skip
    assert len(kernels) > 100
    readers = {
        *(SOURCES / "texture" / "files").glob("*.py"), SOURCES / "scene" / "trajectory_file.py",
        *(SOURCES / "geometry" / "mesh" / f"{name}.py" for name in ("files", "obj", "ply", "stl")),
        SOURCES / "_core" / "files.py", SOURCES / "_core" / "text_table.py",
    } - {SOURCES / "texture" / "files" / "checks.py"}  # fmt: skip
    compiled.source_hash.cache_clear()
    before = [compiled.source_hash(file) for file in kernels]
    seen = compiled._source

    def edited(path):
        digest, imports = seen(path)
        return (digest[::-1] if path in readers else digest), imports

    monkeypatch.setattr(compiled, "_source", edited)
    compiled.source_hash.cache_clear()
    after = [compiled.source_hash(file) for file in kernels]
    compiled.source_hash.cache_clear()
    assert after == before


def test_child_processes_share_the_parents_folder():
    import asperity._core.kernels as compiled

    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    assert folder.name.startswith("asperity-")
    assert compiled.cache_folder() == folder


def test_a_repeated_kernel_is_asked_for_the_types_once(monkeypatch):
    """It does the same as the kernel, and goes on with what the first call was compiled for."""
    import numba
    import numpy as np

    from asperity._core.kernels import Repeated, clear, kernel

    @kernel
    def cleared(values, step):
        clear(values)
        values[0] = step
        return step + 1.0

    asked, typeof = [], numba.typeof
    monkeypatch.setattr(numba, "typeof", lambda value: asked.append(value) or typeof(value))
    repeated, values = Repeated(cleared), np.ones(3)
    for step in (1.0, 2.0, 3):
        assert repeated(values, step) == step + 1.0
        assert values.tolist() == [step, 0.0, 0.0]
    assert len(asked) == 2
