"""Quadratics in log-log, and peaks."""

import numpy as np
import pytest

from asperity.studies.otaduy_lin_2004.peak_fit import fit_quadratic, refine_peak

SPACING = np.geomspace(0.5e-3, 3.5e-3, 40)


def parabola(spacing, peak=1.4e-3):
    return 3.0 * 10.0 ** (-1.3 * np.log10(spacing / peak) ** 2)


def test_a_quadratic_is_found_again():
    fit = fit_quadratic(SPACING, parabola(SPACING))
    assert fit.r_squared == pytest.approx(1.0)
    assert fit.peak_spacing == pytest.approx(1.4e-3, rel=1e-9)
    assert fit.peak_error < 1e-9
    np.testing.assert_allclose(fit(SPACING), parabola(SPACING), rtol=1e-9)


def test_the_peaks_error_is_the_scatter_of_noisy_fits():
    rng = np.random.default_rng(1)
    fits = [
        fit_quadratic(SPACING, parabola(SPACING) * 10.0 ** rng.normal(0, 0.02, 40))
        for _ in range(300)
    ]
    scatter = np.std([fit.peak_spacing for fit in fits])
    assert np.mean([fit.peak_error for fit in fits]) == pytest.approx(scatter, rel=0.15)


def test_a_curve_that_opens_upwards_has_no_peak():
    assert np.isnan(fit_quadratic(SPACING, 1.0 / parabola(SPACING)).peak_spacing)


def test_refined_peak_lies_within_its_uncertainty():
    peak = refine_peak(parabola, SPACING, parabola(SPACING))
    assert peak.inside
    assert abs(peak.spacing - 1.4e-3) < peak.uncertainty
    assert peak.uncertainty < 0.05e-3
    assert peak.value == pytest.approx(3.0, rel=1e-4)


def test_refining_finds_a_peak_that_falls_between_the_spacings():
    def spike(spacing):
        return parabola(spacing) + np.maximum(0.0, 1.0 - abs(np.log(spacing / 1.43e-3)) / 0.02)

    peak = refine_peak(spike, SPACING, spike(SPACING))
    assert peak.spacing == pytest.approx(1.43e-3, rel=2e-3)


def test_a_curve_that_only_rises_has_no_peak_inside():
    peak = refine_peak(lambda s: s, SPACING, SPACING)
    assert not peak.inside
    assert np.isnan(peak.uncertainty)
