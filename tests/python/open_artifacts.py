#!/usr/bin/env python3
"""Opens every artifact of a finished pipeline with pandas, polars, DuckDB and PedPy, and checks columns and types.

    python tests/python/open_artifacts.py artifacts/latest/quickstart [KIND...]

It uses nothing of trodden: what it can read, anybody can. Prints one line per file and exits with 1 if anything is wrong,
or if there is no file of one of the kinds that are named besides.
"""

import json
import math
import re
import sys
import warnings
from pathlib import Path

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq

PLACE = {"row": "uint32", "col": "uint32", "x": "double", "y": "double"}
TRACKS = {
    "episode": "uint32",
    "id": "int64",
    "frame": "int64",
    "x": "double",
    "y": "double",
    "vx": "float",
    "vy": "float",
    "path": "uint32",
}
SCORES = {"truth": "int8", "predicted": "int8", "cells": "uint64"} | {
    name: "double"
    for name in (
        "share scaled weight iou recall mean_recall quadratic_kappa adjacent_errors spearman_visits spearman_classes "
        "auc auc_wall_distance auc_farther_from_walls spearman_wall_distance spearman_farther_from_walls"
    ).split()
}
SCORES |= {
    f"{name}{end}": "double"
    for name in "spearman_free spearman_visited auc_third auc_visited divergence earth_mover doors_r2 flow_likelihood".split()
    for end in ("", "_low", "_high")
} | {"doors": "uint32"}
COSTS = {"predictor": "string", "episode": "uint32"} | {
    name: "double"
    for name in (
        "truth prediction truth_rank prediction_rank offset within_quarter within_quarter_low within_quarter_high "
        "chance chance_at_least spearman spearman_low spearman_high kendall kendall_low kendall_high "
        "ahead ahead_low ahead_high expected slope slope_low slope_high size_error size_error_low size_error_high"
    ).split()
}
POLARS = {
    "bool": pl.Boolean,
    "int8": pl.Int8,
    "int32": pl.Int32,
    "int64": pl.Int64,
    "uint8": pl.UInt8,
    "uint32": pl.UInt32,
    "uint64": pl.UInt64,
    "float": pl.Float32,
    "double": pl.Float64,
    "string": pl.String,
}
PANDAS = {"float": "float32", "double": "float64", "bool": "bool"}
DUCKDB = {
    "bool": "BOOLEAN",
    "int8": "TINYINT",
    "int32": "INTEGER",
    "int64": "BIGINT",
    "uint8": "UTINYINT",
    "uint32": "UINTEGER",
    "uint64": "UBIGINT",
    "float": "FLOAT",
    "double": "DOUBLE",
    "string": "VARCHAR",
}


def heat_columns(classes: int, found: set[str]) -> dict[str, str]:
    """Returns the columns of a heat; all but `heat` are there only where the prediction has that part."""
    columns = PLACE | ({"heat": "float"} if classes else {"free": "bool", "heat": "float"})
    columns |= {"density": "float"} if "density" in found else {}
    columns |= {f"flow_{d}": "float" for d in range(8)} if "flow_0" in found else {}
    return columns | ({"class": "int8"} | {f"p{c}": "float" for c in range(classes + 1)} if classes else {})


def expected_columns(kind: str, metadata: dict[str, str], found: set[str]) -> dict[str, str]:
    """Returns the columns of a kind with their Arrow types, as the design page has them."""
    classes = int(metadata.get("classes", 0))
    tile = int(metadata.get("size", 0)) ** 2
    return {
        "OccupancyMap": PLACE | {"free": "bool"} | ({"observed": "uint8"} if "observed" in found else {}),
        "Trajectories": TRACKS,
        "VisitCounts": PLACE | {"visits": "uint32"},
        "Labels": PLACE | {"class": "int8"},
        "Tiles": {
            "map": "string",
            "row": "int32",
            "col": "int32",
            "occupancy": f"fixed_size_list<uint8>[{tile}]",
            "classes": f"fixed_size_list<int8>[{tile}]",
            "labeled_share": "float",
        },
        "Heat": heat_columns(classes, found),
        "NavEpisodes": TRACKS | {"robot": "bool"},
        "ClassScores": SCORES,
        "SocialCosts": COSTS,
        "TrainingMetrics": {"epoch": "uint32", "samples": "uint64", "loss": "double", "accuracy": "double"}
        | {"mean_recall": "double"}
        | {f"recall_{c}": "double" for c in range(classes + 1)},
    }[kind]


def arrow_name(data: pa.DataType) -> str:
    if pa.types.is_fixed_size_list(data):
        return f"fixed_size_list<{data.value_type}>[{data.list_size}]"
    return str(data)


def check_readers(path: Path, columns: dict[str, str]) -> pd.DataFrame:
    """Opens a file with all three libraries and compares columns, types, numbers of rows and sums."""
    arrow = pq.read_schema(path)
    found = {field.name: arrow_name(field.type) for field in arrow}
    assert found == columns, f"Arrow columns {found} instead of {columns}"
    lists = {name for name, data in columns.items() if data.startswith("fixed")}

    pandas = pd.read_parquet(path)
    assert list(pandas.columns) == list(columns), f"pandas columns {list(pandas.columns)}"
    for name, data in columns.items():
        # pandas reads whole numbers with gaps as floats.
        if name not in lists and data != "string" and not pandas[name].hasnans:
            assert str(pandas[name].dtype) == PANDAS.get(data, data), f"pandas `{name}` is {pandas[name].dtype}"

    polars = pl.read_parquet(path)
    assert polars.columns == list(columns), f"polars columns {polars.columns}"
    for name, data in columns.items():
        if name in lists:
            item, length = re.fullmatch(r"fixed_size_list<(\w+)>\[(\d+)\]", data).groups()
            expected = pl.Array({"uint8": pl.UInt8, "int8": pl.Int8}[item], int(length))
        else:
            expected = POLARS[data]
        assert polars.schema[name] == expected, f"polars `{name}` is {polars.schema[name]}"

    described = duckdb.sql(f"DESCRIBE SELECT * FROM '{path}'").fetchall()
    assert [row[0] for row in described] == list(columns), f"DuckDB columns {described}"
    for name, data, *_ in described:
        if name not in lists:
            assert data == DUCKDB[columns[name]], f"DuckDB `{name}` is {data}"
        else:
            assert data.endswith("]"), f"DuckDB `{name}` is {data}"

    rows = duckdb.sql(f"SELECT COUNT(*) FROM '{path}'").fetchall()[0][0]
    assert rows == len(pandas) == polars.height, f"{rows}, {len(pandas)} and {polars.height} rows"
    for name, data in columns.items():
        if name in lists or data in ("string", "bool"):
            continue
        sums = [
            float(pandas[name].sum()),
            float(polars[name].cast(pl.Float64).sum()),
            float(duckdb.sql(f'SELECT COALESCE(SUM("{name}"::DOUBLE), 0) FROM \'{path}\'').fetchall()[0][0]),
        ]
        # pandas adds up in single precision.
        close = all(math.isclose(sums[1], other, rel_tol=1e-3, abs_tol=1e-2 * max(rows, 1)) for other in sums)
        assert close, f"sums of `{name}` differ: {sums}"
    return pandas


def check_raster(frame: pd.DataFrame, metadata: dict[str, str]) -> None:
    """Checks that a raster has a row per cell with its center in the map's frame, and becomes a picture by `reshape`."""
    rows, cols = int(metadata["rows"]), int(metadata["cols"])
    res, ox, oy, yaw = (float(metadata[key]) for key in ("resolution", "origin_x", "origin_y", "yaw"))
    assert len(frame) == rows * cols, f"{len(frame)} rows for {rows} × {cols} cells"
    row = frame["row"].to_numpy().astype(float).reshape(rows, cols)
    col = frame["col"].to_numpy().astype(float).reshape(rows, cols)
    assert (row == np.arange(rows)[:, None]).all() and (col == np.arange(cols)).all(), "cells are not in row-major order"
    x, y = (col + 0.5) * res, (rows - row - 0.5) * res
    cos, sin = math.cos(yaw), math.sin(yaw)
    expected = ox + cos * x - sin * y, oy + sin * x + cos * y
    for name, values in zip("xy", expected):
        off = np.abs(frame[name].to_numpy().reshape(rows, cols) - values).max()
        assert off < 1e-6, f"`{name}` is off by up to {off} m"


def check_tracks(path: Path, frame: pd.DataFrame, metadata: dict[str, str]) -> str:
    """Loads tracks in PedPy, as they are."""
    import pedpy

    rate = float(metadata["frame_rate"])
    tracks = pedpy.TrajectoryData(data=frame, frame_rate=rate)
    assert len(tracks.data) == len(frame), "PedPy lost rows"
    assert tracks.frame_rate == rate
    assert not frame.duplicated(["id", "frame"]).any(), "an agent is in two places at once"
    one = frame[frame["id"] == frame["id"].iloc[0]]
    if len(one) > 3:
        data = pedpy.TrajectoryData(data=one, frame_rate=rate)
        speed = pedpy.compute_individual_speed(traj_data=data, frame_step=1, speed_calculation=pedpy.SpeedCalculation.BORDER_SINGLE_SIDED)
        assert speed["speed"].max() < 10, f"an agent runs at {speed['speed'].max()} m/s"
    return f", {frame['id'].nunique()} agents in PedPy"


def check_parquet(path: Path) -> tuple[str, str]:
    metadata = {k.decode(): v.decode() for k, v in (pq.read_schema(path).metadata or {}).items()}
    metadata |= {k.decode(): v.decode() for k, v in (pq.read_metadata(path).metadata or {}).items() if k != b"ARROW:schema"}
    for key in ("kind", "format", "units"):
        assert key in metadata, f"no `{key}` in the metadata"
    kind = metadata["kind"]
    columns = expected_columns(kind, metadata, set(pq.read_schema(path).names))
    units = json.loads(metadata["units"])
    assert set(units) <= set(columns), f"units of unknown columns: {units}"
    assert all(units.get(name) == "m" for name in ("x", "y") if name in columns), f"units {units}"
    frame = check_readers(path, columns)
    note = f"{len(frame)} rows"
    if list(columns)[:4] == list(PLACE):
        check_raster(frame, metadata)
        note += f", {metadata['rows']} × {metadata['cols']} cells"
    if "frame" in columns:
        note += check_tracks(path, frame, metadata)
    if kind == "ClassScores":
        scaled = frame["scaled"].dropna()
        assert len(scaled) in (0, len(frame)), "the scaled matrix has gaps"
        assert abs(scaled.sum() - 1) < 1e-9 or frame["cells"].sum() == 0 or scaled.empty, "it does not sum to 1"
        note += f", Spearman {frame['spearman_visits'].iloc[0]:.3f}"
    if kind == "SocialCosts":
        shares = frame.groupby("predictor", sort=False)["within_quarter"].first()
        note += ", within a quarter " + ", ".join(f"{name} {share:.1%}" for name, share in shares.items())
    return kind, note


def check_safetensors(path: Path) -> str:
    """Reads the weights, and the shapes of the network where PyTorch would look for them."""
    from safetensors.numpy import load_file

    arrays = load_file(path)
    assert arrays and all(a.dtype == np.float32 and np.isfinite(a).all() for a in arrays.values())
    return f"{len(arrays)} arrays, {sum(a.size for a in arrays.values())} numbers"


def check_config(path: Path) -> str:
    config = json.loads(path.read_text())
    classes = config["classes"]
    assert config["kind"] == "Checkpoint" and config["window"] % 8 == 0
    assert len(config["distribution"]) == classes and len(config["class_weights"]) == classes + 1
    assert abs(sum(config["class_weights"]) - 1) < 1e-9
    return f"epoch {config['epoch']}, {classes} classes"


def main() -> int:
    if len(sys.argv) < 2:
        print(__doc__, file=sys.stderr)
        return 2
    warnings.filterwarnings("ignore", category=DeprecationWarning)
    wrong, kinds = 0, set()
    wanted = set(sys.argv[2:])
    for path in sorted(p for p in Path(sys.argv[1]).rglob("*") if p.is_file()):
        try:
            if path.suffix == ".parquet":
                kind, note = check_parquet(path)
            elif path.suffix == ".safetensors":
                kind, note = "Checkpoint", check_safetensors(path)
            elif path.name == "config.json":
                kind, note = "Checkpoint", check_config(path)
            else:
                continue
            kinds.add(kind)
            print(f"ok    {path.relative_to(sys.argv[1])}: {kind}, {note}")
        except Exception as error:  # noqa: BLE001 (every file is looked at, whatever the one before did)
            wrong += 1
            print(f"WRONG {path.relative_to(sys.argv[1])}: {type(error).__name__}: {error}")
    missing = wanted - kinds
    if missing:
        print(f"WRONG no file of the kinds {', '.join(sorted(missing))}")
    print(f"{len(kinds)} kinds, {wrong} files are wrong")
    return 1 if wrong or missing or not kinds else 0


if __name__ == "__main__":
    sys.exit(main())
