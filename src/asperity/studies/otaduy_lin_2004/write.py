"""Write studies to disk: figures, datasets, claims."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from asperity.drawing import figure_style
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.otaduy_lin_2004.claims import Claim, evaluate_claims, of_finger
from asperity.studies.otaduy_lin_2004.drags import MODELS
from asperity.studies.otaduy_lin_2004.figures import models_figure, study_figure

NOT_JUDGED = "the paper's claims are about rigid probes; none is judged for a finger"
"""The note in `claims.json` of studies with a finger."""


def write_studies(
    studies: dict[str, xr.Dataset],
    metric: str | None,
    folder: Path,
    kinds: Sequence[str] = ("png", "svg"),
) -> list[Claim]:
    """Write figures (PNG, SVG), datasets (netCDF) and `claims.json`; return the claims.

    Parameters
    ----------
    studies : dict
        Study name -> dataset, as `run_study` returns it.
    metric : str or None
        A key of `METRICS`, for a figure of that metric alone; None leaves that figure out (the
        one of the models then shows max u'').
    folder : Path
        An existing folder.
    kinds : sequence of str
        Formats of the figures.
    """
    for name, data in studies.items():
        write_dataset(data, folder / f"{name}.nc")
        if name == "models":
            shown = metric or "max_acceleration"
            figure = models_figure(data, shown, list(MODELS.values()))
            figure_style.save(figure, folder, name, kinds)
            continue
        figure_style.save(study_figure(data, list(METRICS)), folder, f"{name}_metrics", kinds)
        if metric:
            figure_style.save(study_figure(data, [metric]), folder, name, kinds)
    claims = evaluate_claims(studies)
    note = NOT_JUDGED if any(of_finger(data) for data in studies.values()) else ""
    write_claims(claims, folder / "claims.json", note)
    return claims


def write_dataset(data: xr.Dataset, path: Path) -> None:
    """Write a dataset as netCDF-4, waveforms compressed."""
    packed = {
        name: {"zlib": True, "complevel": 1} for name in data.data_vars if data[name].ndim > 2
    }
    # By way of memory: HDF5 cannot close a file on a full disk, and ends the process.
    buffer = io.BytesIO()
    data.to_netcdf(buffer, engine="h5netcdf", encoding=packed)
    path.write_bytes(buffer.getvalue())


def write_claims(claims: list[Claim], path: Path, note: str = "") -> None:
    """Write claims as JSON, with a note if there is one."""
    content = {"claims": claims} | ({"note": note} if note else {})
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", "utf-8")
