"""The depth network: a small U-Net, two inputs, one volume of classes.

`picture` N×4×128×128: red, green, blue, mask, all 0..1. `pose` N×3×64×64: `window.paint`. Output `classes` N×50×64×64: logits;
class 0 is background, class 1 + k the distance (k − 24) · 0.02 m behind the upright plane. Most of the work is done at 32² and
below: the shape of a body is decided by its pose, the 64² level only has to follow the outline.
"""

import torch
from torch import nn
from torch.nn import functional

BINS = 49
BIN_M = 0.02


def bin_centres():
    """Distance of each depth class from the plane, metres, positive away."""
    return (torch.arange(BINS, dtype=torch.float32) - BINS // 2) * BIN_M


def _convolution(a, b, size, stride=1, padding=0):
    return nn.Sequential(nn.Conv2d(a, b, size, stride, padding, bias=False), nn.BatchNorm2d(b), nn.ReLU(inplace=True))


class Block(nn.Module):
    """3×3, residual."""

    def __init__(self, width):
        super().__init__()
        self.layers = _convolution(width, width, 3, padding=1)

    def forward(self, x):
        return x + self.layers(x)


class DepthNetwork(nn.Module):
    """See the module's text. `widths` are those of the levels 32², 16², 8², 4²; `blocks` their encoder's depths."""

    def __init__(self, widths=(28, 56, 96, 128), blocks=(2, 2, 2, 2), fine=20):
        super().__init__()
        self.stem = _convolution(4, 16, 4, stride=2, padding=1)
        seen = 16 + 3
        self.down = nn.ModuleList([_convolution(a, b, 2, stride=2) for a, b in zip((seen, *widths), widths)])
        self.encoder = nn.ModuleList([nn.Sequential(*[Block(w) for _ in range(n)]) for w, n in zip(widths, blocks)])
        self.lateral = nn.ModuleList([nn.Conv2d(b, a, 1) for a, b in zip(widths, widths[1:])])
        self.decoder = nn.ModuleList([Block(w) for w in widths[:-1]])
        self.twice = nn.Upsample(scale_factor=2, mode="nearest")
        self.fine = _convolution(seen, fine, 3, padding=1)
        self.coarse = nn.Conv2d(widths[0], fine, 1)
        self.smooth = nn.Sequential(nn.Conv2d(fine, fine, 5, padding=2, groups=fine, bias=False), nn.BatchNorm2d(fine), nn.ReLU(inplace=True))
        self.head = nn.Conv2d(2 * fine, BINS + 1, 1)

    def features(self, picture, pose):
        """What the classes are read from, N×C×64×64."""
        seen = torch.cat([self.stem(picture * 4.0 - 2.0), pose], 1)
        x, levels = seen, []
        for down, stage in zip(self.down, self.encoder):
            x = stage(down(x))
            levels.append(x)
        for level in range(len(self.lateral) - 1, -1, -1):
            x = self.decoder[level](levels[level] + self.twice(self.lateral[level](x)))
        fine = self.fine(seen) + self.twice(self.coarse(x))
        return torch.cat([fine, self.smooth(fine)], 1)

    def forward(self, picture, pose):
        return self.head(self.features(picture, pose))

    def classes_at(self, features, cells):
        """Logits (M, 50) of the cells that `cells` (N×64×64 bool) chooses: all that training needs, at a fifth of the time."""
        return functional.linear(features.permute(0, 2, 3, 1)[cells], self.head.weight[:, :, 0, 0], self.head.bias)


def read_out(classes):
    """Offset in metres (expectation over the depth classes) and probability of the player, each N×64×64, from the logits."""
    background = torch.softmax(classes, 1)[:, 0]
    depth = torch.softmax(classes[:, 1:], 1)
    offset = (depth * bin_centres().to(classes)[None, :, None, None]).sum(1)
    return offset, 1.0 - background
