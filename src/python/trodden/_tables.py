"""Tables, rasters and tracks: numpy arrays that share memory with Arrow columns."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _trodden
from ._errors import ArgumentError

if TYPE_CHECKING:
    from os import PathLike

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

PLACE = ("row", "col", "x", "y")


class Frame(NamedTuple):
    """Where a raster lies: row 0 is the top row, and the origin is the lower left corner of the grid."""

    resolution: float
    """Edge of a cell in meters."""
    origin: tuple[float, float]
    """The lower left corner, x and y in meters."""
    yaw: float
    """Rotation about the origin, counter-clockwise in radians."""
    rows: int
    cols: int

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top in meters, as `matplotlib.pyplot.imshow(…, extent=…)` takes them.

        Raises `ArgumentError` if the raster is rotated: no picture along the axes shows it.
        """
        if self.yaw != 0.0:
            raise ArgumentError(f"the raster is rotated by {self.yaw} rad", "draw it with `x` and `y` of its cells")
        x, y = self.origin
        return x, x + self.cols * self.resolution, y, y + self.rows * self.resolution

    def xy(self, row: ArrayLike, col: ArrayLike) -> tuple[Any, Any]:
        """Returns x and y of the centers of cells."""
        import numpy as np

        right = (np.asarray(col) + 0.5) * self.resolution
        up = (self.rows - np.asarray(row) - 0.5) * self.resolution
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return self.origin[0] + cos * right - sin * up, self.origin[1] + sin * right + cos * up

    def cell(self, x: ArrayLike, y: ArrayLike) -> tuple[Any, Any]:
        """Returns row and column of the cells that hold points; points off the raster have rows and columns that it has not."""
        import numpy as np

        right, up = np.asarray(x) - self.origin[0], np.asarray(y) - self.origin[1]
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        col = np.floor((cos * right + sin * up) / self.resolution).astype(int)
        return self.rows - 1 - np.floor((cos * up - sin * right) / self.resolution).astype(int), col


class Table:
    """Named columns, and what stands beside them.

    `table["name"]` is a numpy array that cannot be written to: its memory is that of the Arrow column. It has the methods of
    Arrow's PyCapsule interface, so that `pyarrow.table(table)`, `polars.DataFrame(table)`, `pandas.DataFrame.from_arrow(table)`
    and `duckdb.sql("SELECT … FROM table")` take it as it is.
    """

    def __init__(self, inner: _trodden.Table) -> None:
        self._inner = inner
        self._arrays: dict[str, NDArray[Any]] = {}

    @property
    def kind(self) -> str:
        """What the table holds, such as `Heat` or `Trajectories`."""
        return self._inner.kind

    @property
    def metadata(self) -> dict[str, str]:
        """What stands beside the columns, by key: kind, format, units, and the frame of what lies on a map."""
        return self._inner.metadata

    @property
    def columns(self) -> list[str]:
        """The names of the columns in their order."""
        return self._inner.columns

    @property
    def rows(self) -> int:
        """The number of rows."""
        return len(self._inner)

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._arrays:
            import numpy as np

            self._arrays[name] = self._shaped(np.asarray(self._inner.column(name)))
        return self._arrays[name]

    def _shaped(self, array: NDArray[Any]) -> NDArray[Any]:
        return array

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __repr__(self) -> str:
        return f"<trodden.{type(self).__name__} {self.kind}: {self._size()}; {', '.join(self.columns)}>"

    def _size(self) -> str:
        return f"{self.rows} rows"

    def __arrow_c_schema__(self) -> object:
        return self._inner.__arrow_c_schema__()

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self._inner.__arrow_c_stream__(requested_schema)

    def save(self, path: str | PathLike[str]) -> None:
        """Writes the Parquet file that the command and the pipelines write."""
        self._inner.save(path)


class Raster(Table):
    """A value for each cell of a grid: a map, visits, labels or a heat.

    `raster["name"]` has the grid's rows and columns, row 0 at the top. `notes` are the lines that reading a map had to say.
    """

    def __init__(self, inner: _trodden.Table, notes: tuple[str, ...] = ()) -> None:
        super().__init__(inner)
        self.notes = notes
        self.frame = _frame(inner.metadata)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns."""
        return self.frame.rows, self.frame.cols

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which cells are free floor, of a map or a heat."""
        return self["free"] if "free" in self else self["class"] != 0

    @property
    def heat(self) -> NDArray[np.float32]:
        """How busy each cell is, 0 to 1: where the model says ranks, the share of the free floor that is visited less."""
        return self["heat"]

    @property
    def density(self) -> NDArray[np.float32]:
        """Expected number of people relative to the mean over the free floor, which is 1."""
        return self["density"]

    @property
    def flow(self) -> NDArray[Any]:
        """Passages in each of eight directions, [8, rows, columns]: along the rows to the right, and on counter-clockwise by 45°."""
        import numpy as np

        return np.stack([self[f"flow_{direction}"] for direction in range(8)])

    @property
    def visits(self) -> NDArray[np.uint32]:
        """How many paths swept each cell."""
        return self["visits"]

    @property
    def classes(self) -> NDArray[np.int8]:
        """Classes from 1; 0 is an obstacle, −1 was never visited."""
        return self["class"]

    def png(self, title: str = "", *, log: bool = False) -> bytes:
        """Draws the raster with a color bar and meters at its axes; notebooks show it by themselves."""
        png = self._inner.png(title, log)
        if png is None:
            raise ArgumentError(f"a raster of `{self.kind}` has no picture", "draw one of its columns")
        return png

    def _repr_png_(self) -> bytes | None:
        return self._inner.png("", False)

    def _shaped(self, array: NDArray[Any]) -> NDArray[Any]:
        return array.reshape(self.shape + array.shape[1:])

    def _size(self) -> str:
        return f"{self.frame.rows} × {self.frame.cols} cells of {self.frame.resolution} m"


class Tracks(Table):
    """Who was where when: `episode`, `id`, `frame`, `x`, `y` in meters, `vx`, `vy`, and which `path` of the person it is."""

    @property
    def frame(self) -> Frame:
        """The frame of the map that they lie on."""
        return _frame(self.metadata)

    @property
    def frame_rate(self) -> float:
        """Frames per second, as `pedpy.TrajectoryData(…, frame_rate=…)` takes them."""
        return float(self.metadata["frame_rate"])


def read(path: str | PathLike[str]) -> Table:
    """Reads an artifact: a Parquet file of trodden's, or the folder of a node that consists of chunks.

    Rasters come as `Raster`, people as `Tracks`, all else as `Table`. The file is checked as the pipeline checks it; one that
    is damaged, or none of trodden's, raises `TroddenError`.
    """
    return table_of(_trodden.Table.read(path))


def from_arrow(table: object, like: Table | None = None) -> Raster:
    """Takes the table of a heat or a map back that went to another library, perhaps changed there.

    Metadata say where it lies: its own, as pyarrow keeps them, or those of the table that it is `like`. All is checked: the
    cells in their order, the types (`heat` is float32), the ranges.
    """
    if like is None:
        schema = getattr(table, "schema", None)
        metadata = getattr(schema, "metadata", None) or {}
        own = {_text(key): _text(value) for key, value in metadata.items()}
    else:
        own = like.metadata
    if "kind" not in own:
        raise ArgumentError("the table has no metadata that say what it is", "name the raster that it is `like`")
    return Raster(_trodden.Table.of_arrow(table, own))


def table_of(inner: _trodden.Table, notes: tuple[str, ...] = ()) -> Table:
    metadata = inner.metadata
    if "frame_rate" in metadata:
        return Tracks(inner)
    is_raster = "rows" in metadata and tuple(inner.columns[:4]) == PLACE
    return Raster(inner, notes) if is_raster else Table(inner)


def _frame(metadata: dict[str, str]) -> Frame:
    resolution, x, y, yaw = (float(metadata[key]) for key in ("resolution", "origin_x", "origin_y", "yaw"))
    return Frame(resolution, (x, y), yaw, int(metadata["rows"]), int(metadata["cols"]))


def _text(word: str | bytes) -> str:
    return word.decode() if isinstance(word, bytes) else word
