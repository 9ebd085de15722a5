"""Measure the claims about all methods of `asperity compare`, and store them in the package.

`python tools/measure_claims.py [METHOD ...]`: those about the named methods, or all; minutes.
"""

from __future__ import annotations

import sys
import time

from asperity.studies.baselines import METHODS, choose_methods
from asperity.studies.comparison.claims import measure_claims, store_claims, stored_claims


def main() -> None:
    """Measure claims about the methods named on the command line, keep the others."""
    old = stored_claims()
    claims = {name: old[name] for name in METHODS if name in old}
    for method in choose_methods(sys.argv[1:]):
        begun = time.perf_counter()
        claims[method.name] = measure_claims(method)
        print(f"{method.name}: {time.perf_counter() - begun:.0f} s", flush=True)
        store_claims({name: claims[name] for name in METHODS if name in claims})


if __name__ == "__main__":
    main()
