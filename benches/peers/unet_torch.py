"""Trains, or predicts with, the network of src/domain/unet in PyTorch and prints one line of JSON.

    python unet_torch.py train|infer SECONDS THREADS [paper|shipped]

Batches of 32 windows of 64 x 64 cells, memory format channels_last, Adam; the loss is eq. 4 of the paper, or that of ranks,
densities and directions.
"""

import sys

import torch
from torch.nn import functional as F

from unet import NETWORKS, Said, UNet, report

mode, seconds, threads = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
name = sys.argv[4] if len(sys.argv) > 4 else "paper"
torch.set_num_threads(threads)
torch.manual_seed(0)
BATCH, SIZE = 32, 64
planes, outputs = NETWORKS[name]

model = UNet(planes, outputs).to(memory_format=torch.channels_last)
said = Said(model, name)
assert name != "paper" or sum(p.numel() for p in model.parameters()) == 424_932
shown = (torch.rand(BATCH, planes, SIZE, SIZE) > 0.5).float().to(memory_format=torch.channels_last)
labels = torch.randint(-1, 4, (BATCH, SIZE, SIZE))
weights = torch.tensor([0.006, 0.033, 0.194, 0.767])
rank = torch.rand(BATCH, SIZE, SIZE)
free = (torch.rand(BATCH, SIZE, SIZE) > 0.25).float()
flow = F.softmax(torch.randn(BATCH, 8, SIZE, SIZE), 1).to(memory_format=torch.channels_last)
optimizer = torch.optim.Adam(model.parameters(), 1e-3)


def loss_of(logits):
    if name == "paper":
        # With weights, PyTorch's mean is the weighted sum divided by the sum of weights: eq. 4.
        return F.cross_entropy(logits, labels, weight=weights, ignore_index=-1)
    loss = F.binary_cross_entropy_with_logits(logits[:, 0], rank, reduction="none")
    loss = loss + 0.1 * F.poisson_nll_loss(logits[:, 1].clamp(-12, 12), 2 * rank, reduction="none")
    loss = loss + 0.1 * F.cross_entropy(logits[:, 2:], flow, reduction="none")
    return (loss * free).sum() / free.sum()


def train():
    optimizer.zero_grad(set_to_none=True)
    loss = loss_of(model(shown))
    loss.backward()
    optimizer.step()
    return loss.item()


def infer():
    with torch.inference_mode():
        return said(shown)


report(mode, {"train": train, "infer": infer}[mode], BATCH, seconds)
