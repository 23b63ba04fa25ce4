"""Where people walk, by the model or by simulation, and paths around them."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from . import _trodden
from ._errors import ArgumentError, TroddenWarning
from ._maps import RESOLUTION, as_json, map_of
from ._tables import Raster

if TYPE_CHECKING:
    from os import PathLike

    import numpy as np
    from numpy.typing import ArrayLike, NDArray


def annotate(
    map: Raster | str | PathLike[str] | ArrayLike,
    resolution: float | None = None,
    *,
    origin: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    cell: float = RESOLUTION,
    region: str | tuple[float, float] = "largest",
    model: str | PathLike[str] | None = None,
    mode: Literal["dense", "exact"] | None = None,
    stride: int | None = None,
    offsets: int | None = None,
    augment: bool | None = None,
    normalize: bool = False,
) -> Raster:
    """Predicts where people walk, as `trodden annotate` does.

    map: a map that was read, its path, or a 2-D array of truth values: True is free floor, row 0 is the top row.
    resolution: edge of an array's cells in meters; needed for an array, refused otherwise.
    origin, yaw: where the lower left corner of an array lies, in meters, and its rotation in radians.
    cell: edge of a cell of the result in meters; models are trained on 0.1.
    region: which of separate regions of free floor are kept: "largest", "all", or the one at (x, y).
    model: folder of a checkpoint; by default the model that trodden brings.
    mode: "dense" (the whole map at once) or "exact" (sliding windows, as the paper has it).
    stride: cells between windows, for exact mode. offsets, augment: how many offsets are averaged, and whether each sees the
    map in another rotation, for dense mode. normalize: divide by the maximum.

    The result lies on the map as it was read: cells of `cell` meters, cut out around the regions that are kept; its `frame`
    says where. Ctrl-C interrupts it.
    """
    fields = {
        "mode": mode,
        "stride": stride,
        "offsets": offsets,
        "augment": augment,
        "normalize": "max" if normalize else None,
    }
    inner = map_of(map, resolution, origin, yaw, cell, region)
    return Raster(_trodden.annotate(inner, as_json(fields), model))


def simulate(
    map: Raster | str | PathLike[str] | ArrayLike,
    resolution: float | None = None,
    *,
    origin: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    cell: float = RESOLUTION,
    region: str | tuple[float, float] = "largest",
    episodes: int = 100,
    preset: Literal["comfortable", "shortest", "igibson"] = "comfortable",
    agents: tuple[int, int] | None = None,
    seed: int = 0,
) -> Raster:
    """Lets simulated people walk on a map and returns where they go, as `trodden simulate` does.

    episodes: number of independent episodes of a minute; the more, the steadier.
    preset: how people choose their ways and goals.
    agents: fewest and most people of an episode; by default (1, 8), and more on a floor of more than 200 m².
    seed: of all chance. The other arguments are those of `annotate`. Ctrl-C interrupts it.
    """
    inner = map_of(map, resolution, origin, yaw, cell, region)
    heat, lines = _trodden.simulate(inner, as_json({"preset": preset, "agents": agents}), episodes, seed)
    for line in lines:
        warnings.warn(line, TroddenWarning, stacklevel=2)
    return Raster(heat, tuple(lines))


class Path(NamedTuple):
    """A path of a robot."""

    points: NDArray[np.float64]
    """The corners of the path, [n, 2]: x and y in meters, in the frame of the map."""
    length: float
    """Meters."""
    cost: float
    """Expected social cost (equation 2 of the paper) of following it."""
    lambda_: float
    """Meters that a unit of social cost was worth; 0 for the shortest path."""


class PlannedPath(NamedTuple):
    """A path around people, and the shortest one beside it."""

    planned: Path
    """The path to take: the best one if it is worth it, else the shortest."""
    shortest: Path
    best: Path
    """The path with little social cost that is not longer than allowed."""
    is_worth_it: bool
    """Whether there is a way around people that is worth taking: `planned` is `best`."""
    people: float
    """How many people are reckoned with."""

    def table(self) -> dict[str, NDArray[Any]]:
        """Returns both paths point by point, as `path.csv` has them: the columns `path`, `x`, `y` and `meters` along it.

        `pandas.DataFrame`, `polars.DataFrame` and `pyarrow.table` take it.
        """
        import numpy as np

        def along(points: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])

        paths = {"shortest": self.shortest.points, "planned": self.planned.points}
        points = np.concatenate(list(paths.values()))
        return {
            "path": np.repeat(list(paths), [len(points) for points in paths.values()]),
            "x": points[:, 0],
            "y": points[:, 1],
            "meters": np.concatenate([along(points) for points in paths.values()]),
        }


def plan_path(
    map: Raster | str | PathLike[str] | ArrayLike,
    resolution: float | None = None,
    start: tuple[float, float] | None = None,
    goal: tuple[float, float] | None = None,
    *,
    origin: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    cell: float = RESOLUTION,
    region: str | tuple[float, float] = "largest",
    heat: Raster | str | PathLike[str] | None = None,
    people: float | None = None,
    detour: float = 0.1,
    lambda_: float | None = None,
    radius: float = 0.2,
    speed: float = 1.3,
) -> PlannedPath:
    """Plans a path that stays out of people's way, as `trodden plan-path` does.

    start, goal: (x, y) in meters in the frame of the map.
    heat: what `annotate` or `simulate` returned for this map, or its file; by default what the model that trodden brings says.
    people: how many are in the building; by default 6.5, and in proportion more above 200 m².
    detour: how much longer than the shortest path it may be, as a share.
    lambda_: meters that a unit of social cost is worth; then the path is as long as it is.
    radius, speed: of the robot, in m and m/s. The other arguments are those of `annotate`.
    """
    if start is None or goal is None:
        raise ArgumentError("`start` and `goal` are missing", "give (x, y) in meters in the frame of the map")
    inner = map_of(map, resolution, origin, yaw, cell, region)
    if heat is None:
        told = _trodden.annotate(inner, "{}")
    elif isinstance(heat, Raster):
        told = heat._inner
    else:
        told = _trodden.Table.read(heat)
    ends = (float(start[0]), float(start[1]), float(goal[0]), float(goal[1]))
    options = (None if people is None else float(people), None if lambda_ is None else float(lambda_))
    people, is_worth_it, *found = _trodden.plan_path(inner, told, ends, detour, radius, speed, *options)
    shortest, best = (_path(*path) for path in found)
    return PlannedPath(best if is_worth_it else shortest, shortest, best, is_worth_it, people)


def _path(points: list[tuple[float, float]], length: float, cost: float, lambda_: float) -> Path:
    import numpy as np

    return Path(np.asarray(points), length, cost, lambda_)
