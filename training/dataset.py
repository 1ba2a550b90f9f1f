"""Reads the rendered players that `cargo xtask dataset` writes: folders with crops.npy, mask.npy, offset_mm.npy, meta.jsonl."""

import json
from pathlib import Path

import numpy as np

OUTSIDE = np.iinfo(np.int16).min  # in offset_mm: no player here


class Rendered:
    """All samples under a folder, by number. The arrays stay on disk."""

    def __init__(self, folder):
        self.shards = []
        self.places = []
        for meta in sorted(Path(folder).rglob("meta.jsonl")):
            lines = [json.loads(line) for line in meta.read_text().splitlines() if line.strip()]
            arrays = [np.load(meta.parent / f"{name}.npy", mmap_mode="r") for name in ("crops", "mask", "offset_mm")]
            if any(len(array) != len(lines) for array in arrays):
                raise ValueError(f"{meta.parent}: meta.jsonl has {len(lines)} lines, the arrays {[len(a) for a in arrays]} samples; render it again")
            self.places += [(len(self.shards), row) for row in range(len(lines))]
            self.shards.append((arrays, lines))
        if not self.places:
            raise ValueError(f"{folder}: no meta.jsonl below it; run `cargo xtask dataset depth-train`")

    def __len__(self):
        return len(self.places)

    def __getitem__(self, index):
        """Crop (256, 256, 3) u8, true mask (256, 256) u8, offset in metres (128, 128) with NaN outside, meta."""
        shard, row = self.places[index]
        (crops, mask, offset), lines = self.shards[shard]
        metres = np.where(offset[row] == OUTSIDE, np.nan, offset[row] / 1000.0)
        return np.asarray(crops[row]), np.asarray(mask[row]), metres, lines[row]


def view_of(meta):
    """Pixels of the crop per metre at the player, and the tangent of the angle at which the camera looks down on the anchor."""
    camera = meta["camera"]
    rotation = np.array(camera["rotation"], float).reshape(3, 3).T  # written by columns
    sight = np.array(meta["anchor_m"], float) - np.array(camera["position"], float)
    depth = (rotation @ sight)[2]
    return camera["focal_px"] / depth / meta["crop"][2], -sight[1] / np.hypot(sight[0], sight[2])
