"""A stack of hourglasses like the paper's (Newell et al. 2016, section 3.2 of the paper uses eight), for comparison only: same inputs and outputs as
`network.DepthNetwork`, two hourglasses, about as costly per player."""

import torch
from torch import nn
from torch.nn import functional

from network import INPUTS, OUTPUTS, convolution

WIDTH = 64
LEVELS = 4


class Bottleneck(nn.Module):
    """1×1, 3×3, 1×1, residual: the block of the paper's network."""

    def __init__(self, width):
        super().__init__()
        half = width // 2
        self.layers = nn.Sequential(convolution(width, half, side=1), convolution(half, half), convolution(half, width, side=1))

    def forward(self, x):
        return x + self.layers(x)


class Hourglass(nn.Module):
    def __init__(self, width, levels):
        super().__init__()
        self.beside, self.before, self.after = (Bottleneck(width) for _ in range(3))
        self.inner = Hourglass(width, levels - 1) if levels > 1 else Bottleneck(width)

    def forward(self, x):
        low = self.after(self.inner(self.before(functional.max_pool2d(x, 2))))
        return self.beside(x) + functional.interpolate(low, scale_factor=2, mode="nearest")


class HourglassNetwork(nn.Module):
    def __init__(self, stacks=2):
        super().__init__()
        self.unshuffle, self.shuffle = nn.PixelUnshuffle(2), nn.PixelShuffle(2)
        self.stem = nn.Sequential(convolution(INPUTS, WIDTH), Bottleneck(WIDTH))
        self.stacks = nn.ModuleList([nn.Sequential(Hourglass(WIDTH, LEVELS), Bottleneck(WIDTH), convolution(WIDTH, WIDTH, side=1)) for _ in range(stacks)])
        self.head = nn.Conv2d(WIDTH, 4 * OUTPUTS, 3, 1, 1)

    def forward(self, picture, pose):
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=self.training):
            x = self.stem(torch.cat([self.unshuffle(picture * 4.0 - 2.0), pose], 1))
            for stack in self.stacks:
                x = x + stack(x)
            told = self.head(x)
        return self.shuffle(told.float())
