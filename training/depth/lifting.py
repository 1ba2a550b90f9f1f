"""The lifting network: where a player's joints are in space, from the picture and the pose as it was read.

`picture` N×4×128×128 and `pose` N×4×64×64 as the depth network's; `joints` N×132 as `normal` makes them. Output N×99: x and y of every joint in
metres from the middle of the window, and metres behind the hips.

It sees half the picture's resolution: what it has to find is how a body is turned and which limb is before which; the pose network has found
the outline already. `reconstructor/src/depth/lifting.rs` does what is around it: change both or none.
"""

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from network import blocks, convolution

JOINTS = 33
VECTOR = 4 * JOINTS
CELLS = 4  # the last level has 4² of them
# The joint on the other side of the body.
MIRROR = [0, 4, 5, 6, 1, 2, 3, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15, 18, 17, 20, 19, 22, 21, 24, 23, 26, 25, 28, 27, 30, 29, 32, 31]
# Joints that are taught: nose, arms without hands, legs. They are what is painted.
TAUGHT = [0, *range(11, 17), *range(23, 33)]


class LiftingNetwork(nn.Module):
    """See the module's text. `widths` are those of the levels 64², 32², 16², 8², 4², `counts` how many blocks they have."""

    def __init__(self, widths=(24, 48, 96, 160, 224), counts=(0, 2, 3, 4, 3), squeezed=48, hidden=512):
        super().__init__()
        self.stem = convolution(8, widths[0])
        self.down = nn.ModuleList([convolution(a, b, stride=2) for a, b in zip(widths, widths[1:])])
        self.stages = nn.ModuleList([blocks(width, count) for width, count in zip(widths[1:], counts[1:])])
        self.squeeze = convolution(widths[-1], squeezed, side=1)
        self.first = nn.Linear(squeezed * CELLS**2 + VECTOR, hidden)
        self.steps = nn.ModuleList([nn.Sequential(nn.BatchNorm1d(hidden), nn.ReLU(), nn.Linear(hidden, hidden)) for _ in range(2)])
        self.last = nn.Sequential(nn.BatchNorm1d(hidden), nn.ReLU(), nn.Linear(hidden, 3 * JOINTS))

    def forward(self, picture, pose, joints):
        return self.told(functional.avg_pool2d(picture, 2), pose, joints)

    def told(self, picture, pose, joints):
        """From the picture at half its resolution."""
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=self.training):
            x = self.stem(torch.cat([picture * 4.0 - 2.0, pose], 1))
            for down, stage in zip(self.down, self.stages):
                x = stage(down(x))
            x = self.squeeze(x)
        x = self.first(torch.cat([x.float().flatten(1), joints], 1))
        for step in self.steps:
            x = x + step(x)
        # Where the pose network saw a joint is where it is, but for what is mended here.
        places = joints[:, : 2 * JOINTS].reshape(-1, JOINTS, 2)
        depth = joints[:, 2 * JOINTS : 3 * JOINTS, None]
        return (torch.cat([places, 0.5 * depth], 2) + 0.2 * self.last(x).reshape(-1, JOINTS, 3)).flatten(1)


def normal(joints, depth, visibility, centre, pixels_per_metre):
    """N×132: metres right of and below the middle of the window, metres behind the hips, visibilities −1..1."""
    places = (joints - np.reshape(centre, (-1, 1, 2))) / np.reshape(pixels_per_metre, (-1, 1, 1))
    return np.concatenate([places.reshape(len(joints), -1), depth, 2 * visibility - 1], 1, dtype=np.float32).clip(-3, 3)


def mirrored(joints):
    """`normal`'s numbers of the mirrored picture."""
    places, rest = joints[:, : 2 * JOINTS].reshape(-1, JOINTS, 2), joints[:, 2 * JOINTS :].reshape(-1, 2, JOINTS)
    across = torch.tensor([-1.0, 1.0])
    return torch.cat([(places[:, MIRROR] * across).flatten(1), rest[:, :, MIRROR].flatten(1)], 1)
