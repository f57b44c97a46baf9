"""Tables as frames of polars or pandas, or as Arrow tables."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, TypeAlias

Frames: TypeAlias = Literal["polars", "pandas", "arrow"]
"""The library of frames: `polars.DataFrame`, `pandas.DataFrame` or `pyarrow.Table`."""

PACKAGES: dict[str, tuple[str, ...]] = {"polars": ("polars",), "pandas": ("pandas", "pyarrow"), "arrow": ("pyarrow",)}
"""Packages that each library needs."""


def choose(frames: str | None) -> Frames:
    """The library of frames: the given one; by default polars if it is installed, otherwise pandas.

    Raises:
        ValueError: There is no such library.
        ImportError: It is not installed.
    """
    if frames is None:
        chosen: Frames = "polars" if _missing("polars") == [] else "pandas"
        if _missing(chosen):
            raise ImportError("frames need polars, or pandas and pyarrow: `pip install polars`")
        return chosen
    if frames not in PACKAGES:
        raise ValueError(f"frames is {frames!r}, expected 'polars', 'pandas' or 'arrow'")
    missing = _missing(frames)
    if missing:
        raise ImportError(f"frames={frames!r} needs {' and '.join(missing)}: `pip install {' '.join(missing)}`")
    return frames  # type: ignore[return-value]


def _missing(frames: str) -> list[str]:
    return [package for package in PACKAGES[frames] if importlib.util.find_spec(package) is None]


def read_parquet(path: Path, frames: Frames, columns: Sequence[str] | None = None) -> Any:
    """The frame of a Parquet file, or only these columns of it."""
    names = None if columns is None else list(columns)
    if frames == "polars":
        import polars

        return polars.read_parquet(path, columns=names)
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(path, columns=names, memory_map=True)
    # Columns that have no missing numbers share the memory of the table.
    return table.to_pandas(split_blocks=True) if frames == "pandas" else table


def check_columns(path: Path, frames: Frames, columns: Sequence[str]) -> None:
    """Raises a `ValueError` unless a Parquet file has these columns."""
    if frames == "polars":
        import polars

        known = list(polars.read_parquet_schema(path))
    else:
        import pyarrow.parquet

        known = pyarrow.parquet.read_schema(path).names
    unknown = [column for column in columns if column not in known]
    if unknown:
        raise ValueError(f"there is no column {unknown[0]!r}, expected some of {', '.join(known)}")


def read_csv(path: Path, frames: Frames) -> Any:
    """The frame of a CSV file; empty cells are missing."""
    if frames == "polars":
        import polars

        return polars.read_csv(path, infer_schema_length=None)
    if frames == "pandas":
        import pandas

        return pandas.read_csv(path)
    import pyarrow.csv

    return pyarrow.csv.read_csv(path)


def from_rows(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, type], frames: Frames) -> Any:
    """The frame of rows whose cells may be None. Types of columns are str, int, float and datetime."""
    cells = {name: [row[name] for row in rows] for name in columns}
    if frames == "polars":
        import polars

        types: dict[type, Any] = {
            str: polars.String,
            int: polars.Int64,
            float: polars.Float64,
            datetime: polars.Datetime("us", "UTC"),
        }
        return polars.DataFrame(cells, schema={name: types[kind] for name, kind in columns.items()})
    import pyarrow

    arrow_types = {
        str: pyarrow.string(),
        int: pyarrow.int64(),
        float: pyarrow.float64(),
        datetime: pyarrow.timestamp("us", "UTC"),
    }
    table = pyarrow.table({name: pyarrow.array(cells[name], arrow_types[kind]) for name, kind in columns.items()})
    return table.to_pandas() if frames == "pandas" else table
