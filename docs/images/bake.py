"""Makes bake.png: asperity's hammer with 444,000 triangles, baked to the paper's 518."""

import importlib.util
import shutil
import tempfile
from pathlib import Path

from PIL import Image

import asperity

OUT = Path(__file__).with_name("bake.png")
BENCH = OUT.parents[2] / "benchmarks" / "bench_bake.py"

spec = importlib.util.spec_from_file_location("bench_bake", BENCH)
bench = importlib.util.module_from_spec(spec)
spec.loader.exec_module(bench)
with tempfile.TemporaryDirectory() as folder:
    scan = Path(folder) / "hammer.ply"
    bench.write_ply(scan)
    options = {"faces": bench.FACES, "size": bench.SIZE, "unit": "m", "up": "x"}
    asperity.bake(scan, Path(folder) / "out", **options)
    shutil.copyfile(Path(folder) / "out" / "picture.png", OUT)
picture = Image.open(OUT).convert("RGB").quantize(256)
picture.save(OUT, optimize=True)
