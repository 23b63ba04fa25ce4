"""Learns where people walk: predicts from a floor plan how often each spot is visited.

    import trodden

    heat = trodden.annotate("my_map.yaml")           # or a 2-D array of free cells: annotate(free, 0.05)
    heat.heat, heat.density, heat.frame              # numpy arrays, row 0 at the top, and where they lie
    path = trodden.plan_path("my_map.yaml", start=(2.5, 1.0), goal=(14.0, 8.5), heat=heat)

Tables and rasters go to pyarrow, polars, DuckDB and pandas as they are, without a copy: ``polars.DataFrame(heat)``. The
functions give what the command `trodden`, which comes with this package, writes.
"""

from ._compute import Path, PlannedPath, annotate, plan_path, simulate
from ._errors import ArgumentError, TroddenError, TroddenWarning
from ._maps import read_map
from ._tables import Frame, Raster, Table, Tracks, from_arrow, read
from ._trodden import __version__

__all__ = [
    "ArgumentError",
    "Frame",
    "Path",
    "PlannedPath",
    "Raster",
    "Table",
    "Tracks",
    "TroddenError",
    "TroddenWarning",
    "__version__",
    "annotate",
    "from_arrow",
    "plan_path",
    "read",
    "read_map",
    "simulate",
]
