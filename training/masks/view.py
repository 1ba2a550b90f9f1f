"""What the mask network sees of one person, sampled as `reconstructor/src/segmentation/refine.rs` does: change both or none.

Channels: red, green, blue; own mask and bones; masks and bones of people in front; of people behind. All 0..1.
"""

import cv2
import numpy as np

ROWS, COLUMNS, CHANNELS = 96, 64, 9
MARGIN = 1.25
OWN, FRONT, BEHIND = 3, 5, 7
LARGE_PIECE = 0.25
BONES = [(11, 12), (23, 24), (11, 23), (12, 24), (11, 13), (13, 15), (12, 14), (14, 16), (23, 25), (25, 27), (24, 26), (26, 28), (27, 31), (28, 32)]


class Person:
    """Joints (33, 2) in pixels, visibility (33,), mask 0..1 over a rectangle that begins at `first` (x, y)."""

    def __init__(self, joints, visibility, mask, first):
        self.joints = joints
        self.mask, self.first = clean(mask, joints - first), np.asarray(first, float)
        rows, columns = np.nonzero(self.mask >= 128 / 255)
        seen = joints[visibility > 0.5]
        corners = [seen]
        if len(rows):
            corners += [[[columns.min() - 0.5, rows.min() - 0.5] + self.first, [columns.max() + 0.5, rows.max() + 0.5] + self.first]]
        corners = np.concatenate(corners)
        self.usable = len(rows) > 0 and len(corners) > 0
        if self.usable:
            self.low, self.high = corners.min(0), corners.max(0)
            self.limb = max((self.high - self.low).max() / 16, 1.0)
            self.feet = joints[27:33, 1].max()


def clean(mask, joints):
    """Without pieces that neither a bone crosses nor are large; the rim of a pixel stays."""
    inside = (mask >= 128 / 255).astype(np.uint8)
    _, labels = cv2.connectedComponents(inside, connectivity=8)
    areas = np.bincount(labels.ravel())
    keep = np.zeros(len(areas), bool)
    for a, b in BONES:
        steps = int(np.ceil(max(np.linalg.norm(joints[b] - joints[a]), 1)))
        at = np.round(joints[a] + (joints[b] - joints[a]) * np.linspace(0, 1, steps + 1)[:, None]).astype(int)
        at = at[(at >= 0).all(1) & (at[:, 0] < mask.shape[1]) & (at[:, 1] < mask.shape[0])]
        keep[labels[at[:, 1], at[:, 0]]] = True
    if len(areas) > 1:
        keep |= areas >= LARGE_PIECE * areas[1:].max()
    keep[0] = False
    near = cv2.dilate(keep[labels].astype(np.uint8), np.ones((3, 3), np.uint8))
    return (mask * near).astype(np.float32)


class Window:
    """96 × 64 cells around a person; `shift` (shares of the box) and `scale` move it as a noisier box would."""

    def __init__(self, person, shift=(0.0, 0.0), scale=1.0):
        size = (person.high - person.low) * MARGIN * scale
        self.cell = max(size[1] / ROWS, size[0] / COLUMNS)
        centre = (person.low + person.high) / 2 + np.asarray(shift) * (person.high - person.low)
        self.corner = centre - np.array([COLUMNS, ROWS]) * self.cell / 2
        x = self.corner[0] + (np.arange(COLUMNS) + 0.5) * self.cell
        y = self.corner[1] + (np.arange(ROWS) + 0.5) * self.cell
        self.pixels = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)

    def sample(self, image, first=(0.0, 0.0), border=cv2.BORDER_CONSTANT):
        """Bilinear between pixels, averaged where cells are larger; `first` is where the image's first pixel lies."""
        n = int(np.clip(np.ceil(self.cell), 1, 16))
        step = self.cell / n
        begin = self.corner + step / 2 - np.asarray(first)
        matrix = np.array([[step, 0.0, begin[0]], [0.0, step, begin[1]]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        fine = cv2.warpAffine(np.ascontiguousarray(image, np.float32), matrix, (COLUMNS * n, ROWS * n), flags=flags, borderMode=border)
        return fine if n == 1 else cv2.resize(fine, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)

    def bones(self, person):
        """1 on a bone, falling off as a Gaussian of a limb's thickness."""
        least = np.full(len(self.pixels), np.inf)
        for a, b in BONES:
            start, along = person.joints[a], person.joints[b] - person.joints[a]
            length = along @ along
            part = np.clip((self.pixels - start) @ along / length, 0, 1) if length > 0 else np.zeros(len(self.pixels))
            least = np.minimum(least, ((self.pixels - start - part[:, None] * along) ** 2).sum(1))
        return np.exp(-least / person.limb**2).reshape(ROWS, COLUMNS)

    def touches(self, person):
        high = self.corner + np.array([COLUMNS, ROWS]) * self.cell
        return (person.low <= high).all() and (person.high >= self.corner).all()


def stack(picture, person, others, window):
    """The network's input, 9 × 96 × 64 of 0..1."""
    channels = np.zeros((CHANNELS, ROWS, COLUMNS), np.float32)
    channels[:3] = window.sample(picture, border=cv2.BORDER_REPLICATE).transpose(2, 0, 1) / 255.0
    for other in [person, *others]:
        if other is not person and not window.touches(other):
            continue
        place = OWN if other is person else FRONT if other.feet > person.feet else BEHIND
        channels[place] = np.maximum(channels[place], window.sample(other.mask, other.first))
        channels[place + 1] = np.maximum(channels[place + 1], window.bones(other))
    return channels
