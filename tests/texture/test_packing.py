"""Bounds of textures that are packed again are kept, and stay as they were."""

from __future__ import annotations

import numpy as np
import pytest

from asperity.texture import packing
from asperity.texture.height_field import HeightField
from asperity.texture.packing import pack


def _field(seed: int, rows: int = 12, border: str = "clamp") -> HeightField:
    heights = 1e-5 * np.random.default_rng(seed).random((rows, 15))
    return HeightField(heights, (1e-4, 2e-4), border=border)


@pytest.fixture(autouse=True)
def _nothing_kept(monkeypatch):
    monkeypatch.setattr(packing, "_kept", {})


def _as_bytes(packed) -> list[bytes]:
    return [part.tobytes() for part in packed]


def test_what_is_kept_gives_the_same_arrays_wherever_it_stands(monkeypatch):
    fields = [_field(0), _field(1, 9, "wrap"), _field(2, 30)]
    orders = (fields, fields[::-1], fields[1:], [fields[1], fields[1]])
    kept = [_as_bytes(pack(order)) for order in orders for _ in range(2)]
    monkeypatch.setattr(packing, "_MOST_KEPT", 0)
    anew = [_as_bytes(pack(order)) for order in orders for _ in range(2)]
    assert kept == anew


def test_an_equal_texture_is_not_worked_out_again(monkeypatch):
    first = pack([_field(0)])
    monkeypatch.setattr(packing, "_work_out", None)
    assert _as_bytes(pack([_field(0)])) == _as_bytes(first)


@pytest.mark.parametrize("other", [_field(1), _field(0, border="wrap")])
def test_another_texture_is(other):
    pack([_field(0)])
    pack([other])
    assert len(packing._kept) == 2


def test_what_was_used_longest_ago_goes_first(monkeypatch):
    sizes = []
    for seed in range(3):
        pack([_field(seed)])
        sizes.append(sum(one.bounds.nbytes + one.tops.nbytes for one in packing._kept.values()))
    pack([_field(0)])
    monkeypatch.setattr(packing, "_MOST_KEPT", sizes[1])
    pack([_field(2)])
    keys = list(packing._kept)
    pack([_field(0)])
    assert len(keys) == 2
    assert list(packing._kept) == keys[::-1]
