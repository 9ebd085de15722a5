"""What a vibration model must keep, on slides of other seeds and at speeds between those fitted.

`pytest -m slow -s tests/vibrotactile/test_bars.py` prints the table of docs/methods.
"""

import numpy as np
import pytest
from slides import SPEEDS, TEXTURES, fitted_and_judged

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=list(TEXTURES))
def both(request):
    """Return a texture and its models of both kinds, fitted and judged."""
    found = fitted_and_judged(request.param)
    for kind, (fitted, rows) in found.items():
        print(f"\n{request.param}, {kind}, order {fitted.model.order}, "
              f"{len(getattr(fitted.model, 'harmonics', ()))} lines")  # fmt: skip
        for speed, data, made, rms in rows:
            print(f"  {1e3 * speed:4.0f} mm/s: {data:.2f} {made:.2f}  rms {rms:.2f}")
    return request.param, found


def test_the_power_near_v_over_lambda_is_kept(both):
    name, found = both
    rows = found["harmonic"][1]
    # A peak at 35 Hz is narrower than an AR filter of order 20 resolves: missed; figures in docs.
    kept = rows[:, 0] > (0.04 if name == "P40" else 0.0)
    assert np.abs(rows[kept, 2] - rows[kept, 1]).max() < 0.1
    if name in ("waves", "dots"):  # the bar is one that noise alone misses
        noise = found["noise"][1]
        assert np.abs(noise[:, 2] - noise[:, 1]).max() > 0.2


def test_the_rms_is_kept(both):
    rows = both[1]["harmonic"][1]
    assert np.abs(rows[:, 3] - 1.0).max() < 0.1


def test_every_slide_leaves_a_model(both):
    for fitted, _ in both[1].values():
        assert fitted.lost == ()
        assert fitted.recorded == 2 * len(SPEEDS)


def test_only_what_repeats_has_periods(both):
    name, found = both
    model = found["harmonic"][0].model
    if name in ("P40", "P120"):
        assert model.periods.size == 0
    else:
        assert model.periods[0] == pytest.approx(2e-3, rel=1e-3)
        assert (0, 1) in map(tuple, model.harmonics.tolist())
