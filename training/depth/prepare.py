"""Packs rendered players for training: what the earlier stages see of them, window, painted pose, surfaces on the output's grid.

    python3 prepare.py --rendered DATA/train --out PACKED/train [--seed 1] [--jitter 0.05] [--every 2 --first 0]

Folder by folder; those packed before are kept, so it can run again while more are being rendered, and beside another of the same. The
arrays cover a margin around the window, so that training can move it: `picture` (N, 144, 144, 4) u8; `pose` (N, 72, 72, 4) i8 in units of
`POSE_STEP`; `front` and `back` (N, 144, 144) i16 in millimetres, `OUTSIDE` where there is no body; `seen` (N, 144, 144) u8, 1 where nobody
stands before it. For the lifting network and `repaint.py`: `joints` (N, 33, 4), pixels of the crop, metres behind the hips, visibility, as read;
`truth` (N, 33, 3); `window` (N, 5): middle (x, y) and side of what the arrays cover, pixels per metre, tangent of the camera's descent.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from dataset import OUTSIDE, Rendered, rotation_of, view_of
from seen import Networks
from window import GRID, PICTURE_SIZE, mask_box, paint, window_of

import prepass

MARGIN = 4  # cells of the pose on each side
PACKED_GRID = GRID + 2 * MARGIN
PACKED_PICTURE = PACKED_GRID * (PICTURE_SIZE // GRID)
POSE_STEP = 0.025
ARRAYS = ("picture", "pose", "front", "back", "seen")
JOINT_ARRAYS = ("joints", "truth", "window")


def on_window(plane, centre, side, size):
    """The plane (128, 128) of a crop (256, 256), nearest samples of a window; NaN outside."""
    steps = ((np.arange(size) + 0.5) / size - 0.5) * side
    columns, rows = (np.round((middle + steps - 0.5) / 2).astype(int) for middle in centre)
    inside = lambda places: (places >= 0) & (places < plane.shape[0])
    found = plane[np.clip(rows, 0, plane.shape[0] - 1)[:, None], np.clip(columns, 0, plane.shape[1] - 1)[None]]
    return np.where(inside(rows)[:, None] & inside(columns)[None], found, np.nan)


def millimetres(plane):
    return np.where(np.isfinite(plane), np.round(np.nan_to_num(plane) * 1000), OUTSIDE).astype(np.int16)


def true_joints(sample):
    """(33, 3): pixels of the crop, metres behind the hips."""
    depth = np.array(sample.meta["joints_m"], float) @ rotation_of(sample.meta)[2]
    return np.column_stack([sample.to_crop(sample.meta["joints_px"]), depth - (depth[23] + depth[24]) / 2])


def pack(networks, sample, rng, jitter):
    """One packed sample, or the reason why there is none."""
    known = networks.look(sample, rng)
    if isinstance(known, str):
        return known
    box = mask_box(known.mask)
    if box is None:
        return "mask failed"
    pixels_per_metre, descent = view_of(sample.meta)
    pixels_per_metre *= float(np.exp(rng.normal(0.0, jitter)))
    centre, side = window_of(box, pixels_per_metre)
    wide = side * PACKED_GRID / GRID
    pose = paint(known.joints, known.depth, centre, wide, pixels_per_metre, descent, PACKED_GRID).transpose(1, 2, 0)
    front, back, seen = (on_window(plane, centre, wide, PACKED_PICTURE) for plane in (sample.front, sample.back, sample.seen))
    return (
        np.round(prepass.sample_quickly(np.dstack([sample.crop, known.mask]), centre, wide, PACKED_PICTURE)).astype(np.uint8),
        np.round(pose / POSE_STEP).clip(-127, 127).astype(np.int8),
        millimetres(front),
        millimetres(back),
        np.isfinite(seen).astype(np.uint8),
        np.column_stack([known.joints, known.depth, known.visibility]).astype(np.float32),
        true_joints(sample).astype(np.float32),
        np.array([*centre, wide, pixels_per_metre, descent], np.float32),
    )


def pack_folder(networks, folder, out, arguments):
    """Packs one folder of samples; gives the summary that it also writes, last."""
    samples, rows, reasons, began = Rendered(folder), [], {}, time.time()
    for index in range(len(samples)):
        sample = samples[index]
        packed = pack(networks, sample, np.random.default_rng([arguments.seed, sample.meta["index"]]), arguments.jitter)
        if isinstance(packed, str):
            reasons[packed] = reasons.get(packed, 0) + 1
        else:
            rows.append(packed)
    out.mkdir(parents=True, exist_ok=True)
    for name, arrays in zip((*ARRAYS, *JOINT_ARRAYS), zip(*rows)):
        np.save(out / f"{name}.npy", np.stack(arrays))
    summary = {"samples": len(rows), "dropped": reasons, "seed": arguments.seed, "seconds": round(time.time() - began)}
    (out / "packed.json").write_text(json.dumps(summary))
    return summary


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rendered", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jitter", type=float, default=0.05, help="standard deviation of the logarithm of the metric scale")
    parser.add_argument("--every", type=int, default=1, help="one folder of so many: the others are somebody else's")
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    networks = Networks()
    for meta in sorted(Path(arguments.rendered).rglob("meta.jsonl"))[arguments.first :: arguments.every]:
        out = Path(arguments.out) / meta.parent.name
        if not (out / "packed.json").exists():
            print(meta.parent.name, pack_folder(networks, meta.parent, out, arguments), flush=True)


if __name__ == "__main__":
    main()
