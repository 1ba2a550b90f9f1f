"""Packs rendered players for training: pose pre-pass, window, painted pose, distances on the output's grid.

    python3 prepare.py --rendered DATA/train --model blazepose_full.onnx --out PACKED/train [--seed 1] [--jitter 0.05]

Folder by folder; those packed before are kept, so it can run again while more are being rendered. The arrays cover a margin around the window, so that training can move it: picture (N, 144, 144, 4) u8,
pose (N, 72, 72, 3) f16, offset (N, 72, 72) f16 with NaN for background.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

import prepass
from dataset import Rendered, view_of
from window import GRID, PICTURE_SIZE, mask_box, paint, window_of

MARGIN = 4  # cells on each side
PACKED_GRID = GRID + 2 * MARGIN
PACKED_PICTURE = PACKED_GRID * (PICTURE_SIZE // GRID)


def offset_on_grid(offset, centre, side, size, crop_size):
    """Mean distance of the player over each cell of a window, NaN where less than half of the cell is player."""
    n = 2
    steps = ((np.arange(size * n) + 0.5) / (size * n) - 0.5) * side
    scale = offset.shape[0] / crop_size

    def cells(middle):
        place = np.floor((middle + steps + 0.5) * scale).astype(int)
        return np.clip(place, 0, offset.shape[0] - 1), (place >= 0) & (place < offset.shape[0])

    x, inside_x = cells(centre[0])
    y, inside_y = cells(centre[1])
    fine = np.where(inside_y[:, None] & inside_x[None, :], offset[y][:, x], np.nan).reshape(size, n, size, n)
    player = np.isfinite(fine)
    count = player.sum((1, 3))
    total = np.where(player, fine, 0.0).sum((1, 3))
    return np.where(count * 2 >= n * n, total / np.maximum(count, 1), np.nan)


def pack(session, crop, mask, offset, meta, rng, jitter):
    """One packed sample, or the reason why there is none."""
    if (mask >= 128).sum() < 64:
        return "hidden"
    joints, depth, estimated, flag = prepass.estimate(session, crop, prepass.noisy_box(mask, rng))
    if flag < prepass.POSE_FAILED:
        return "pose failed"
    box = mask_box(estimated)
    if box is None:
        return "mask failed"
    pixels_per_metre, descent = view_of(meta)
    pixels_per_metre *= float(np.exp(rng.normal(0.0, jitter)))
    centre, side = window_of(box, pixels_per_metre)
    wide = side * PACKED_GRID / GRID
    picture = np.dstack([crop, estimated])
    return (
        np.round(prepass.sample_quickly(picture, centre, wide, PACKED_PICTURE)).astype(np.uint8),
        paint(joints, depth, centre, wide, pixels_per_metre, descent, PACKED_GRID).transpose(1, 2, 0).astype(np.float16),
        offset_on_grid(offset, centre, wide, PACKED_GRID, crop.shape[0]).astype(np.float16),
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rendered", required=True)
    parser.add_argument("--model", required=True, help="blazepose_full.onnx")
    parser.add_argument("--out", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jitter", type=float, default=0.05, help="standard deviation of the logarithm of the metric scale")
    arguments = parser.parse_args()
    session = prepass.load(arguments.model)
    for meta in sorted(Path(arguments.rendered).rglob("meta.jsonl")):
        out = Path(arguments.out) / meta.parent.name
        if not (out / "packed.json").exists():
            print(meta.parent.name, pack_folder(session, meta.parent, out, arguments), flush=True)


def pack_folder(session, folder, out, arguments):
    """Packs one folder of samples; gives the summary that it also writes, last."""
    rendered, rows, reasons, began = Rendered(folder), [], {}, time.time()
    for index in range(len(rendered)):
        sample_of = rendered[index]
        rng = np.random.default_rng([arguments.seed, sample_of[3]["index"]])
        packed = pack(session, *sample_of, rng, arguments.jitter)
        if isinstance(packed, str):
            reasons[packed] = reasons.get(packed, 0) + 1
        else:
            rows.append(packed)
    out.mkdir(parents=True, exist_ok=True)
    for name, arrays in zip(("picture", "pose", "offset"), zip(*rows)):
        np.save(out / f"{name}.npy", np.stack(arrays))
    summary = {"samples": len(rows), "dropped": reasons, "seed": arguments.seed, "seconds": round(time.time() - began)}
    (out / "packed.json").write_text(json.dumps(summary))
    return summary


if __name__ == "__main__":
    main()
