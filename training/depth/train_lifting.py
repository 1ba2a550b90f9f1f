"""Trains the lifting network on packed samples (`prepare.py`), logs the curve, keeps the running average of the weights.

    python3 train_lifting.py --data PACKED/train --validation PACKED/validation --out RUN --minutes 60
"""

import json
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import torch

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from common import average_in, batches, begin, curve_of, descend, keep, parser_of, rate_at, with_average
from lifting import JOINTS, MIRROR, TAUGHT, LiftingNetwork, normal
from prepare import MARGIN, POSE_STEP
from train import recolour
from window import GRID

BATCH = 64
WEIGHT_DECAY = 0.05
AVERAGE = 0.998
SQUARE_M = 0.15


class Poses:
    """Everything in memory, pictures at half their resolution."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.shards, self.places = {}, []
        self.refresh()

    def refresh(self):
        """Takes in the folders that were packed since."""
        for file in sorted(self.folder.rglob("window.npy")):
            shard = file.parent
            if shard in self.shards:
                continue
            load = lambda name: np.load(shard / f"{name}.npy")
            picture, window, joints, truth = load("picture"), load("window"), load("joints"), load("truth")
            half = picture.shape[1] // 2
            picture = np.stack([cv2.resize(one, (half, half), interpolation=cv2.INTER_AREA) for one in picture])
            metres = lambda places: (places - window[:, None, :2]) / window[:, 3, None, None]
            known = normal(joints[..., :2], joints[..., 2], joints[..., 3], window[:, :2], window[:, 3])
            truth = np.concatenate([metres(truth[..., :2]), truth[..., 2:]], 2)
            self.shards[shard] = (picture, load("pose"), known, truth.astype(np.float32), window)
            self.places += [(shard, row) for row in range(len(picture))]

    def __len__(self):
        return len(self.places)

    def batch(self, indices, rng=None):
        """Picture N×4×64×64, pose N×4×64×64, joints N×132, truth N×33×3; moved, mirrored, recoloured with `rng`."""
        count = len(indices)
        picture, pose = (np.empty((count, GRID, GRID, 4), np.float32) for _ in range(2))
        joints, truth = np.empty((count, 4 * JOINTS), np.float32), np.empty((count, JOINTS, 3), np.float32)
        for row, index in enumerate(indices):
            shard, place = self.places[index]
            pictures, poses, known, truths, window = self.shards[shard]
            x, y = (MARGIN, MARGIN) if rng is None else rng.integers(0, 2 * MARGIN + 1, 2)
            picture[row] = pictures[place, y : y + GRID, x : x + GRID]
            pose[row] = poses[place, y : y + GRID, x : x + GRID]
            joints[row], truth[row] = known[place], truths[place]
            # The window was moved: its middle is elsewhere.
            cell = window[place, 2] / poses.shape[1] / window[place, 3]
            moved = np.array([x - MARGIN, y - MARGIN], np.float32) * cell
            joints[row, : 2 * JOINTS] -= np.tile(moved, JOINTS)
            truth[row, :, :2] -= moved
            if rng is not None:
                if rng.random() < 0.5:
                    picture[row], pose[row] = picture[row, :, ::-1].copy(), pose[row, :, ::-1].copy()
                    pose[row, ..., 2] *= -1
                    truth[row] = truth[row, MIRROR] * [-1, 1, 1]
                    places, rest = joints[row, : 2 * JOINTS].reshape(JOINTS, 2), joints[row, 2 * JOINTS :].reshape(2, JOINTS)
                    joints[row] = np.concatenate([(places[MIRROR] * [-1, 1]).ravel(), rest[:, MIRROR].ravel()])
                recolour(picture[row], rng)
        tensors = (torch.from_numpy(array).permute(0, 3, 1, 2) for array in (picture / np.float32(255.0), pose * np.float32(POSE_STEP)))
        return *tensors, torch.from_numpy(joints), torch.from_numpy(truth)


@torch.no_grad()
def errors(network, data):
    """Root mean square depth error, mean error of place (x, y) and of depth over the used joints, metres; the first two of the pose network."""
    network.eval()
    sums = np.zeros(5)
    for start in range(0, len(data), 128):
        picture, pose, joints, truth = data.batch(range(start, min(start + 128, len(data))))
        told = network.told(picture, pose, joints).reshape(-1, JOINTS, 3)
        read = torch.cat([joints[:, : 2 * JOINTS].reshape(-1, JOINTS, 2), joints[:, 2 * JOINTS : 3 * JOINTS, None]], 2)
        off, was = (told - truth)[:, TAUGHT], (read - truth)[:, TAUGHT]
        figures = off[..., 2].square(), off[..., :2].norm(dim=2), off[..., 2].abs(), was[..., 2].square(), was[..., :2].norm(dim=2)
        sums += [len(truth) * value.mean().item() for value in figures]
    network.train()
    sums /= len(data)
    return np.sqrt(sums[0]), sums[1], sums[2], np.sqrt(sums[3]), sums[4]


def main():
    arguments = parser_of(__doc__, minutes=60.0, rate=3e-3).parse_args()
    rng, out = begin(arguments)
    data, held = Poses(arguments.data), Poses(arguments.validation)
    network, average = with_average(LiftingNetwork(), arguments.start)
    optimizer = torch.optim.AdamW(network.parameters(), arguments.rate, betas=(0.9, 0.99), weight_decay=WEIGHT_DECAY)
    curve = curve_of(out, ["loss", "validation_depth_rmse_m", "validation_place_error_m", "validation_depth_error_m", "pose_network_depth_rmse_m", "pose_network_place_error_m"])
    supply = batches(data, BATCH, lambda: rng.permutation(len(data)), lambda indices: data.batch(indices, rng))
    began, budget = time.time(), arguments.minutes * 60.0
    seen, steps, running, reported = 0, 0, None, 0.0
    while True:
        elapsed = time.time() - began
        part = elapsed / budget
        if part >= 1.0 or elapsed - reported >= min(120.0, budget / 6):
            reported = elapsed
            figures = errors(average, held)
            curve.writerow([f"{elapsed:.0f}", seen, *(f"{value:.4f}" for value in (running or 0, *figures))])
            print(f"{elapsed:.0f} s, {seen} of {len(data)} samples, loss {running or 0:.3f}, depth rmse {figures[0]:.4f} place {figures[1]:.4f} depth {figures[2]:.4f} (pose network {figures[3]:.4f} {figures[4]:.4f})", flush=True)
            keep(out, network, average)
        if part >= 1.0:
            break
        for group in optimizer.param_groups:
            group["lr"] = rate_at(arguments.rate, part, steps, warm_up=100)
        picture, pose, joints, truth = next(supply)
        told = network.told(picture, pose, joints).reshape(-1, JOINTS, 3)
        error = (told - truth)[:, TAUGHT].abs()
        loss = (error + error.square() / SQUARE_M).mean()
        descend(network, optimizer, loss)
        steps += 1
        seen += len(truth)
        running = loss.item() if running is None else 0.98 * running + 0.02 * loss.item()
        average_in(average, network, steps, AVERAGE)
    (out / "run.json").write_text(json.dumps({"samples_seen": seen, "training_samples": len(data), "minutes": arguments.minutes, "seed": arguments.seed}))


if __name__ == "__main__":
    main()
