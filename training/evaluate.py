"""Measures an exported network on rendered players it has not seen, as `reconstructor evaluate depth` does.

    python3 evaluate.py --rendered DATA/test --pose-model blazepose_full.onnx --model depth.onnx --json FILE

Distances are compared on every true player pixel of the 128×128 truth. `rmse_m`: as they come. `st_rmse_m`: after the best scale and
translation per player. `tilted_plane_rmse_m`: the best plane in image x, y per player, fitted on the truth itself.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import onnxruntime

import prepass
from dataset import Rendered, view_of
from window import GRID, mask_box, paint, sample, window_of, PICTURE_SIZE

FAINT = 1e-3
HEIGHT_CLASSES = (0, 40, 70, 110, 10_000)


def corners(place):
    place = np.clip(place, 0.0, GRID - 1.0)
    low = np.minimum(np.floor(place), GRID - 2.0).astype(int)
    return low, place - low


def look_up(offset, presence, centre, side, x, y):
    """Distance and presence at pixels of the crop, as `WindowSurface::offset_at` and `presence_at`."""
    place_x = ((x - centre[0]) / side + 0.5) * GRID - 0.5
    place_y = ((y - centre[1]) / side + 0.5) * GRID - 0.5
    (lx, tx), (ly, ty) = corners(place_x), corners(place_y)
    total = plain = weight = 0.0
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        share = (tx if dx else 1 - tx) * (ty if dy else 1 - ty)
        o, p = offset[ly + dy, lx + dx], presence[ly + dy, lx + dx]
        total, plain, weight = total + share * p * o, plain + share * o, weight + share * p
    inside = (place_x >= -0.5) & (place_x <= GRID - 0.5) & (place_y >= -0.5) & (place_y <= GRID - 0.5)
    return np.where(weight > FAINT, total / np.maximum(weight, FAINT), plain), np.where(inside, weight, 0.0)


def residual(truth, columns):
    """Sum of squares that a least-squares fit of `columns` leaves."""
    design = np.stack(columns, 1)
    fit = np.linalg.lstsq(design, truth, rcond=None)[0]
    return float(((design @ fit - truth) ** 2).sum())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rendered", required=True)
    parser.add_argument("--pose-model", required=True)
    parser.add_argument("--model", required=True)
    parser.add_argument("--json", required=True)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--limit", type=int)
    arguments = parser.parse_args()
    rendered = Rendered(arguments.rendered)
    pose_session, network = prepass.load(arguments.pose_model), prepass.load(arguments.model)
    rows, failed, began = [], 0, time.time()
    for index in range(min(len(rendered), arguments.limit or len(rendered))):
        crop, mask, offset, meta = rendered[index]
        if (mask >= 128).sum() < 64:
            continue
        rng = np.random.default_rng([arguments.seed, index])
        joints, depth, estimated, flag = prepass.estimate(pose_session, crop, prepass.noisy_box(mask, rng))
        box = mask_box(estimated)
        if flag < prepass.POSE_FAILED or box is None:
            failed += 1
            continue
        pixels_per_metre, descent = view_of(meta)
        centre, side = window_of(box, pixels_per_metre)
        picture = sample(np.dstack([crop, estimated]), centre, side, PICTURE_SIZE).transpose(2, 0, 1) / 255.0
        pose = paint(joints, depth, centre, side, pixels_per_metre, descent)
        cells, presence = network.run(None, {"picture": picture[None].astype(np.float32), "pose": pose[None].astype(np.float32)})
        grid_y, grid_x = np.mgrid[: offset.shape[0], : offset.shape[1]]
        scale = crop.shape[0] / offset.shape[0]
        x, y = (grid_x + 0.5) * scale - 0.5, (grid_y + 0.5) * scale - 0.5
        guess, player = look_up(cells[0].astype(float), presence[0].astype(float), centre, side, x, y)
        given = sample(estimated[..., None], np.array([(crop.shape[0] - 1) / 2] * 2), crop.shape[0], offset.shape[0])[..., 0]
        true = np.isfinite(offset)
        kept = np.minimum(given, np.round(255 * player)) >= 128
        d, g, u, v, one = offset[true], guess[true], x[true], y[true], np.ones(true.sum())
        square = (
            float(((g - d) ** 2).sum()),
            residual(d, [g, one]),
            float((d**2).sum()),
            float(((d - d.mean()) ** 2).sum()),
            residual(d, [u, v, one]),
        )
        overlap = [(a & true).sum() / max((a | true).sum(), 1) for a in (kept, player >= 0.5, given >= 128)]
        rows.append((meta.get("height_px", 0), true.sum(), *square, *overlap))
    table = np.array(rows, float)

    def figures(part):
        rms = np.sqrt(part[:, 2:7].sum(0) / part[:, 1].sum())
        names = ("rmse_m", "st_rmse_m", "flat_plane_rmse_m", "shifted_flat_plane_rmse_m", "tilted_plane_rmse_m")
        masks = dict(zip(("mask_iou", "network_mask_iou", "pose_mask_iou"), part[:, 7:].mean(0)))
        return {"players": len(part), **{n: round(float(v), 4) for n, v in zip(names, rms)}, **{n: round(float(v), 4) for n, v in masks.items()}}

    report = {**figures(table), "pose_failed": failed, "seconds": round(time.time() - began)}
    for low, high in zip(HEIGHT_CLASSES, HEIGHT_CLASSES[1:]):
        part = table[(table[:, 0] >= low) & (table[:, 0] < high)]
        if len(part):
            report[f"height_{low}_to_{high}_px"] = figures(part)
    Path(arguments.json).write_text(json.dumps(report, indent=1))
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
