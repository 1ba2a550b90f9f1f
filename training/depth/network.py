"""The depth network: a U-Net, two inputs, two surfaces.

`picture` N×4×128×128: red, green, blue, mask, all 0..1. `pose` N×4×64×64: `window.paint`. Output N×6×128×128, see `read_out`.

Four pixels are one cell of 64², and most of the work is done at 32² and below: the shape of a body is decided by its pose, the finer levels only have to
follow the outline. Every level is plain 3×3 convolutions, which processors with matrix units train several times faster in half precision.
"""

import torch
from torch import nn
from torch.nn import functional

OUTPUTS = 6
INPUTS = 4 * 4 + 4  # four pixels of the picture and the pose, at 64²


def convolution(inside, outside, stride=1, side=3):
    return nn.Sequential(nn.Conv2d(inside, outside, side, stride, (side - 1) // 2, bias=False), nn.BatchNorm2d(outside), nn.ReLU(inplace=True))


class Block(nn.Module):
    """3×3, residual."""

    def __init__(self, width):
        super().__init__()
        self.layers = convolution(width, width)

    def forward(self, x):
        return x + self.layers(x)


def blocks(width, count):
    return nn.Sequential(*[Block(width) for _ in range(count)])


class DepthNetwork(nn.Module):
    """See the module's text. `widths` are those of the levels 32², 16², 8², 4²; `encoder` and `decoder` how many blocks they have; `fine` the width of 64²."""

    def __init__(self, widths=(64, 128, 224, 256), encoder=(3, 4, 4, 3), decoder=(2, 2, 2), fine=32):
        super().__init__()
        self.unshuffle = nn.PixelUnshuffle(2)
        self.stem = convolution(INPUTS, fine)
        self.down = nn.ModuleList([convolution(a, b, stride=2) for a, b in zip((fine, *widths), widths)])
        self.encoder = nn.ModuleList([blocks(width, count) for width, count in zip(widths, encoder)])
        self.lateral = nn.ModuleList([convolution(b, a, side=1) for a, b in zip(widths, widths[1:])])
        self.decoder = nn.ModuleList([blocks(width, count) for width, count in zip(widths, decoder)])
        self.coarse = convolution(widths[0], fine, side=1)
        self.fine = blocks(fine, 2)
        self.head = nn.Conv2d(fine, 4 * OUTPUTS, 3, 1, 1)
        self.twice = nn.Upsample(scale_factor=2, mode="nearest")
        self.shuffle = nn.PixelShuffle(2)

    def forward(self, picture, pose):
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=self.training):
            fine = self.stem(torch.cat([self.unshuffle(picture * 4.0 - 2.0), pose], 1))
            x, levels = fine, []
            for down, stage in zip(self.down, self.encoder):
                x = stage(down(x))
                levels.append(x)
            for level in range(len(self.lateral) - 1, -1, -1):
                x = self.decoder[level](levels[level] + self.twice(self.lateral[level](x)))
            told = self.head(self.fine(fine + self.twice(self.coarse(x))))
        return self.shuffle(told.float())


def read_out(told):
    """From the network's output N×6×128×128, each N×128×128: logits that a pixel belongs to the body and nobody stands before it, and that it belongs
    to the body; metres from the upright plane to the body's first and last surface; logarithms of the errors to expect of both, no more than
    a factor of twenty from 5 cm."""
    seen, body, front, thickness, doubt, back_doubt = told.unbind(1)
    front = front * 0.3
    # The last surface never lies before the first.
    back = front + 0.25 * functional.softplus(thickness)
    return seen, body, front, back, *(3.0 * torch.tanh(spread / 3.0) - 3.0 for spread in (doubt, back_doubt))
