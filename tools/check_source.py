"""Rules of CONTRIBUTING.md that no linter knows: `python tools/check_source.py [RULE ...]`.

Prints one line for each place that breaks a rule, and exits with 1 if there is one. With
`--count`, prints only how many places break each rule.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / "src" / "asperity"
MOST_ARGUMENTS = 8
"""Of a compiled kernel: more are a record that has no name yet."""
MOST_LINES = 400
"""Of a source file."""
MOST_NAMES, MOST_LONG_IMPORTS = 10, 60
"""Names in one import statement, and how many statements may have more."""
WORDS = (
    "told", "tells", "asked", "says", "ours", "what is left", "does so", "of its own",
    "all the same", "in work", "is there in time", "has its say", "along a line",
    "in six directions",
)  # fmt: skip
"""Words that hide who does what to which quantity; plain terms of the field take their place."""
ALLOWED_WORDS: dict[str, tuple[str, ...]] = {
    "src/asperity/dynamics/passivity/controller.py": ("told",),
    "src/asperity/psychophysics": ("asked",),
    "src/asperity/realtime/servo/safety.py": ("told",),
    "docs/experiments.md": ("asked",),
}
"""Where such a word is right, by file or folder: participants are asked; a deprecated name."""
KERNELS = ("kernel", "inner_kernel", "small_kernel", "separate_kernel")
Place = tuple[Path, int, str]


def kernels(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """Yield the compiled functions of a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            names = [ast.unparse(part).split("(")[0] for part in node.decorator_list]
            if any(name.rpartition(".")[2] in KERNELS for name in names):
                yield node


def arguments(files: dict[Path, ast.Module]) -> Iterator[Place]:
    """Yield kernels with too many arguments."""
    for file, tree in files.items():
        for kernel in kernels(tree):
            count = len(kernel.args.args)
            if count > MOST_ARGUMENTS:
                yield file, kernel.lineno, f"{kernel.name} takes {count} arguments"


def indices(files: dict[Path, ast.Module]) -> Iterator[Place]:
    """Yield integer constants that name a field of a row: a record has names."""
    constants: dict[str, tuple[Path, int]] = {}
    for file, tree in files.items():
        for node in tree.body:
            if isinstance(node, ast.Assign):
                for target in node.targets:
                    for name in _integers(target, node.value):
                        constants[name] = (file, node.lineno)
    used: set[str] = set()
    for tree in files.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.Subscript):
                used |= {part.id for part in _terms(node.slice)} & constants.keys()
    for name in sorted(used):
        yield *constants[name], f"{name} is used as an index"


def _integers(target: ast.expr, value: ast.expr) -> Iterator[str]:
    """Yield the names that an assignment makes integers."""
    if isinstance(target, ast.Tuple):
        ranged = isinstance(value, ast.Call) and ast.unparse(value.func) == "range"
        values = value.elts if isinstance(value, ast.Tuple) else [None] * len(target.elts)
        for name, part in zip(target.elts, values, strict=False):
            if isinstance(name, ast.Name) and (ranged or (part is not None and _whole(part))):
                yield name.id
    elif isinstance(target, ast.Name) and _whole(value):
        yield target.id


def _whole(value: ast.expr) -> bool:
    """Return whether an expression is a whole number, or a sum that starts from a constant."""
    if isinstance(value, ast.BinOp):
        return _whole(value.right) and isinstance(value.left, ast.Name | ast.Constant | ast.BinOp)
    return isinstance(value, ast.Constant) and type(value.value) is int


def _terms(index: ast.expr) -> Iterator[ast.Name]:
    """Yield the names that an index is a sum or a tuple of."""
    if isinstance(index, ast.Name):
        yield index
    elif isinstance(index, ast.Tuple):
        for part in index.elts:
            yield from _terms(part)
    elif isinstance(index, ast.BinOp) and isinstance(index.op, ast.Add | ast.Sub | ast.Mult):
        yield from _terms(index.left)
        yield from _terms(index.right)
    elif isinstance(index, ast.Slice) and index.lower is not None:
        yield from _terms(index.lower)


def classes(files: dict[Path, ast.Module]) -> Iterator[Place]:
    """Yield public classes that have the name of another one."""
    places = defaultdict(list)
    for file, tree in files.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append((file, node.lineno))
    for name, found in places.items():
        for file, line in found[1:]:
            yield file, line, f"class {name} is also in {found[0][0].relative_to(ROOT)}"


def lengths(files: dict[Path, ast.Module]) -> Iterator[Place]:
    """Yield files that hold more than one idea, to go by their length."""
    for file in files:
        count = len(file.read_text("utf-8").splitlines())
        if count > MOST_LINES:
            yield file, count, f"{count} lines"


def imports(files: dict[Path, ast.Module]) -> Iterator[Place]:
    """Yield long import statements, where there are too many of them."""
    found = [
        (file, node.lineno, f"imports {len(node.names)} names")
        for file, tree in files.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and len(node.names) > MOST_NAMES
    ]
    if len(found) > MOST_LONG_IMPORTS:
        yield from found


def types(files: dict[Path, ast.Module]) -> Iterator[Place]:
    """Yield functions without types that are not kernels, whose types Numba infers."""
    for file, tree in files.items():
        compiled = {id(node) for kernel in kernels(tree) for node in ast.walk(kernel)}
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and id(node) not in compiled:
                bare = [
                    part
                    for part in (*node.args.args, *node.args.kwonlyargs)
                    if part.annotation is None and part.arg not in ("self", "cls")
                ]
                if bare or (node.returns is None and node.name != "__init__"):
                    yield file, node.lineno, f"{node.name} has no types"


def words(files: dict[Path, ast.Module]) -> Iterator[Place]:
    """Yield words that plain terms should take the place of."""
    pattern = re.compile(r"(?<![A-Za-z])(" + "|".join(WORDS) + r")(?![A-Za-z])", re.IGNORECASE)
    # The changelog lists old names.
    documents = [p for p in ROOT.glob("*.md") if p.name != "CHANGELOG.md"]
    documents += (ROOT / "docs").rglob("*.md")
    for file in (*files, *documents):
        place = file.relative_to(ROOT).as_posix()
        if "_build" in place:
            continue
        allowed = {w for where, ws in ALLOWED_WORDS.items() if place.startswith(where) for w in ws}
        for number, line in enumerate(file.read_text("utf-8").splitlines(), 1):
            for found in pattern.finditer(line):
                if found[0].lower() not in allowed:
                    yield file, number, f"{found[0]!r}"


RULES = {
    rule.__name__: rule for rule in (arguments, indices, classes, lengths, imports, types, words)
}


def main(chosen: list[str]) -> int:
    """Check the chosen rules, by default all; return the exit code."""
    count = "--count" in chosen
    rules = [name for name in chosen if name != "--count"] or list(RULES)
    files = {file: ast.parse(file.read_text("utf-8")) for file in sorted(SOURCES.rglob("*.py"))}
    broken = 0
    for name in rules:
        places = list(RULES[name](files))
        broken += len(places)
        if count:
            print(f"{name}: {len(places)}")
            continue
        for file, line, what in places:
            print(f"{file.relative_to(ROOT)}:{line}: {name}: {what}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
