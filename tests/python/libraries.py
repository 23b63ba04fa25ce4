#!/usr/bin/env python3
"""Holds the Python package against pandas, polars, DuckDB, pyarrow and PedPy: what they read is what there is, and where it
can be, they read it where it is.

    python tests/python/libraries.py

It needs what `requirements.txt` lists, and `trodden`; see `package.py`.
"""

import sys

import duckdb
import numpy as np
import pandas as pd
import pedpy
import polars as pl
import pyarrow as pa
from package import Place, command, plan, refused, run

import trodden


def check_libraries_read_tables_where_they_are(place: Place) -> None:
    heat = trodden.annotate(place.yaml)
    arrow = pa.table(heat)
    assert arrow.column_names == heat.columns and arrow.num_rows == heat.rows
    for name in heat.columns:
        chunk = arrow.column(name).chunk(0)
        if name != "free":
            assert chunk.buffers()[1].address == heat[name].ctypes.data, f"`{name}` was copied"
        assert (chunk.to_numpy(zero_copy_only=False) == heat[name].ravel()).all(), name
    assert {key.decode(): value.decode() for key, value in arrow.schema.metadata.items()} == heat.metadata
    assert pa.schema(heat) == arrow.schema

    heat.save(place.folder / "heat.parquet")
    filed = pd.read_parquet(place.folder / "heat.parquet")
    pd.testing.assert_frame_equal(pd.DataFrame.from_arrow(heat), filed)
    assert pl.DataFrame(heat).equals(pl.read_parquet(place.folder / "heat.parquet"))
    query = "SELECT count(*), max(heat), sum(free::INT) FROM heat"
    assert duckdb.sql(query).fetchall() == [(heat.rows, float(heat.heat.max()), int(heat.free.sum()))]


def check_tables_come_back(place: Place) -> None:
    heat = trodden.annotate(place.yaml)
    assert place.saved(trodden.from_arrow(pa.table(heat))) == place.saved(heat)
    assert place.saved(trodden.from_arrow(heat, like=heat)) == place.saved(heat)
    # A room that nobody enters, as polars sees it.
    told = pl.DataFrame(heat)
    closed = pl.col("col") > 48
    shut = told.with_columns(
        [pl.when(closed).then(0.0).otherwise(pl.col(name)).cast(pl.Float32).alias(name) for name in ("heat", "density")]
    )
    quiet = trodden.from_arrow(shut, like=heat)
    assert quiet.heat[:, 49:].max() == 0 and (quiet.heat[:, :49] == heat.heat[:, :49]).all()
    assert quiet.frame == heat.frame

    check = lambda *rest, **more: refused(trodden.TroddenError, *rest, **more)  # noqa: E731
    check("no metadata that say what it is", trodden.from_arrow, told)
    check("is no table", trodden.from_arrow, 3, like=heat)
    check("row-major order", trodden.from_arrow, told.reverse(), like=heat)
    check("`Heat` has ", trodden.from_arrow, told.head(10), like=heat)
    check("of type Float64", trodden.from_arrow, told.with_columns(pl.col("heat").cast(pl.Float64)), like=heat)
    check("from 0 to 1", trodden.from_arrow, told.with_columns(pl.col("heat") + 1), like=heat)
    check("null", trodden.from_arrow, told.with_columns(heat=pl.lit(None, dtype=pl.Float32)), like=heat)
    check("no column `heat`", trodden.from_arrow, told.drop("heat"), like=heat)


def check_paths_and_tracks_fit(place: Place) -> None:
    found = trodden.plan_path(plan(), 0.05, (1.0, 1.0), (8.5, 4.5))
    columns = found.table()
    frame = pd.DataFrame(columns)
    assert list(frame.columns) == ["path", "x", "y", "meters"] and set(frame["path"]) == {"shortest", "planned"}
    assert pl.DataFrame(columns).height == pa.table(columns).num_rows == len(frame)
    lengths = frame.groupby("path")["meters"].max()
    assert np.isclose(lengths["planned"], found.planned.length) and np.isclose(lengths["shortest"], found.shortest.length)

    store = place.folder / "store"
    command("run", place.pipeline, "--store", store, "--quiet", "--only", "walks")
    tracks = trodden.read(next((store / "latest" / "tiny").rglob("chunk-00.parquet")).parent)
    walked = pedpy.TrajectoryData(pd.DataFrame.from_arrow(tracks)[["id", "frame", "x", "y"]], frame_rate=tracks.frame_rate)
    assert len(walked.data) == tracks.rows
    speed = pedpy.compute_individual_speed(
        traj_data=walked, frame_step=1, speed_calculation=pedpy.SpeedCalculation.BORDER_SINGLE_SIDED
    )
    assert 0.2 < speed["speed"].mean() < 2.0


if __name__ == "__main__":
    sys.exit(run([check for name, check in list(globals().items()) if name.startswith("check_")]))
