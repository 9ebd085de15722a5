"""What a study leaves on disk: figures, datasets, claims."""

from __future__ import annotations

import json
from pathlib import Path

import xarray as xr

from asperity import plots
from asperity.perception.claims import Claim, evaluate_claims
from asperity.perception.metrics import METRICS
from asperity.perception.sweep import MODELS


def write_studies(studies: dict[str, xr.Dataset], metric: str, folder: Path) -> list[Claim]:
    """Write figures (PNG, SVG), datasets (netCDF) and `claims.json`; return the claims.

    Parameters
    ----------
    studies : dict
        Study name -> dataset, as `run_study` returns it.
    metric : str
        A key of `METRICS`, for the main figure of each study.
    folder : Path
        An existing folder.
    """
    for name, data in studies.items():
        write_dataset(data, folder / f"{name}.nc")
        if name == "models":
            figure = plots.models_figure(data, metric, list(MODELS.values()))
        else:
            figure = plots.study_figure(data, [metric])
            plots.save(plots.study_figure(data, list(METRICS)), folder, f"{name}_metrics")
        plots.save(figure, folder, name)
    claims = evaluate_claims(studies)
    write_claims(claims, folder / "claims.json")
    return claims


def write_dataset(data: xr.Dataset, path: Path) -> None:
    """Write a dataset as netCDF-4, waveforms compressed."""
    packed = {
        name: {"zlib": True, "complevel": 4} for name in data.data_vars if data[name].ndim > 2
    }
    data.to_netcdf(path, engine="h5netcdf", encoding=packed)


def write_claims(claims: list[Claim], path: Path) -> None:
    """Write claims as JSON."""
    path.write_text(json.dumps({"claims": claims}, indent=2, ensure_ascii=False) + "\n", "utf-8")
