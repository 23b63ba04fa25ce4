"""Trains, or predicts with, the network of src/domain/unet in PyTorch and prints one line of JSON.

    python unet_torch.py train|infer SECONDS THREADS

Batches of 32 windows of 64 x 64 cells, memory format channels_last, Adam, eq. 4 of the paper as the loss.
"""

import json
import resource
import sys
import time

import torch
from torch import nn
from torch.nn import functional as F

mode, seconds, threads = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
torch.set_num_threads(threads)
torch.manual_seed(0)
BATCH, SIZE, CLASSES = 32, 64, 4


class UNet(nn.Module):
    def __init__(self):
        super().__init__()
        conv = lambda inputs, outputs: nn.Conv2d(inputs, outputs, 3, padding=1)
        self.encoder1, self.encoder2, self.encoder3 = conv(1, 32), conv(32, 64), conv(64, 128)
        self.bottleneck, self.decoder3, self.decoder2 = conv(128, 128), conv(256, 64), conv(128, 32)
        self.head = nn.Conv2d(64, CLASSES, 1)

    def forward(self, x):
        double = lambda x: F.interpolate(x, scale_factor=2, mode="nearest")
        level1 = F.relu(self.encoder1(x))
        level2 = F.relu(self.encoder2(F.max_pool2d(level1, 2)))
        level3 = F.relu(self.encoder3(F.max_pool2d(level2, 2)))
        bottom = F.relu(self.bottleneck(F.max_pool2d(level3, 2)))
        up3 = F.relu(self.decoder3(torch.cat([double(bottom), level3], 1)))
        up2 = F.relu(self.decoder2(torch.cat([double(up3), level2], 1)))
        return self.head(torch.cat([double(up2), level1], 1))


model = UNet().to(memory_format=torch.channels_last)
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
