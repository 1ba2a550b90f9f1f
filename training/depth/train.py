"""Trains the depth network on packed samples (`prepare.py`), logs the curve, keeps the running average of the weights.

    python3 train.py --data PACKED/train --validation PACKED/validation --out RUN --minutes 60 [--pose read|true|none] [--mask true|none]
"""

import json
import math
import sys
import time
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from common import average_in, batches, begin, curve_of, descend, keep, parser_of, rate_at, settle, with_average
from dataset import OUTSIDE
from hourglass import HourglassNetwork
from network import DepthNetwork, read_out
from prepare import ARRAYS, POSE_STEP
from window import GRID, PICTURE_SIZE

BATCH = 24
WEIGHT_DECAY = 0.02
DISTANCE_WEIGHT = 3.0  # of errors in metres beside the masks' cross entropy
SQUARE_M = 0.1  # errors beyond this count by their square: where front and back cannot be told, the middle is best
HIDDEN_WEIGHT, BACK_WEIGHT, DOUBT_WEIGHT = 0.4, 0.6, 0.02
AVERAGE = 0.998


class Packed:
    """Samples written by `prepare.py`; the arrays stay on disk. `pose` and `mask` say which of them is shown, see `main`; folders without it are left out."""

    def __init__(self, folder, pose, mask):
        self.folder, self.mask = Path(folder), mask
        self.empty = pose == "none"
        self.names = [{"lifted": "lifted", "true": "true"}.get(pose, "pose") if name == "pose" else name for name in ARRAYS]
        self.shards = {}
        self.places = []
        self.refresh()
        if not self.places:
            raise ValueError(f"{folder}: no packed samples below it; run prepare.py")

    def refresh(self):
        """Takes in the folders that were packed since."""
        for summary in sorted(self.folder.rglob("packed.json")):
            shard = summary.parent
            if shard not in self.shards and all((shard / f"{name}.npy").exists() for name in self.names):
                self.shards[shard] = [np.load(shard / f"{name}.npy", mmap_mode="r") for name in self.names]
                self.places += [(shard, row) for row in range(len(self.shards[shard][0]))]

    def __len__(self):
        return len(self.places)

    def batch(self, indices, rng=None):
        """Picture N×4×128×128, pose N×4×64×64, front and back N×128×128 (metres, NaN = no body), seen N×128×128 bool; moved, mirrored, recoloured with `rng`."""
        picture = np.empty((len(indices), PICTURE_SIZE, PICTURE_SIZE, 4), np.float32)
        pose = np.empty((len(indices), GRID, GRID, 4), np.float32)
        planes = np.empty((3, len(indices), PICTURE_SIZE, PICTURE_SIZE), np.int16)
        scale = PICTURE_SIZE // GRID
        for row, index in enumerate(indices):
            shard, place = self.places[index]
            pictures, poses, *stored = self.shards[shard]
            margin = poses.shape[1] - GRID
            x, y = (margin // 2, margin // 2) if rng is None else rng.integers(0, margin + 1, 2)
            mirrored = rng is not None and rng.random() < 0.5
            flip = slice(None, None, -1) if mirrored else slice(None)
            fine = (slice(y * scale, y * scale + PICTURE_SIZE), slice(x * scale, x * scale + PICTURE_SIZE))
            picture[row] = pictures[place][fine][:, flip]
            pose[row] = poses[place, y : y + GRID, x : x + GRID][:, flip]
            if mirrored:
                pose[row, ..., 2] *= -1
            for plane, values in zip(planes, stored):
                plane[row] = values[place][fine][:, flip]
            if rng is not None:
                recolour(picture[row], rng)
        picture /= 255.0
        pose *= POSE_STEP
        if self.mask == "none":
            picture[..., 3] = 0.0
        if self.mask == "true":
            picture[..., 3] = planes[2] > 0
        if self.empty:
            pose[:] = 0.0
        front, back = (np.where(plane == OUTSIDE, np.nan, plane / np.float32(1000.0)).astype(np.float32) for plane in planes[:2])
        picture, pose = (torch.from_numpy(array).permute(0, 3, 1, 2) for array in (picture, pose))
        return picture, pose, torch.from_numpy(front), torch.from_numpy(back), torch.from_numpy(planes[2] > 0)


def recolour(picture, rng):
    """Exposure, contrast, white balance, saturation and noise, in place, on 0..255."""
    colour = picture[..., :3]
    gain = rng.uniform(0.7, 1.3) * rng.uniform(0.9, 1.1, 3)
    saturation = rng.uniform(0.6, 1.3)
    grey = colour.mean(2, keepdims=True)
    colour[:] = (grey + (colour - grey) * saturation) * gain.astype(np.float32) + rng.uniform(-15.0, 15.0)
    if rng.random() < 0.5:
        colour += rng.standard_normal(colour.shape, np.float32) * rng.uniform(0.0, 8.0)
    np.clip(colour, 0.0, 255.0, out=colour)


def loss_of(told, front, back, seen):
    """Cross entropy of both masks, distances of both surfaces, and how far off they were to be expected."""
    seen_logit, body_logit, near, far, doubt, back_doubt = read_out(told)
    body = torch.isfinite(front)
    entropy = functional.binary_cross_entropy_with_logits
    loss = 2.0 * entropy(seen_logit, seen.float()) + entropy(body_logit, body.float())
    weight = torch.where(seen, 1.0, HIDDEN_WEIGHT) * body
    weight = weight / weight.sum()
    for guess, truth, spread, share in ((near, front, doubt, 1.0), (far, back, back_doubt, BACK_WEIGHT)):
        error = (guess - truth.nan_to_num()).abs()
        loss = loss + share * DISTANCE_WEIGHT * (weight * (error + error.square() / SQUARE_M)).sum()
        loss = loss + DOUBT_WEIGHT * (weight * (error.detach() * torch.exp(-spread) + spread)).sum()
    return loss


@torch.no_grad()
def validate(network, data, limit):
    """Root mean squares over true seen pixels, metres: front, back, the flat plane's front; mean intersection over union of the seen mask."""
    network.eval()
    sums, overlaps = np.zeros(4), []
    for start in range(0, min(limit, len(data)), 32):
        picture, pose, front, back, seen = data.batch(range(start, min(start + 32, limit, len(data))))
        logit, _, near, far, _, _ = read_out(network(picture, pose))
        for place, square in enumerate(((near - front)[seen] ** 2, (far - back)[seen] ** 2, front[seen] ** 2, torch.ones(seen.sum()))):
            sums[place] += square.sum().item()
        kept = logit >= 0
        overlaps += ((kept & seen).sum((1, 2)) / (kept | seen).sum((1, 2)).clamp(min=1)).tolist()
    network.train()
    return [math.sqrt(value / sums[3]) for value in sums[:3]] + [float(np.mean(overlaps))]


def main():
    parser = parser_of(__doc__, minutes=60.0, rate=2.0e-3)
    parser.add_argument("--validated", type=int, default=384, help="validation samples looked at for the curve")
    parser.add_argument("--pose", choices=("lifted", "read", "true", "none"), default="lifted", help="joints that are painted (`repaint.py`)")
    parser.add_argument("--mask", choices=("estimated", "true", "none"), default="estimated")
    parser.add_argument("--hourglass", action="store_true", help="the paper's kind of network instead of ours")
    arguments = parser.parse_args()

    rng, out = begin(arguments)
    data, validation = (Packed(folder, arguments.pose, arguments.mask) for folder in (arguments.data, arguments.validation))
    network, average = with_average(HourglassNetwork() if arguments.hourglass else DepthNetwork(), arguments.start)
    optimizer = torch.optim.AdamW(network.parameters(), arguments.rate, betas=(0.9, 0.99), weight_decay=WEIGHT_DECAY)
    curve = curve_of(out, ["loss", "validation_rmse_m", "validation_back_rmse_m", "flat_plane_rmse_m", "validation_mask_iou"])
    supply = batches(data, BATCH, lambda: rng.permutation(len(data)), lambda indices: data.batch(indices, rng))

    began, budget = time.process_time(), arguments.minutes * 60.0
    seen, steps, running, reported = 0, 0, None, 0.0
    while True:
        elapsed = time.process_time() - began
        part = elapsed / budget
        if part >= 1.0 or elapsed - reported >= min(180.0, budget / 6):
            reported = elapsed
            settle(average, (next(supply)[:2] for _ in range(8)))
            figures = validate(average, validation, arguments.validated)
            curve.writerow([f"{elapsed:.0f}", seen, *(f"{value:.4f}" for value in (running or 0, *figures))])
            print(f"{elapsed:.0f} s, {seen} of {len(data)} samples, loss {running or 0:.3f}, rmse {figures[0]:.4f} back {figures[1]:.4f} (flat {figures[2]:.4f}), mask IoU {figures[3]:.3f}", flush=True)
            keep(out, network, average)
        if part >= 1.0:
            break
        for group in optimizer.param_groups:
            group["lr"] = rate_at(arguments.rate, part, steps, warm_up=200)
        picture, pose, *truth = next(supply)
        loss = loss_of(network(picture.contiguous(memory_format=torch.channels_last), pose), *truth)
        descend(network, optimizer, loss)
        steps += 1
        seen += BATCH
        running = loss.item() if running is None else 0.98 * running + 0.02 * loss.item()
        average_in(average, network, steps, AVERAGE)
    (out / "run.json").write_text(json.dumps({"samples_seen": seen, "training_samples": len(data), "minutes": arguments.minutes, "seed": arguments.seed, "pose": arguments.pose, "mask": arguments.mask, "hourglass": arguments.hourglass}))


if __name__ == "__main__":
    main()
