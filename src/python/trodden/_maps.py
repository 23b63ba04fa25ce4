"""Maps from files, and from grids at hand."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from . import _trodden
from ._errors import ArgumentError, TroddenWarning
from ._tables import Raster

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import ArrayLike

RESOLUTION = 0.1
"""Edge of a cell in meters that models are trained on."""


def read_map(
    path: str | PathLike[str],
    *,
    resolution: float = RESOLUTION,
    region: str | tuple[float, float] = "largest",
    image_resolution: float | None = None,
    scale: str | None = None,
    threshold: float | None = None,
    free_thresh: float | None = None,
    occupied_thresh: float | None = None,
    negate: bool | None = None,
    floor: int | None = None,
    level: str | None = None,
    wall_thickness: float | None = None,
    unit: str | None = None,
    walls: Sequence[str] | None = None,
    doors: Sequence[str] | None = None,
) -> Raster:
    """Reads a map: a ROS `map_server` YAML, an image, the folder of an iGibson scene, or a floor plan (Open-RMF, DXF, WKT, GeoJSON).

    What was found and left out is in `notes`; what somebody should look at is also a `TroddenWarning`.

    resolution: edge of a cell of the result in meters; models are trained on cells of one size.
    region: which of separate regions of free floor are kept: "largest" (that is not outdoors), "all", or the one at (x, y).
    image_resolution: edge of a pixel in meters, for a plain image; or
    scale: two points of the picture in pixels and their distance, "120,80:620,80=12.5m".
    threshold: brightness from which on a pixel is free, as a share of white, for a plain image.
    free_thresh, occupied_thresh: instead of what the YAML of a map of ROS says.
    negate: black is free and white is occupied.
    floor: number of the floor of an iGibson scene.
    level: name of the level of a building of Open-RMF.
    wall_thickness: in meters, for a building of Open-RMF or a DXF drawing.
    unit: of the coordinates of a WKT, GeoJSON or DXF plan: "m", "cm", "mm", "in" or "ft".
    walls, doors: layers of a DXF drawing, names with `*` and `?`.
    """
    options = {
        "resolution": resolution,
        "region": region,
        "image_resolution": image_resolution,
        "scale": scale,
        "threshold": threshold,
        "free_thresh": free_thresh,
        "occupied_thresh": occupied_thresh,
        "negate": negate,
        "floor": floor,
        "level": level,
        "wall_thickness": wall_thickness,
        "unit": unit,
        "walls": None if walls is None else list(walls),
        "doors": None if doors is None else list(doors),
    }
    return _read(path, options, 4)


def map_of(
    source: Raster | str | PathLike[str] | ArrayLike,
    resolution: float | None,
    origin: tuple[float, float],
    yaw: float,
    cell: float,
    region: str | tuple[float, float],
) -> _trodden.Table:
    """Returns the map that somebody means: one that was read, a path, or a grid of free cells with its resolution."""
    if isinstance(source, (Raster, str, os.PathLike)):
        if resolution is not None or origin != (0.0, 0.0) or yaw != 0.0:
            raise ArgumentError(
                "`resolution`, `origin` and `yaw` are those of a grid; a map has its own",
                "leave them out; `read_map` has what a file may want, such as `image_resolution`",
            )
        return (source if isinstance(source, Raster) else _read(source, {"resolution": cell, "region": region}, 5))._inner
    import numpy as np

    grid = np.asarray(source)
    if grid.ndim != 2 or grid.dtype != np.bool_:
        raise ArgumentError(
            f"a grid has two dimensions and truth values, this array has {grid.ndim} of {grid.dtype}",
            "write, say, `picture > 127`: True is free floor, row 0 is the top row",
        )
    if resolution is None:
        raise ArgumentError("a grid needs a `resolution`", "give the edge of its cells in meters")
    place = (float(resolution), float(origin[0]), float(origin[1]), float(yaw))
    options = as_json({"resolution": cell, "region": region})
    return _told(*_trodden.grid_map(grid.tobytes(), grid.shape, place, options), 4)._inner


def as_json(options: dict[str, Any]) -> str:
    """Writes what is given."""
    return json.dumps({name: value for name, value in options.items() if value is not None}, default=_number)


def _number(value: Any) -> Any:
    # Numbers of numpy are none of json's.
    if hasattr(value, "item"):
        return value.item()
    raise ArgumentError(f"`{value!r}` is neither a number nor a text")


def _read(path: str | PathLike[str], options: dict[str, Any], caller: int) -> Raster:
    return _told(*_trodden.read_map(path, as_json(options)), caller)


def _told(inner: _trodden.Table, lines: list[tuple[str, bool]], caller: int) -> Raster:
    """Warns of what is odd in the name of whoever called the package, so many calls away."""
    for line, is_warning in lines:
        if is_warning:
            warnings.warn(line, TroddenWarning, stacklevel=caller)
    return Raster(inner, tuple(line for line, _ in lines))
