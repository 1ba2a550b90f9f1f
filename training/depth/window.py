"""What the depth network looks at: a square of the picture around one player, and the pose painted over it.

`reconstructor/src/depth/window.rs` and `paint.rs` do the same arithmetic; `fixture.py` writes the vector that proves it.
Pixels: origin at the centre of the top-left pixel. Metres: across the line of sight at the player. Depth: positive away.
"""

import numpy as np

from prepass import samples_per_cell

PICTURE_SIZE = 128  # samples along one side of the picture that the network sees
GRID = 64  # cells along one side of the painted pose; the output has PICTURE_SIZE
WINDOW_M = 2.2  # side of the window at the player, metres
WINDOW_SLACK = 1.15  # the window is at least this many times the player's box (dives, stretched arms)
DEPTH_SCALE_M = 0.5  # metres that are 1.0 in the painted channels
DEPTH_CLIP = 3.0  # painted channels stay within ± this
EDGE_M = 0.1  # width of the presence ramp at a limb's border

NECK, PELVIS = 33, 34  # middle of the shoulders and of the hips, after BlazePose's 33
# Limbs: joint, joint, radius in metres.
LIMBS = (
    (0, NECK, 0.10),
    (11, 12, 0.09),
    (23, 24, 0.11),
    (11, 23, 0.10),
    (12, 24, 0.10),
    (NECK, PELVIS, 0.12),
    (11, 13, 0.05),
    (13, 15, 0.05),
    (12, 14, 0.05),
    (14, 16, 0.05),
    (23, 25, 0.08),
    (24, 26, 0.08),
    (25, 27, 0.06),
    (26, 28, 0.06),
    (27, 29, 0.05),
    (28, 30, 0.05),
    (29, 31, 0.05),
    (30, 32, 0.05),
)


def mask_box(mask):
    """(x0, y0, x1, y1) of the pixels of `mask` (u8) that are at least half covered, edges included; None if there are none."""
    rows, columns = np.nonzero(mask >= 128)
    if len(rows) == 0:
        return None
    return columns.min(), rows.min(), columns.max(), rows.max()


def window_of(box, pixels_per_metre):
    """Centre (x, y) and side in pixels of the square the network sees, from the mask's box."""
    x0, y0, x1, y1 = (float(v) for v in box)
    side = max(WINDOW_M * pixels_per_metre, WINDOW_SLACK * (max(x1 - x0, y1 - y0) + 1.0))
    return np.array([(x0 + x1) / 2, (y0 + y1) / 2]), side


def sample(image, centre, side, size):
    """`image` (H, W, C) seen through a square, as (size, size, C) float64: bilinear, averaged when it shrinks, borders repeated."""
    n = samples_per_cell(side, size)
    steps = (np.arange(size * n) + 0.5) / (size * n) - 0.5
    x0, x1, fx = _neighbours(centre[0] + steps * side, image.shape[1])
    y0, y1, fy = _neighbours(centre[1] + steps * side, image.shape[0])
    source = image.astype(np.float64)
    rows = source[y0] * (1 - fy)[:, None, None] + source[y1] * fy[:, None, None]
    fine = rows[:, x0] * (1 - fx)[None, :, None] + rows[:, x1] * fx[None, :, None]
    return fine.reshape(size, n, size, n, -1).mean((1, 3))


def _neighbours(positions, length):
    clamped = np.clip(positions, 0.0, length - 1.0)
    low = np.floor(clamped).astype(int)
    return low, np.minimum(low + 1, length - 1), clamped - low


def limb_side(first, second):
    """+1 for a limb of the person's left, −1 for one of the right, 0 for what joins both."""
    if first in (0, NECK, PELVIS) or second in (NECK, PELVIS) or (first - second) % 2:
        return 0.0
    return 1.0 if first % 2 else -1.0


def paint(joints_px, joints_z_m, centre, side, pixels_per_metre, tangent, size=GRID):
    """The pose over the window, (4, size, size) float64.

    Channel 0: presence, 1 inside a limb, falling to 0 over `EDGE_M`. Channel 1: depth of the nearest limb that covers the cell,
    or of the closest one beside it, relative to the hips. Channel 2: `limb_side` of that limb. Channel 3: depth of the upright
    plane through the hips there, from the slope `tangent` at which the camera looks down. Depths in units of `DEPTH_SCALE_M`.
    """
    joints = np.concatenate([joints_px, [(joints_px[11] + joints_px[12]) / 2, (joints_px[23] + joints_px[24]) / 2]])
    depth = np.concatenate([joints_z_m, [(joints_z_m[11] + joints_z_m[12]) / 2, (joints_z_m[23] + joints_z_m[24]) / 2]])
    steps = ((np.arange(size) + 0.5) / size - 0.5) * side
    x = ((centre[0] + steps) / pixels_per_metre)[None, :]
    y = ((centre[1] + steps) / pixels_per_metre)[:, None]
    joints = joints / pixels_per_metre
    covered = np.full((size, size), np.inf)
    beside, covering, aside = (np.zeros((size, size)) for _ in range(3))
    edge = np.full((size, size), np.inf)
    for first, second, radius in LIMBS:
        a, d = joints[first], joints[second] - joints[first]
        t = np.clip(((x - a[0]) * d[0] + (y - a[1]) * d[1]) / max(d @ d, 1e-9), 0.0, 1.0)
        distance = np.sqrt((x - a[0] - t * d[0]) ** 2 + (y - a[1] - t * d[1]) ** 2) - radius
        z = depth[first] + t * (depth[second] - depth[first])
        nearer, closer = (distance <= 0.0) & (z < covered), distance < edge
        covered, covering = np.where(nearer, z, covered), np.where(nearer, limb_side(first, second), covering)
        beside, aside = np.where(closer, z, beside), np.where(closer, limb_side(first, second), aside)
        edge = np.minimum(edge, distance)
    presence = np.clip(1.0 - edge / EDGE_M, 0.0, 1.0)
    inside = np.isfinite(covered)
    plane = np.broadcast_to((y - joints[PELVIS][1]) * tangent, (size, size))
    nearest, plane = (np.clip(z / DEPTH_SCALE_M, -DEPTH_CLIP, DEPTH_CLIP) for z in (np.where(inside, covered, beside), plane))
    return np.stack([presence, nearest, np.where(inside, covering, aside), plane])
