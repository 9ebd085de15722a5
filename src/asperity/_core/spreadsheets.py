"""Spreadsheets as text: the cells of the only sheet of an Excel file that has some."""

from __future__ import annotations

import importlib
import warnings
import zipfile
from pathlib import Path

from asperity._core.unpacking import MOST_UNPACKED
from asperity.errors import AsperityError

SHEETS = (".xlsx", ".xlsm")


def text_of_sheet(path: Path, error: type[AsperityError] = AsperityError) -> str:
    """Return the rows of the only sheet with cells, tabs between these; formulas as last computed.

    Raises
    ------
    AsperityError
        Without openpyxl; a file that is damaged, too large, or has several sheets with cells.
    """
    as_csv = "or save its sheet as .csv"
    try:
        openpyxl = importlib.import_module("openpyxl")
    except ImportError:
        raise error(f"{path}: Excel files need openpyxl, which is not installed; valid: "
                    f"pip install 'asperity[excel]', {as_csv}") from None  # fmt: skip
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > MOST_UNPACKED:
            raise error(f"{path}: unpacked it has {size >> 20} MiB; valid: "
                        f"{MOST_UNPACKED >> 20} at most, {as_csv}")  # fmt: skip
        with warnings.catch_warnings(), path.open("rb") as file:
            warnings.simplefilter("ignore")
            book = openpyxl.load_workbook(file, read_only=True, data_only=True)
            found = {sheet.title: _rows(sheet) for sheet in book.worksheets}
    except AsperityError:
        raise
    except Exception:  # whatever zipfile, the XML parser and openpyxl raise on a damaged file
        raise error(f"{path}: cannot be read as an Excel file: damaged, or of another kind; "
                    f"valid: .xlsx as Excel writes it, {as_csv}") from None  # fmt: skip
    filled = {name: rows for name, rows in found.items() if rows}
    if len(filled) > 1:
        raise error(f"{path}: {len(filled)} of its sheets have cells ({', '.join(filled)[:90]}); "
                    "valid: one; save the one that is meant as .csv")  # fmt: skip
    return "\n".join(rows for rows in filled.values())


def _rows(sheet: object) -> str:
    rows = sheet.iter_rows(values_only=True)  # type: ignore[attr-defined]
    lines = ("\t".join("" if cell is None else str(cell) for cell in row) for row in rows)
    return "\n".join(lines).strip("\n\t ")
