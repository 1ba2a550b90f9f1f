"""What the number network sees of one person, sampled as `reconstructor/src/numbers/patch.rs` does: change both or none.

A square of 32 × 32 cells over the upper back, upright by the trunk; red, green, blue, 0..1.
"""

from typing import NamedTuple

import cv2
import numpy as np

CELLS = 32
SIDE = 1.15  # side of the square, in lengths of the trunk
DOWN = 0.40  # its middle below the middle of the shoulders, in lengths of the trunk
# The trunk is at least so long: of the shoulders' width, and of the height of the box. Who bends has no shorter number.
SHOULDERS, HEIGHT = 1.2, 0.20
TRUNK_MIN_PX = 8.0
TURN_MIN = 0.25  # width between the shoulders as seen from behind, in lengths of the trunk
LEFT_SHOULDER, RIGHT_SHOULDER, LEFT_HIP, RIGHT_HIP = 11, 12, 23, 24


class Patch(NamedTuple):
    """Middle (pixels), unit vector down the back, side of a cell (pixels), how far the back is turned to the camera (negative: the chest)."""

    middle: np.ndarray
    down: np.ndarray
    cell: float
    turn: float

    def across(self):
        return np.array([self.down[1], -self.down[0]])

    def usable(self):
        return self.turn >= TURN_MIN and self.cell * CELLS >= TRUNK_MIN_PX * SIDE


def patch(joints, height_px):
    """Of joints (33, 2) in pixels and the height of the person's box; None when the trunk is a point."""
    shoulders = (joints[LEFT_SHOULDER] + joints[RIGHT_SHOULDER]) / 2
    spine = (joints[LEFT_HIP] + joints[RIGHT_HIP]) / 2 - shoulders
    length = np.linalg.norm(spine)
    if not length > 1e-3:
        return None
    down = spine / length
    wide = joints[RIGHT_SHOULDER] - joints[LEFT_SHOULDER]
    trunk = max(length, SHOULDERS * np.linalg.norm(wide), HEIGHT * height_px)
    return Patch(shoulders + down * DOWN * trunk, down, SIDE * trunk / CELLS, wide @ np.array([down[1], -down[0]]) / trunk)


def sample(picture, patch, cells=CELLS, scale=1.0):
    """`cells` × `cells` of the picture around the patch's middle, bilinear between pixels, averaged where cells are larger. The picture may be an
    enlarged one, of `scale` pixels per pixel of the clip, which the joints are in."""
    cell = patch.cell * scale
    n = int(np.clip(np.ceil(patch.cell), 1, 16))
    step = cell / n
    across, down = patch.across() * step, patch.down * step
    first = patch.middle * scale - (across + down) * (cells * n - 1) / 2
    matrix = np.array([[across[0], down[0], first[0]], [across[1], down[1], first[1]]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    fine = cv2.warpAffine(np.ascontiguousarray(picture, np.float32), matrix, (cells * n, cells * n), flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return fine if n == 1 else cv2.resize(fine, (cells, cells), interpolation=cv2.INTER_AREA)
