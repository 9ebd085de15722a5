"""What a vibration model must keep, on slides of other seeds and at speeds between those fitted.

`pytest -m slow -s tests/vibrotactile/test_bars.py` prints the table of docs/methods.
"""

import numpy as np
import pytest
from slides import (
    BETWEEN,
    FORCES,
    LENGTHS,
    SPEEDS,
    TEXTURES,
    fitted_and_judged,
    judged,
    peak_length,
    slides,
)

from asperity.vibrotactile.fit import fit

FOUR = ("waves", "dots", "P40", "P120")
"""Two surfaces that repeat, and two stand-ins of sandpaper that do not."""
SEVERAL = [(name, seed) for name in FOUR for seed in (1, 2, 3)]
SEVERAL += [(name, 1) for name in TEXTURES if name not in FOUR]


@pytest.fixture(
    scope="module",
    params=SEVERAL,
    ids=[f"{name}-{seed}".replace(" ", "-") for name, seed in SEVERAL],
)
def both(request):
    """Return a texture and its models of both kinds, fitted and judged."""
    found = fitted_and_judged(*request.param)
    for kind, (fitted, rows) in found.items():
        print(f"\n{request.param}, {kind}, order {fitted.model.order}, "
              f"{len(getattr(fitted.model, 'harmonics', ()))} lines")  # fmt: skip
        for speed, data, made, rms in rows:
            print(f"  {1e3 * speed:4.0f} mm/s: {data:.2f} {made:.2f}  rms {rms:.2f}")
    return request.param[0], found


@pytest.mark.slow
def test_the_power_near_v_over_lambda_is_kept(both):
    name, found = both
    rows = found["harmonic"][1]
    assert np.abs(rows[:, 2] - rows[:, 1]).max() < 0.1
    if name in ("waves", "dots"):  # the bar is one that noise alone misses
        noise = found["noise"][1]
        assert np.abs(noise[:, 2] - noise[:, 1]).max() > 0.2


@pytest.mark.slow
def test_the_rms_is_kept(both):
    rows = both[1]["harmonic"][1]
    assert np.abs(rows[:, 3] - 1.0).max() < 0.1


@pytest.mark.slow
def test_every_slide_leaves_a_model(both):
    for fitted, _ in both[1].values():
        assert fitted.lost == ()
        assert fitted.recorded == 2 * len(SPEEDS)


@pytest.mark.slow
def test_only_what_repeats_has_periods(both):
    name, found = both
    model = found["harmonic"][0].model
    if name in ("P40", "P120"):
        assert model.periods.size == 0
    else:
        assert model.periods[0] == pytest.approx(2e-3, rel=1e-3)
        assert (0, 1) in map(tuple, model.harmonics.tolist())


@pytest.mark.parametrize("name", [
    "waves", "P40", *(pytest.param(name, marks=pytest.mark.slow) for name in ("dots", "P120"))
])  # fmt: skip
def test_from_30_to_300_mm_s_the_share_and_the_rms_are_kept(name):
    """The bar in short: one seed, one force between those fitted, slides of at most 3 s."""
    training = slides(name, 1, SPEEDS, FORCES, 0.045, (1.0, 1.5), apart=False)
    speeds = sorted((*SPEEDS, *BETWEEN))
    held_out = slides(name, 101, speeds, (0.6,), 0.09, (1.0, 3.0), apart=False)
    fitted = fit(training)
    assert fitted.lost == ()
    assert fitted.recorded == len(training)
    rows = judged(fitted.model, held_out, LENGTHS.get(name) or peak_length(training))
    assert len(rows) == 7
    assert np.abs(rows[:, 2] - rows[:, 1]).max() < 0.1
    assert np.abs(rows[:, 3] - 1.0).max() < 0.1
