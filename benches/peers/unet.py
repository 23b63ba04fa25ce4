"""The network of src/domain/unet in PyTorch, under the names of a checkpoint's arrays, and what is made of its logits."""

import json
import resource
import time

import torch
from torch import nn
from torch.nn import functional as F

# Planes that are shown and numbers that are said: three classes and the obstacle; rank, density and eight directions.
NETWORKS = {"paper": (1, 4), "shipped": (2, 10)}


class UNet(nn.Module):
    def __init__(self, planes, outputs):
        super().__init__()
        conv = lambda inputs, outputs: nn.Conv2d(inputs, outputs, 3, padding=1)
        self.encoder1, self.encoder2, self.encoder3 = conv(planes, 32), conv(32, 64), conv(64, 128)
        self.bottleneck, self.decoder3, self.decoder2 = conv(128, 128), conv(256, 64), conv(128, 32)
        self.head = nn.Conv2d(64, outputs, 1)

    def forward(self, x):
        double = lambda x: F.interpolate(x, scale_factor=2, mode="nearest")
        level1 = F.relu(self.encoder1(x))
        level2 = F.relu(self.encoder2(F.max_pool2d(level1, 2)))
        level3 = F.relu(self.encoder3(F.max_pool2d(level2, 2)))
        bottom = F.relu(self.bottleneck(F.max_pool2d(level3, 2)))
        up3 = F.relu(self.decoder3(torch.cat([double(bottom), level3], 1)))
        up2 = F.relu(self.decoder2(torch.cat([double(up3), level2], 1)))
        return self.head(torch.cat([double(up2), level1], 1))


class Said(nn.Module):
    """Probabilities of classes, or rank, density and shares of directions."""

    def __init__(self, network, name):
        super().__init__()
        self.network, self.name = network, name

    def forward(self, x):
        logits = self.network(x)
        if self.name == "paper":
            return F.softmax(logits, 1)
        rank, density, flow = logits[:, :1], logits[:, 1:2], logits[:, 2:]
        return torch.cat([torch.sigmoid(rank), torch.exp(density.clamp(-12, 12)), F.softmax(flow, 1)], 1)


def report(mode, step, batch, seconds):
    """Takes steps for some seconds after three to warm up, and prints samples per second and peak memory as JSON."""
    for _ in range(3):
        step()
    times, start = [], time.perf_counter()
    while len(times) < 6 or time.perf_counter() - start < seconds:
        before = time.perf_counter()
        step()
        times.append(time.perf_counter() - before)
    rate = batch / sorted(times)[len(times) // 2]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"mode": mode, "samples_per_s": round(rate, 1), "peak_mb": round(peak)}))
