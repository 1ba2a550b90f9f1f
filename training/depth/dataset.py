"""Reads the rendered players that `cargo xtask dataset` writes: folders with crops.npy, mask.npy, offset_mm.npy, front_mm.npy, back_mm.npy, meta.jsonl."""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

OUTSIDE = np.iinfo(np.int16).min  # in offset_mm: no player here


class Rendered:
    """All samples under a folder, by number. The arrays stay on disk."""

    def __init__(self, folder):
        self.shards = []
        self.places = []
        for meta in sorted(Path(folder).rglob("meta.jsonl")):
            lines = [json.loads(line) for line in meta.read_text().splitlines() if line.strip()]
            arrays = [np.load(meta.parent / f"{name}.npy", mmap_mode="r") for name in ("crops", "mask", "offset_mm", "front_mm", "back_mm")]
            if any(len(array) != len(lines) for array in arrays):
                raise ValueError(f"{meta.parent}: meta.jsonl has {len(lines)} lines, the arrays {[len(a) for a in arrays]} samples; render it again")
            self.places += [(len(self.shards), row) for row in range(len(lines))]
            self.shards.append((arrays, lines))
        if not self.places:
            raise ValueError(f"{folder}: no meta.jsonl below it; run `cargo xtask dataset depth-train`")

    def __len__(self):
        return len(self.places)

    def __getitem__(self, index):
        """The sample, see `Sample`."""
        shard, row = self.places[index]
        (crops, mask, *planes), lines = self.shards[shard]
        metres = [np.where(plane[row] == OUTSIDE, np.nan, plane[row] / 1000.0) for plane in planes]
        return Sample(np.asarray(crops[row]), np.asarray(mask[row]), *metres, lines[row])


class Sample(NamedTuple):
    """Crop (256, 256, 3) u8 and true visible mask (256, 256) u8; in metres from the upright plane, (128, 128), NaN outside: what is seen of the
    body, its whole first surface, its last surface; the line of meta.jsonl."""

    crop: np.ndarray
    mask: np.ndarray
    seen: np.ndarray
    front: np.ndarray
    back: np.ndarray
    meta: dict

    def to_crop(self, pixels):
        """Pixels of the clip (…, 2) as pixels of the crop."""
        return (np.asarray(pixels, float) - self.meta["crop"][:2]) / self.meta["crop"][2]

    @property
    def box(self):
        """Left, top, right, bottom of the whole body inside the crop, pixels of the crop."""
        rows, columns = np.nonzero(np.isfinite(self.front))
        return np.array([2.0 * columns.min(), 2.0 * rows.min(), 2.0 * columns.max() + 1, 2.0 * rows.max() + 1])


def rotation_of(meta):
    """World to camera: rows are the camera's right, down, ahead."""
    return np.array(meta["camera"]["rotation"], float).reshape(3, 3).T  # written by columns


def view_of(meta):
    """Pixels of the crop per metre at the player, and the tangent of the angle at which the camera looks down on the anchor."""
    camera = meta["camera"]
    sight = np.array(meta["anchor_m"], float) - np.array(camera["position"], float)
    depth = (rotation_of(meta) @ sight)[2]
    return camera["focal_px"] / depth / meta["crop"][2], -sight[1] / np.hypot(sight[0], sight[2])
