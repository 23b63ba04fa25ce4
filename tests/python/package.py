#!/usr/bin/env python3
"""Holds the Python package against the command that comes with it, and against what it promises.

    python tests/python/package.py

It needs the package `trodden` alone (`libraries.py` tries others with it), prints one line for each check and exits with 1 if
one fails.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from pathlib import Path

import numpy as np

import trodden

# Every kind of artifact; a run takes a few seconds.
PIPELINE = """\
seed: 7
crowd: &crowd { agents: [2, 4], duration: 10 }
maps:
  train: { homes: { count: 2, area: [50, 60] } }
  test: { homes: { count: 1, first: 1000, area: [50, 60] } }
stages:
  walks: { use: simulate, map: $maps, episodes: 45, <<: *crowd }
  visits: { use: rasterize, map: $maps, walks: walks }
  labels: { use: quantize, map: $maps, visits: visits, classes: 3 }
  tiles: { use: tile, map: $maps.train, labels: labels.train, size: 16, stride: 16, min_labeled: 64 }
  model: { use: train, tiles: tiles, epochs: 1 }
  heat: { use: annotate, map: $maps.test, model: model, mode: exact, stride: 16 }
  scores: { use: score, heat: heat, labels: labels.test, visits: visits.test }
  trips: { use: navigate, map: $maps.test, episodes: 5, steps: 20, <<: *crowd, agents: [5, 6] }
  costs: { use: cost, trips: trips, heat: heat }
"""
ORIGIN, YAW = (-1.5, 2.25), 0.3

# Shells start what they run in the background with Ctrl-C ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)


def plan() -> np.ndarray:
    """Two rooms with a door between them, in pixels of 0.05 m: 9.6 m × 5.6 m."""
    free = np.zeros((112, 192), dtype=bool)
    free[4:108, 4:90] = True
    free[4:108, 94:188] = True
    free[50:70, 90:94] = True
    return free


def command(*arguments: object, code: int = 0, **more: object) -> subprocess.CompletedProcess:
    done = subprocess.run(["trodden", *map(str, arguments)], capture_output=True, text=True, **more)
    assert done.returncode == code, f"exit code {done.returncode}: {done.stderr}"
    return done


def refused(what: type[Exception], says: str, call, *arguments, **more) -> trodden.TroddenError:
    try:
        call(*arguments, **more)
    except what as error:
        assert says in str(error), str(error)
        return error
    raise AssertionError(f"nothing was raised, expected was {what.__name__}: {says}")


class Place:
    """A folder with a map in it, as a picture and for ROS."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.image = self.image_of(plan(), "plan.pgm")
        self.yaml = folder / "plan.yaml"
        self.yaml.write_text(
            f"image: plan.pgm\nresolution: 0.05\norigin: [{ORIGIN[0]}, {ORIGIN[1]}, {YAW}]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
        )

        self.pipeline = folder / "tiny.yaml"
        self.pipeline.write_text(PIPELINE)

    def image_of(self, free: np.ndarray, name: str = "other.pgm") -> Path:
        pixels = np.where(free, 254, 0).astype(np.uint8)
        image = self.folder / name
        image.write_bytes(b"P5\n%d %d\n255\n" % pixels.shape[::-1] + pixels.tobytes())
        return image

    def saved(self, table: trodden.Table) -> bytes:
        path = self.folder / "saved.parquet"
        table.save(path)
        return path.read_bytes()


# The same as the command, bit for bit


def check_annotate_is_the_command(place: Place) -> None:
    out = place.folder / "annotated"
    command("annotate", place.yaml, "--out", out)
    told = (out / "heat.parquet").read_bytes()
    assert place.saved(trodden.annotate(place.yaml)) == told
    assert place.saved(trodden.annotate(trodden.read_map(place.yaml))) == told
    assert place.saved(trodden.annotate(plan(), 0.05, origin=ORIGIN, yaw=YAW)) == told
    assert place.saved(trodden.read_map(place.yaml)) == (out / "map.parquet").read_bytes()
    again = trodden.read(out / "heat.parquet")
    assert place.saved(again) == told


def check_options_are_those_of_the_command(place: Place) -> None:
    out = place.folder / "options"
    command("annotate", place.image, "--image-resolution", 0.05, "--offsets", 3, "--normalize", "--out", out)
    heat = trodden.annotate(trodden.read_map(place.image, image_resolution=0.05), offsets=3, normalize=True)
    assert place.saved(heat) == (out / "heat.parquet").read_bytes()
    # A view with gaps in memory is an array like any other.
    wide = np.zeros((112, 384), dtype=bool)
    wide[:, ::2] = plan()
    assert place.saved(trodden.annotate(wide[:, ::2], 0.05, offsets=3, normalize=True)) == place.saved(heat)
    command("annotate", place.image, "--image-resolution", 0.05, "--stride", 16, "--out", out)
    assert place.saved(trodden.annotate(plan(), 0.05, stride=16)) == (out / "heat.parquet").read_bytes()


def check_simulate_is_the_command(place: Place) -> None:
    out = place.folder / "simulated"
    command("simulate", place.yaml, "--episodes", 12, "--agents", "2,5", "--seed", 7, "--out", out)
    heat = trodden.simulate(place.yaml, episodes=12, agents=(2, 5), seed=7)
    assert place.saved(heat) == (out / "heat.parquet").read_bytes()
    command("simulate", place.yaml, "--episodes", 12, "--preset", "shortest", "--out", out)
    heat = trodden.simulate(place.yaml, episodes=np.int64(12), preset="shortest")
    assert place.saved(heat) == (out / "heat.parquet").read_bytes()
    # Passages go in some direction wherever somebody passes.
    shares = heat.flow.sum(axis=0)
    assert heat.flow.shape == (8, *heat.shape) and np.isin(np.round(shares, 3), [0, 1]).all()


def check_plan_path_is_the_command(place: Place) -> None:
    out = place.folder / "path"
    # The middles of both rooms, in the frame of the map.
    cos, sin = np.cos(YAW), np.sin(YAW)
    start, goal = ((ORIGIN[0] + cos * x - sin * y, ORIGIN[1] + sin * x + cos * y) for x, y in [(1.0, 1.0), (8.5, 4.5)])
    ends = ["--from", f"{start[0]!r},{start[1]!r}", "--to", f"{goal[0]!r},{goal[1]!r}"]
    ends = [str(part).replace("np.float64(", "").replace(")", "") for part in ends]
    for given, options in [({}, []), ({"people": 9, "lambda_": 0.5}, ["--people", 9, "--lambda", 0.5])]:
        command("plan-path", place.yaml, *ends, *options, "--out", out)
        found = trodden.plan_path(place.yaml, start=start, goal=goal, **given)
        features = json.loads((out / "path.geojson").read_text())["features"]
        for path, feature in zip([found.shortest, found.planned], features, strict=True):
            told = feature["properties"]
            assert (path.length, path.cost, path.lambda_) == (
                told["length_m"],
                told["expected_social_cost"],
                told["lambda_m"],
            )
        lines = (out / "path.csv").read_text().splitlines()
        table = found.table()
        assert lines[0] == ",".join(table)
        rows = zip(*(column.tolist() for column in table.values()), strict=True)
        for line, (name, *numbers) in zip(lines[1:], rows, strict=True):
            other, *others = line.split(",")
            assert name == other and np.allclose(numbers, np.array(others, dtype=float), atol=5.001e-4), line
    heat = trodden.annotate(place.yaml)
    assert trodden.plan_path(place.yaml, start=start, goal=goal, heat=heat).planned.cost > 0
    heat.save(out / "heat.parquet")
    by_file = trodden.plan_path(place.yaml, start=start, goal=goal, heat=out / "heat.parquet")
    assert by_file.planned.length == trodden.plan_path(place.yaml, start=start, goal=goal).planned.length


# What comes back


def check_arrays_are_views_that_nobody_writes_to(place: Place) -> None:
    heat = trodden.annotate(place.yaml)
    array = heat.heat
    assert array.dtype == np.float32 and array.shape == heat.shape and not array.flags.owndata
    assert heat["row"].dtype == np.uint32 and heat["x"].dtype == np.float64 and heat.free.dtype == np.bool_
    refused(ValueError, "read-only", array.__setitem__, (0, 0), 1.0)
    kept = array.copy()
    del heat
    churn = [np.ones(len(array.ravel()), dtype=np.float32) for _ in range(50)]
    assert len(churn) == 50 and (array == kept).all()


def check_frames_place_cells(place: Place) -> None:
    heat = trodden.annotate(place.yaml)
    frame = heat.frame
    row, col = np.indices(heat.shape)
    x, y = frame.xy(row, col)
    assert np.abs(x - heat["x"]).max() < 1e-9 and np.abs(y - heat["y"]).max() < 1e-9
    assert (np.stack(frame.cell(x, y)) == np.stack([row, col])).all()
    assert frame.yaw == YAW and frame.resolution == 0.1
    refused(trodden.ArgumentError, "rotated", lambda: frame.extent)
    straight = trodden.annotate(plan(), 0.05).frame
    left, right, bottom, top = straight.extent
    assert np.isclose([right - left, top - bottom], [0.1 * straight.cols, 0.1 * straight.rows]).all()


def check_pictures(place: Place) -> None:
    heat = trodden.annotate(place.yaml)
    assert heat.png("plan").startswith(b"\x89PNG") and heat._repr_png_().startswith(b"\x89PNG")
    assert trodden.read_map(place.yaml).png().startswith(b"\x89PNG")


def check_every_artifact_of_a_run_is_read(place: Place) -> None:
    store = place.folder / "store"
    command("run", place.pipeline, "--store", store, "--quiet")
    kinds = {}
    for path in sorted((store / "latest" / "tiny").rglob("*.parquet")):
        table = trodden.read(path)
        kinds[table.kind] = table
        assert table.rows > 0 and all(len(table[name]) in (table.rows, *table_shape(table)) for name in table.columns)
    ours = "OccupancyMap Trajectories VisitCounts Labels Tiles Heat ClassScores NavEpisodes SocialCosts TrainingMetrics"
    assert set(kinds) == set(ours.split()), sorted(kinds)
    assert kinds["VisitCounts"].png(log=True).startswith(b"\x89PNG")
    assert kinds["Labels"].png().startswith(b"\x89PNG") and kinds["Labels"].classes.dtype == np.int8
    assert kinds["Tiles"]["occupancy"].ndim == 2 and kinds["SocialCosts"]["predictor"].dtype.kind == "U"
    classes = kinds["Heat"]
    assert (classes.free == (classes.classes != 0)).all() and classes["p3"].shape == classes.shape
    # A folder of a trained network is one that can be annotated with.
    model = store / "latest" / "tiny" / "model"
    told = trodden.annotate(place.yaml, model=model, mode="exact", stride=16)
    assert {"class", "p0", "p3"} <= set(told.columns) and "free" not in told
    tracks = kinds["Trajectories"]
    assert isinstance(tracks, trodden.Tracks) and tracks.frame_rate == 10 and tracks.frame.resolution == 0.1
    # A node that consists of chunks is read whole.
    folder = next(path.parent for path in (store / "latest" / "tiny").rglob("chunk-00.parquet"))
    chunks = [trodden.read(path) for path in sorted(folder.glob("chunk-*.parquet"))]
    whole = trodden.read(folder)
    assert whole.rows == sum(chunk.rows for chunk in chunks)
    assert (whole["x"] == np.concatenate([chunk["x"] for chunk in chunks])).all()


def table_shape(table: trodden.Table) -> tuple[int, ...]:
    return table.shape if isinstance(table, trodden.Raster) else ()


# What is refused


def check_bad_arguments_say_what_helps(place: Place) -> None:
    check = lambda *rest, **more: refused(trodden.ArgumentError, *rest, **more)  # noqa: E731
    error = check("a grid needs a `resolution`", trodden.annotate, plan())
    assert isinstance(error, ValueError) and "edge of its cells" in error.advice
    check("this array has 2 of uint8", trodden.annotate, plan().astype(np.uint8), 0.05)
    check("this array has 1 of bool", trodden.annotate, plan()[0], 0.05)
    check("`image_resolution` is 20", trodden.annotate, plan(), 20.0)
    check("the map has no free cell", trodden.annotate, np.zeros((9, 9), dtype=bool), 0.1)
    check("the map has no free cell", trodden.annotate, np.zeros((0, 9), dtype=bool), 0.1)
    check("`yaw` is ", trodden.annotate, plan(), 0.05, yaw=1e300)
    check("`resolution`, `origin` and `yaw` are those of a grid", trodden.annotate, place.yaml, 0.05)
    check("`image_resolution` does not fit", trodden.read_map, place.yaml, image_resolution=0.05)
    check("`stride` ", trodden.annotate, place.yaml, mode="dense", stride=4)
    check("unknown variant `wide`", trodden.annotate, place.yaml, mode="wide")
    check("`episodes` is 0", trodden.simulate, place.yaml, episodes=0)
    check("unknown variant `fast`", trodden.simulate, place.yaml, preset="fast")
    check("`agents` is", trodden.simulate, place.yaml, agents=(5, 2))
    error = check("does not fit at", trodden.plan_path, place.yaml, start=(-90.0, 0.0), goal=(0.0, 3.0))
    assert "choose another `start`" in error.advice
    check("`detour` is -1", trodden.plan_path, place.yaml, start=(0.0, 3.0), goal=(1.0, 3.0), detour=-1.0)
    check("`start` and `goal` are missing", trodden.plan_path, place.yaml, None, (0.0, 3.0))
    other = trodden.annotate(plan(), 0.05)
    check("does not lie on the map", trodden.plan_path, place.yaml, start=(0.0, 3.0), goal=(1.0, 3.0), heat=other)
    check("this raster is no map", trodden.annotate, other)
    refused(TypeError, "unexpected keyword", trodden.read_map, place.yaml, scales="1")
    refused(OverflowError, "", trodden.simulate, place.yaml, seed=-1)


def check_files_that_cannot_be_read_are_named(place: Place) -> None:
    nowhere = place.folder / "nowhere.yaml"
    for read in (trodden.read, trodden.read_map, trodden.annotate):
        refused(trodden.TroddenError, f"failed to read `{nowhere}`", read, nowhere)
    heat = place.folder / "heat.parquet"
    trodden.annotate(place.yaml).save(heat)
    cut = place.folder / "cut.parquet"
    cut.write_bytes(heat.read_bytes()[:-100])
    refused(trodden.TroddenError, f"`{cut}`: ", trodden.read, cut)
    refused(trodden.TroddenError, "is no folder of a checkpoint", trodden.annotate, place.yaml, model=place.folder)
    refused(trodden.TroddenError, "there is no `chunk-00.parquet`", trodden.read, place.folder)
    refused(trodden.TroddenError, "failed to write", trodden.annotate(place.yaml).save, place.folder / "no" / "a")


def check_odd_maps_are_warned_of(place: Place) -> None:
    apart = plan()
    apart[50:70, 90:94] = False
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        trodden.annotate(apart, 0.05)
        trodden.read_map(place.image_of(apart), image_resolution=0.05)
        trodden.annotate(trodden.read_map(place.image_of(apart), image_resolution=0.05), offsets=1)
    assert [w.category for w in caught] == [trodden.TroddenWarning] * 3 and "region=" in str(caught[0].message)
    assert {w.filename for w in caught} == {__file__}
    with warnings.catch_warnings(record=True) as caught:
        right = trodden.annotate(apart, 0.05, region=(8.0, 1.0), offsets=1)
    assert right.frame.origin[0] > 4.5 and "one of 2 regions" in str(caught[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        trodden.annotate(apart, 0.05, region="all")


# How it works beside others


def check_ctrl_c_interrupts(place: Place) -> None:
    def press() -> None:
        time.sleep(0.7)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=press)
    thread.start()
    started = time.monotonic()
    refused(KeyboardInterrupt, "", trodden.simulate, place.yaml, episodes=10_000)
    thread.join()
    assert time.monotonic() - started < 30
    assert trodden.annotate(place.yaml, offsets=1).heat.max() > 0


def check_other_threads_go_on(place: Place) -> None:
    seen, over = [], threading.Event()

    def count() -> None:
        while not over.wait(0.01):
            seen.append(time.monotonic())

    thread = threading.Thread(target=count)
    thread.start()
    started = time.monotonic()
    trodden.simulate(place.yaml, episodes=60)
    took = time.monotonic() - started
    over.set()
    thread.join()
    assert len(seen) > 0.1 * took / 0.01, f"{len(seen)} turns in {took} s"
    results: list[bytes] = []
    threads = [threading.Thread(target=lambda: results.append(trodden.annotate(place.yaml).heat.tobytes())) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 3 and len(set(results)) == 1


def check_the_command_is_the_program(place: Place) -> None:
    assert command("--version").stdout == f"trodden {trodden.__version__}\n"
    module = subprocess.run([sys.executable, "-m", "trodden", "--version"], capture_output=True, text=True)
    assert module.stdout == f"trodden {trodden.__version__}\n"
    assert "error: failed to read" in command("annotate", "nowhere.yaml", "--out", place.folder / "x", code=2).stderr
    # Who has seen enough closes the pipe, and nothing is wrong with that.
    first = subprocess.run("trodden schema | head -n 1", shell=True, capture_output=True, text=True, check=True)
    assert first.stdout == "{\n" and first.stderr == "", first.stderr
    # The first Ctrl-C stops a run at the next safe point.
    arguments = ["run", str(place.pipeline), "--store", str(place.folder / "interrupted"), "--set", "walks.episodes=100000"]
    run = subprocess.Popen(["trodden", *arguments], stderr=subprocess.PIPE, text=True)
    time.sleep(1.5)
    run.send_signal(signal.SIGINT)
    said = run.communicate(timeout=60)[1]
    assert run.returncode == 130 and "Traceback" not in said, f"{run.returncode}: {said}"


def run(checks: list) -> int:
    """Gives each check a place of its own; returns 1 if one fails."""
    wrong = 0
    for check in checks:
        started = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            try:
                check(Place(Path(folder)))
                print(f"ok    {check.__name__} ({time.monotonic() - started:.1f} s)")
            except BaseException:  # noqa: BLE001 (a panic of the compiled half is none of Exception)
                wrong += 1
                print(f"WRONG {check.__name__}\n{traceback.format_exc()}")
    print(f"{len(checks)} checks of the package, {wrong} are wrong")
    return 1 if wrong or not checks else 0


if __name__ == "__main__":
    sys.exit(run([check for name, check in list(globals().items()) if name.startswith("check_")]))
