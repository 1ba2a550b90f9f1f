"""The pitch network: a small U-Net from a picture (N×3×288×512, RGB 0..1) to maps (N×66×72×128, logits): 43 points, 22 kinds of lines, the
pitch's area. See `points.py` for the order."""

import torch
from torch import nn

from points import CHANNELS


def convolution(a, b, stride=1, size=3):
    return nn.Sequential(nn.Conv2d(a, b, size, stride, size // 2, bias=False), nn.BatchNorm2d(b), nn.ReLU(inplace=True))


class Block(nn.Module):
    """Two 3×3, residual."""

    def __init__(self, width):
        super().__init__()
        self.layers = nn.Sequential(convolution(width, width), nn.Conv2d(width, width, 3, 1, 1, bias=False), nn.BatchNorm2d(width))

    def forward(self, x):
        return torch.relu(x + self.layers(x))


class Context(nn.Module):
    """Whole rows and columns: a line is known by what lies far along it."""

    def __init__(self, width):
        super().__init__()
        self.across = nn.Conv2d(width, width, (1, 15), padding=(0, 7), groups=width, bias=False)
        self.down = nn.Conv2d(width, width, (9, 1), padding=(4, 0), groups=width, bias=False)
        self.mix = nn.Sequential(nn.BatchNorm2d(width), nn.ReLU(inplace=True), nn.Conv2d(width, width, 1, bias=False), nn.BatchNorm2d(width))

    def forward(self, x):
        return torch.relu(x + self.mix(self.across(x) + self.down(x)))


class PitchNetwork(nn.Module):
    """`widths` are those of the levels at a 4th, 8th, 16th and 32nd of the input."""

    def __init__(self, widths=(28, 56, 96, 160)):
        super().__init__()
        self.stem = nn.Sequential(convolution(3, 16, 2), convolution(16, widths[0], 2))
        self.first = Block(widths[0])
        self.down = nn.ModuleList([convolution(a, b, 2) for a, b in zip(widths, widths[1:])])
        self.stages = nn.ModuleList([Block(widths[1]), nn.Sequential(Block(widths[2]), Block(widths[2])), nn.Sequential(Block(widths[3]), Context(widths[3]), Block(widths[3]))])
        self.lateral = nn.ModuleList([nn.Sequential(nn.Conv2d(b, a, 1, bias=False), nn.BatchNorm2d(a)) for a, b in zip(widths, widths[1:])])
        self.decoder = nn.ModuleList([convolution(w, w) for w in widths[:-1]])
        self.twice = nn.Upsample(scale_factor=2, mode="nearest")
        self.last = convolution(widths[0], 48)
        self.head = nn.Conv2d(48, CHANNELS, 1)
        nn.init.constant_(self.head.bias, -5.0)

    def forward(self, picture):
        x = self.first(self.stem(picture * 4.0 - 2.0))
        levels = [x]
        for down, stage in zip(self.down, self.stages):
            x = stage(down(x))
            levels.append(x)
        for level in range(len(self.lateral) - 1, -1, -1):
            x = self.decoder[level](torch.relu(levels[level] + self.twice(self.lateral[level](x))))
        return self.head(self.last(x))
