"""Trains, or predicts with, the network of src/domain/unet in PyTorch and prints one line of JSON.

    python unet_torch.py train|infer SECONDS THREADS

Batches of 32 windows of 64 x 64 cells, memory format channels_last, Adam, eq. 4 of the paper as the loss.
"""

import json
import resource
import sys
import time

import torch
from torch.nn import functional as F

from unet import UNet

mode, seconds, threads = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
torch.set_num_threads(threads)
torch.manual_seed(0)
BATCH, SIZE, CLASSES = 32, 64, 4

model = UNet(CLASSES).to(memory_format=torch.channels_last)
assert sum(p.numel() for p in model.parameters()) == 424_932
occupancy = (torch.rand(BATCH, 1, SIZE, SIZE) > 0.5).float().to(memory_format=torch.channels_last)
labels = torch.randint(-1, CLASSES, (BATCH, SIZE, SIZE))
weights = torch.tensor([0.006, 0.033, 0.194, 0.767])
optimizer = torch.optim.Adam(model.parameters(), 1e-3)


def train():
    optimizer.zero_grad(set_to_none=True)
    # With weights, PyTorch's mean is the weighted sum divided by the sum of weights: eq. 4.
    loss = F.cross_entropy(model(occupancy), labels, weight=weights, ignore_index=-1)
    loss.backward()
    optimizer.step()
    return loss.item()


def infer():
    with torch.inference_mode():
        return F.softmax(model(occupancy), 1)


step = {"train": train, "infer": infer}[mode]
for _ in range(3):
    step()
times, start = [], time.perf_counter()
while len(times) < 6 or time.perf_counter() - start < seconds:
    before = time.perf_counter()
    step()
    times.append(time.perf_counter() - before)
rate = BATCH / sorted(times)[len(times) // 2]
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"mode": mode, "samples_per_s": round(rate, 1), "peak_mb": round(peak)}))
