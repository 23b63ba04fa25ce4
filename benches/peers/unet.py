"""The network of src/domain/unet in PyTorch, under the names of a checkpoint's arrays."""

import torch
from torch import nn
from torch.nn import functional as F


class UNet(nn.Module):
    def __init__(self, classes):
        super().__init__()
        conv = lambda inputs, outputs: nn.Conv2d(inputs, outputs, 3, padding=1)
        self.encoder1, self.encoder2, self.encoder3 = conv(1, 32), conv(32, 64), conv(64, 128)
        self.bottleneck, self.decoder3, self.decoder2 = conv(128, 128), conv(256, 64), conv(128, 32)
        self.head = nn.Conv2d(64, classes, 1)

    def forward(self, x):
        double = lambda x: F.interpolate(x, scale_factor=2, mode="nearest")
        level1 = F.relu(self.encoder1(x))
        level2 = F.relu(self.encoder2(F.max_pool2d(level1, 2)))
        level3 = F.relu(self.encoder3(F.max_pool2d(level2, 2)))
        bottom = F.relu(self.bottleneck(F.max_pool2d(level3, 2)))
        up3 = F.relu(self.decoder3(torch.cat([double(bottom), level3], 1)))
        up2 = F.relu(self.decoder2(torch.cat([double(up3), level2], 1)))
        return self.head(torch.cat([double(up2), level1], 1))
