"""Annotates a map in PyTorch as `trodden annotate --mode exact` does, and prints one line of JSON.

    python annotate_torch.py OUT MODEL STRIDE

OUT is what `trodden annotate` wrote: its map is annotated, its heat is what the result is held against.
"""

import json
import pathlib
import sys
import time

import numpy
import pandas
import torch
from safetensors.torch import load_file

from unet import UNet

out, model, stride = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), int(sys.argv[3])
torch.set_num_threads(2)
BATCH, SIZE = 32, 64

weights = load_file(model / "model.safetensors")
classes = weights["head.weight"].shape[0] - 1
network = UNet(1, classes + 1)
network.load_state_dict(weights)
network = network.to(memory_format=torch.channels_last)


def grid(name, column):
    table = pandas.read_parquet(out / name, columns=["row", "col", column])
    return table.pivot(index="row", columns="col", values=column).to_numpy()


free = grid("map.parquet", "free").astype(numpy.float32)
rows, cols = free.shape
# The map in obstacle, wide enough for the first and the last window.
before = (SIZE - 1) // stride * stride
padded = numpy.zeros((rows + before + SIZE, cols + before + SIZE), numpy.float32)
padded[before : before + rows, before : before + cols] = free
padded = torch.from_numpy(padded)
levels = torch.tensor([0.5 / classes] + [c / classes for c in range(1, classes + 1)])

start = time.perf_counter()
down, right = (before + rows - 1) // stride + 1, (before + cols - 1) // stride + 1
windows = padded.unfold(0, SIZE, stride).unfold(1, SIZE, stride)[:down, :right]
places = (windows.amax((2, 3)) > 0).nonzero().tolist()
sums, counts = torch.zeros_like(padded, dtype=torch.float64), torch.zeros_like(padded)
with torch.inference_mode():
    for first in range(0, len(places), BATCH):
        some = places[first : first + BATCH]
        batch = torch.stack([windows[i, j] for i, j in some]).unsqueeze(1).to(memory_format=torch.channels_last)
        probability = torch.softmax(network(batch), 1)
        heat = torch.tensordot(probability, levels, ([1], [0]))
        for (i, j), window in zip(some, heat):
            at = slice(i * stride, i * stride + SIZE), slice(j * stride, j * stride + SIZE)
            sums[at] += window
            counts[at] += 1
heat = (sums / counts.clamp(min=1))[before : before + rows, before : before + cols].numpy() * free
seconds = time.perf_counter() - start

differs = float(numpy.abs(heat - grid("heat.parquet", "heat")).max())
print(json.dumps({"name": "pytorch", "seconds": round(seconds, 3), "windows": len(places), "differs": differs}))
