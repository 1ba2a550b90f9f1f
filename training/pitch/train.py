"""Trains the pitch network on rendered pictures, logs the curve, keeps the running average of the weights.

    python3 train.py --data ../../target/datasets/frames-train --validation ../../target/datasets/frames-validation --out RUN --minutes 75

With --start and --minutes 0, only the batch statistics of a checkpoint are measured.
"""

import json
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import torch
from torch.nn import functional

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from common import average_in, batches, begin, curve_of, descend, keep, parser_of, rate_at, settle, with_average
from dataset import Frames
from network import PitchNetwork
from points import CHANNELS, POINTS

BATCH = 8
WEIGHT_DECAY = 0.02
AVERAGE = 0.998
FOUND = 0.25  # a peak above this is a found point
NEAR_CELLS = 1.5  # and right within this, cells of 4 pixels


def stack(samples):
    pictures = torch.from_numpy(np.stack([view for view, _ in samples])).permute(0, 3, 1, 2) / 255.0
    return pictures.contiguous(memory_format=torch.channels_last), torch.from_numpy(np.stack([maps for _, maps in samples]))


def loss_of(logits, maps):
    """Quality focal loss of points and lines (Li et al. 2020: what is already right hardly counts), cross entropy of the area."""
    shown, wanted = logits[:, : CHANNELS - 1], maps[:, : CHANNELS - 1]
    entropy = functional.binary_cross_entropy_with_logits(shown, wanted, reduction="none")
    focal = entropy * (torch.sigmoid(shown) - wanted).square()
    points = focal[:, :POINTS].sum() / wanted[:, :POINTS].sum().clamp(min=20.0)
    lines = focal[:, POINTS:].sum() / wanted[:, POINTS:].sum().clamp(min=100.0)
    area = functional.binary_cross_entropy_with_logits(logits[:, -1], maps[:, -1])
    return points + lines + 0.3 * area


@torch.no_grad()
def validate(network, samples):
    """Share of the points found where they are, share of the found points that are right, overlap of the lines."""
    network.eval()
    found = right = true = both = either = 0
    for start in range(0, len(samples), BATCH):
        pictures, maps = stack(samples[start : start + BATCH])
        said = torch.sigmoid(network(pictures))
        peaks, places = said[:, :POINTS].flatten(2).max(2)
        tops, trues = maps[:, :POINTS].flatten(2).max(2)
        width = maps.shape[3]
        dx = (places % width - trues % width).float()
        dy = (torch.div(places, width, rounding_mode="floor") - torch.div(trues, width, rounding_mode="floor")).float()
        near = (dx**2 + dy**2).sqrt() <= NEAR_CELLS
        sure, is_there = peaks > FOUND, tops > 0.6
        found += sure.sum().item()
        true += is_there.sum().item()
        right += (sure & (tops > 0) & near).sum().item()
        lines, wanted = said[:, POINTS:-1] > 0.4, maps[:, POINTS:-1] > 0.4
        both += (lines & wanted).sum().item()
        either += (lines | wanted).sum().item()
    network.train()
    return right / max(true, 1), right / max(found, 1), both / max(either, 1)


def main():
    arguments = parser_of(__doc__, minutes=75.0, rate=3e-3).parse_args()
    cv2.setNumThreads(0)
    rng, out = begin(arguments)
    data, validation = Frames(arguments.data), Frames(arguments.validation)
    validation = [validation.sample(index) for index in range(len(validation))]
    print(f"{len(data)} pictures to train on, {len(validation)} to watch the curve", flush=True)
    network, average = with_average(PitchNetwork(), arguments.start)
    optimizer = torch.optim.AdamW(network.parameters(), arguments.rate, betas=(0.9, 0.99), weight_decay=WEIGHT_DECAY)
    curve = curve_of(out, ["loss", "validation_point_recall", "validation_point_precision", "validation_line_iou"])

    began, budget = time.time(), arguments.minutes * 60.0
    seen, steps, running, reported = 0, 0, None, 0.0
    supply = batches(data, BATCH, lambda: data.drawn(rng), lambda indices: stack([data.sample(k, rng) for k in indices]))
    while True:
        elapsed = time.time() - began
        part = elapsed / max(budget, 1e-9)
        if part >= 1.0 or elapsed - reported >= min(240.0, budget / 3):
            reported = elapsed
            settle(average, (next(supply)[0] for _ in range(24)))
            recall, precision, overlap = validate(average, validation)
            curve.writerow([f"{elapsed:.0f}", seen, f"{running or 0:.4f}", f"{recall:.4f}", f"{precision:.4f}", f"{overlap:.4f}"])
            print(f"{elapsed:.0f} s, {seen} samples, loss {running or 0:.3f}, points found {recall:.3f}, right {precision:.3f}, lines {overlap:.3f}", flush=True)
            keep(out, network, average)
        if part >= 1.0:
            break
        rate = rate_at(arguments.rate, part, steps, warm_up=150)
        for group in optimizer.param_groups:
            group["lr"] = rate
        pictures, maps = next(supply)
        loss = loss_of(network(pictures), maps)
        descend(network, optimizer, loss)
        steps += 1
        seen += BATCH
        running = loss.item() if running is None else 0.98 * running + 0.02 * loss.item()
        average_in(average, network, steps, AVERAGE)
    summary = {"samples_seen": seen, "training_samples": len(data), "minutes": arguments.minutes, "seed": arguments.seed}
    (out / "run.json").write_text(json.dumps(summary))


if __name__ == "__main__":
    main()
