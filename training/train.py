"""Trains the depth network on packed samples (`prepare.py`), logs the curve, keeps the running average of the weights.

    python3 train.py --data PACKED/train --validation PACKED/validation --out RUN --minutes 40
"""

import json
import math
import time
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

from common import average_in, begin, curve_of, parser_of, rate_at, with_average
from network import BIN_M, BINS, DepthNetwork, bin_centres, read_out
from window import GRID, PICTURE_SIZE

BATCH = 8
WEIGHT_DECAY = 0.02
BACKGROUND_WEIGHT = 0.3  # few of the background cells are looked at
ELSEWHERE = 0.05  # share of the cells away from the player that the loss looks at
DISTANCE_WEIGHT = 3.0  # of the read-out's mean error in metres beside the cross entropy
SQUARE_M = 0.1  # errors beyond this count by their square: where front and back cannot be told, the middle is best
AVERAGE = 0.995


class Packed:
    """Samples written by `prepare.py`; the arrays stay on disk."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.shards = {}
        self.places = []
        self.refresh()
        if not self.places:
            raise ValueError(f"{folder}: no packed samples below it; run prepare.py")

    def refresh(self):
        """Takes in the folders that were packed since."""
        for summary in sorted(self.folder.rglob("packed.json")):
            shard = summary.parent
            if shard not in self.shards:
                self.shards[shard] = [np.load(shard / f"{name}.npy", mmap_mode="r") for name in ("picture", "pose", "offset")]
                self.places += [(shard, row) for row in range(len(self.shards[shard][0]))]

    def __len__(self):
        return len(self.places)

    def batch(self, indices, rng=None):
        """Picture N×4×128×128, pose N×3×64×64, offset N×64×64 (NaN = background); moved, mirrored, recoloured with `rng`."""
        picture = np.empty((len(indices), PICTURE_SIZE, PICTURE_SIZE, 4), np.float32)
        pose = np.empty((len(indices), GRID, GRID, 3), np.float32)
        offset = np.empty((len(indices), GRID, GRID), np.float32)
        for row, index in enumerate(indices):
            shard, place = self.places[index]
            pictures, poses, offsets = self.shards[shard]
            margin = offsets.shape[1] - GRID
            x, y = (margin // 2, margin // 2) if rng is None else rng.integers(0, margin + 1, 2)
            scale = PICTURE_SIZE // GRID
            flip = slice(None, None, -1) if rng is not None and rng.random() < 0.5 else slice(None)
            view = pictures[place, y * scale : y * scale + PICTURE_SIZE, x * scale : x * scale + PICTURE_SIZE]
            picture[row] = view[:, flip]
            pose[row] = poses[place, y : y + GRID, x : x + GRID][:, flip]
            offset[row] = offsets[place, y : y + GRID, x : x + GRID][:, flip]
            if rng is not None:
                recolour(picture[row], rng)
        picture /= 255.0
        return (
            torch.from_numpy(picture).permute(0, 3, 1, 2),
            torch.from_numpy(pose).permute(0, 3, 1, 2),
            torch.from_numpy(offset),
        )


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


def chosen_cells(picture, offset):
    """Cells the loss looks at: the player, what the estimated mask takes for the player, and a little of the rest."""
    return torch.isfinite(offset) | (picture[:, 3, ::2, ::2] > 0.1) | (torch.rand(offset.shape) < ELSEWHERE)


def loss_of(classes, offset):
    """Cross entropy against the two classes around the true distance, plus the distance of the read-out itself; rows of cells."""
    player = torch.isfinite(offset)
    place = (torch.nan_to_num(offset) / BIN_M + BINS // 2).clamp(0, BINS - 1)
    low = place.floor().clamp(max=BINS - 2)
    share = place - low
    logs = functional.log_softmax(classes, 1)
    lower = (low.long() + 1)[:, None]
    near = -(logs.gather(1, lower)[:, 0] * (1 - share) + logs.gather(1, lower + 1)[:, 0] * share)
    weights = torch.where(player, 1.0, BACKGROUND_WEIGHT)
    entropy = (torch.where(player, near, -logs[:, 0]) * weights).sum() / weights.sum()
    depth = torch.softmax(classes[player][:, 1:], 1) @ bin_centres()
    error = depth - (place[player] - BINS // 2) * BIN_M
    return entropy + DISTANCE_WEIGHT * (error.abs() + error.square() / SQUARE_M).mean()


@torch.no_grad()
def validate(network, data, limit):
    """Root mean square of the distance over true player cells, metres; the flat plane's; intersection over union of the mask."""
    network.eval()
    square = flat = cells = both = either = 0.0
    for start in range(0, min(limit, len(data)), 32):
        picture, pose, offset = data.batch(range(start, min(start + 32, limit, len(data))))
        estimate, presence = read_out(network(picture, pose))
        player = torch.isfinite(offset)
        square += ((estimate - offset)[player] ** 2).sum().item()
        flat += (offset[player] ** 2).sum().item()
        cells += player.sum().item()
        both += (player & (presence >= 0.5)).sum().item()
        either += (player | (presence >= 0.5)).sum().item()
    network.train()
    return math.sqrt(square / cells), math.sqrt(flat / cells), both / max(either, 1)


def main():
    parser = parser_of(__doc__, minutes=40.0, rate=2.5e-3)
    parser.add_argument("--validated", type=int, default=384, help="validation samples looked at for the curve")
    arguments = parser.parse_args()

    rng, out = begin(arguments)
    data, validation = Packed(arguments.data), Packed(arguments.validation)
    network, average = with_average(DepthNetwork(), arguments.start)
    optimizer = torch.optim.AdamW(network.parameters(), arguments.rate, betas=(0.9, 0.99), weight_decay=WEIGHT_DECAY)
    curve = curve_of(out, ["loss", "validation_rmse_m", "flat_plane_rmse_m", "validation_mask_iou"])

    began, budget = time.time(), arguments.minutes * 60.0
    seen, steps, running, reported = 0, 0, None, 0.0
    order = rng.permutation(len(data))
    while True:
        elapsed = time.time() - began
        part = elapsed / budget
        if part >= 1.0 or elapsed - reported >= min(90.0, budget / 6):
            reported = elapsed
            rmse, flat, iou = validate(average, validation, arguments.validated)
            curve.writerow([f"{elapsed:.0f}", seen, f"{running or 0:.4f}", f"{rmse:.4f}", f"{flat:.4f}", f"{iou:.4f}"])
            print(f"{elapsed:.0f} s, {seen} samples, loss {running or 0:.3f}, rmse {rmse:.4f} m (flat {flat:.4f}), mask IoU {iou:.3f}", flush=True)
            torch.save(average.state_dict(), out / "average.pt")
            torch.save(network.state_dict(), out / "network.pt")
        if part >= 1.0:
            break
        rate = rate_at(arguments.rate, part, steps, warm_up=100)
        for group in optimizer.param_groups:
            group["lr"] = rate
        if len(order) < BATCH:
            data.refresh()
            order = rng.permutation(len(data))
        indices, order = order[:BATCH], order[BATCH:]
        picture, pose, offset = data.batch(indices, rng)
        cells = chosen_cells(picture, offset)
        loss = loss_of(network.classes_at(network.features(picture, pose), cells), offset[cells])
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimizer.step()
        steps += 1
        seen += BATCH
        running = loss.item() if running is None else 0.98 * running + 0.02 * loss.item()
        average_in(average, network, steps, AVERAGE)
    (out / "run.json").write_text(json.dumps({"samples_seen": seen, "training_samples": len(data), "minutes": arguments.minutes, "seed": arguments.seed}))


if __name__ == "__main__":
    main()
