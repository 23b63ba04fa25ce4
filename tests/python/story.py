#!/usr/bin/env python3
"""From a map of your own to masks for Nav2, a path and a table: what the README tells, in Python.

    python tests/python/story.py [FOLDER]

Each part is a cell of a notebook. It needs the package `trodden` and nothing else, and writes what it makes to the folder
(by default to one that is removed at the end).
"""

# %% A map of your own
# Here it is drawn: a ring of hallways with four offices on one side, in pixels of 0.05 m. Yours is a file: a map of ROS, an
# image, a plan.
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import trodden

temporary = tempfile.TemporaryDirectory()
folder = Path(sys.argv[1] if len(sys.argv) > 1 else temporary.name)
folder.mkdir(parents=True, exist_ok=True)

free = np.zeros((250, 400), dtype=bool)
free[4:160, 4:396] = True  # hallways, 2 m wide, around a core
free[44:120, 44:356] = False
for left in range(4, 396, 98):
    free[164:246, left : left + 94] = True  # offices with doors 1 m wide
    free[160:164, left + 36 : left + 56] = True

pixels = np.where(free, 254, 0).astype(np.uint8)
(folder / "my_map.pgm").write_bytes(b"P5\n%d %d\n255\n" % (free.shape[1], free.shape[0]) + pixels.tobytes())
(folder / "my_map.yaml").write_text(
    "image: my_map.pgm\nresolution: 0.05\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
)

# %% What trodden reads of it
floor = trodden.read_map(folder / "my_map.yaml")
print(floor)
print("\n".join(floor.notes))
assert floor.frame.resolution == 0.1 and floor.free.dtype == bool

# %% Where people walk, and a picture of it
heat = trodden.annotate(floor)
print(heat)
(folder / "heat.png").write_bytes(heat.png("my map"))
assert heat.shape == floor.shape
assert (heat.heat[~heat.free] == 0).all()
assert abs(heat.density[heat.free].mean() - 1) < 1e-3

# People pass along the hallway that leads to the offices; few come to the corner of a room.
hallway = heat.heat[heat.frame.cell(9.0, 7.0)]
corner = heat.heat[heat.frame.cell(-0.6, 2.4)]
print(f"hallway: busier than {hallway:.0%} of the floor; corner of an office: {corner:.0%}")
assert hallway > 0.6 and corner < 0.2

# %% The same without a file: an array of free cells, and how large they are
again = trodden.annotate(free, 0.05, origin=(-1.0, 2.0))
assert (again.heat == heat.heat).all() and again.frame == heat.frame

# %% Or let people walk there instead
walked = trodden.simulate(floor, episodes=40, seed=1)
agreement = np.corrcoef(heat.heat[heat.free], walked.heat[heat.free])[0, 1]
print(f"correlation of prediction and simulation: {agreement:.2f}")
assert agreement > 0.5

# %% Masks for Nav2, by the command that comes with the package
heat.save(folder / "heat.parquet")
masks = folder / "masks"
subprocess.run(
    ["trodden", "export", "nav2", folder / "heat.parquet", "--map", folder / "my_map.yaml", "--out", masks], check=True
)
header, size, most, values = (masks / "keepout_mask.pgm").read_bytes().split(b"\n", 3)
keepout = np.frombuffer(values, dtype=np.uint8).reshape(free.shape)
assert keepout[~free].min() == 255 and keepout[free].max() <= 99  # nothing is said of walls, no floor is forbidden

# %% A path around people
route = trodden.plan_path(floor, start=(0.0, 10.0), goal=(18.0, 10.0), heat=heat, people=12)
print(
    f"shortest: {route.shortest.length:.1f} m, social cost {route.shortest.cost:.2f}; "
    f"planned: {route.planned.length:.1f} m, {route.planned.cost:.2f}"
)
assert route.planned.length <= 1.1 * route.shortest.length + 1e-9
# The quiet hallway is worth a detour.
assert route.is_worth_it and route.planned.cost < 0.75 * route.shortest.cost
assert np.allclose(route.planned.points[[0, -1]], [(0.0, 10.0), (18.0, 10.0)])

# %% And a table: each library of data frames takes `route.table()` and `heat` as they are
table = route.table()
for row in list(zip(*(column.tolist() for column in table.values()), strict=True))[:3]:
    print(dict(zip(table, row, strict=True)))
busiest = np.unravel_index(heat.heat.argmax(), heat.shape)
print("the busiest cell lies at x = {:.2f} m, y = {:.2f} m".format(*heat.frame.xy(*busiest)))
