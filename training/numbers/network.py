"""The number network: 32 × 32 cells of a back to the logits of 10 tens (0: none), 10 units, and whether a number can be read at all."""

import torch
from torch import nn

WIDTHS = (24, 40, 64, 96)
TENS, UNITS = 10, 10


def block(inside, outside, stride=1):
    return nn.Sequential(nn.Conv2d(inside, outside, 3, stride, 1, bias=False), nn.BatchNorm2d(outside), nn.ReLU(inplace=True))


class NumberNetwork(nn.Module):
    def __init__(self):
        super().__init__()
        layers = [block(3, WIDTHS[0])]
        for before, width in zip(WIDTHS, WIDTHS[1:]):
            layers += [block(before, width, 2), block(width, width)]
        self.look = nn.Sequential(*layers)
        # Digits are told apart by what lies where, so the places are kept.
        self.read = nn.Sequential(nn.Flatten(), nn.Dropout(0.15), nn.Linear(WIDTHS[-1] * 16, 96), nn.ReLU(inplace=True), nn.Linear(96, TENS + UNITS + 1))

    def forward(self, patch):
        # Every patch by its own mean and spread: kits and light differ, strokes do not.
        mean = patch.mean((1, 2, 3), keepdim=True)
        spread = (patch - mean).pow(2).mean((1, 2, 3), keepdim=True).add(1e-3).sqrt()
        return self.read(self.look((patch - mean) / spread))


def split(logits):
    return torch.split(logits, (TENS, UNITS, 1), 1)
