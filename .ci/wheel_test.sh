#!/bin/sh
# Build a wheel, install it in a bare environment, and run the demo from an empty folder.
# Usage: wheel_test.sh PYTHON   (an environment that has the package `build`)
set -eu
python=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
bare=$(mktemp -d)
trap 'rm -rf "$bare"' EXIT
"$python" -m build --wheel --outdir "$bare/dist" . >"$bare/build.log" 2>&1 || { cat "$bare/build.log"; exit 1; }
"$python" -m venv "$bare/venv"
"$bare/venv/bin/python" -m pip install -q --disable-pip-version-check -c constraints.txt "$bare"/dist/*.whl
mkdir "$bare/work"
cd "$bare/work"
"$bare/venv/bin/asperity" --help >/dev/null
"$bare/venv/bin/asperity" doctor
"$bare/venv/bin/asperity" demo
test -s out/report.html
echo "wheel: installed in a bare environment, the demo left out/report.html"
