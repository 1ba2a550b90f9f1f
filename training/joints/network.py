"""The joint network: where the pose network's joints really are, from the whole pose. Two hidden layers; no picture.

`normal` is what `reconstructor/src/pose/refine.rs` does before and after it: change both or none.
"""

import numpy as np
from torch import nn

JOINTS = 33
LEFT_HIP, RIGHT_HIP = 23, 24
WIDTH = 192


class JointNetwork(nn.Module):
    def __init__(self):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(3 * JOINTS + 1, WIDTH), nn.ReLU(), nn.Linear(WIDTH, WIDTH), nn.ReLU(), nn.Linear(WIDTH, 2 * JOINTS)
        )

    def forward(self, pose):
        """N×100 to shifts N×66 (x, y of each joint), in tenths of the height that the joints span."""
        return self.layers(pose)


def span_of(read):
    """Height that the joints N×33×3 span, pixels."""
    return np.maximum(np.ptp(read[:, :, 1], axis=1), 1.0)


def normal(read):
    """The network's input N×100: joints from the middle of the hips in quarters of the span, visibilities −1..1, how large the person is."""
    span = span_of(read)
    middle = (read[:, LEFT_HIP, :2] + read[:, RIGHT_HIP, :2]) / 2
    places = 4 * (read[:, :, :2] - middle[:, None]) / span[:, None, None]
    return np.concatenate([places.reshape(len(read), -1), 2 * read[:, :, 2] - 1, np.log(span / 50)[:, None]], axis=1).astype(np.float32)
