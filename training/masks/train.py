"""Trains the mask network on what `prepare.py` wrote, logs the curve, keeps the running average of the weights.

    python3 train.py --data PREPARED --validation PREPARED-VALIDATION --out RUN --minutes 4
"""

import sys
import time
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from common import average_in, begin, curve_of, descend, keep, parser_of, rate_at, settle, with_average
from network import MaskNetwork

BATCH = 16
WEIGHT_DECAY = 0.01
AVERAGE = 0.998
OVERLAPPING_WEIGHT = 2.5


def read(folder):
    parts = [np.load(path) for path in sorted(Path(folder).glob("*.npz"))]
    return [np.concatenate([part[name] for part in parts]) for name in ("x", "y")]


def overlapping(windows):
    """Whether somebody else's mask or bones reach into the body's part of the window."""
    middle = windows[:, :, 12:84, 14:50]
    return (middle[:, [5, 7]] > 127).sum((1, 2, 3)) > 0.02 * 72 * 36


def drawn_how_often(windows):
    """Chance of each window to be drawn: the few with people who overlap come more often."""
    weights = np.where(overlapping(windows), OVERLAPPING_WEIGHT, 1.0)
    return weights / weights.sum()


def varied(windows, masks, rng):
    """Mirrored, and with other light and colours: what a kit looks like must not matter."""
    x, y = windows.astype(np.float32) / 255.0, masks.astype(np.float32) / 255.0
    for k in range(len(x)):
        if rng.random() < 0.5:
            x[k], y[k] = x[k, :, :, ::-1].copy(), y[k, :, ::-1].copy()
        colours = x[k, :3]
        if rng.random() < 0.3:
            colours = colours[rng.permutation(3)]
        gain, lift = np.exp(rng.normal(0, 0.15, (3, 1, 1))), rng.normal(0, 0.05)
        x[k, :3] = np.clip(colours * gain + lift + rng.normal(0, 0.01, colours.shape), 0, 1)
        if rng.random() < 0.1:
            # A mask network that fails in a part of the body.
            row = rng.integers(0, 96)
            x[k, 3, row : row + rng.integers(4, 24)] = 0
    return torch.from_numpy(x).contiguous(memory_format=torch.channels_last), torch.from_numpy(y)


def loss_of(logits, masks):
    """Cross entropy, and one minus the soft intersection over union of every window."""
    chance = torch.sigmoid(logits)
    both = (chance * masks).sum((1, 2))
    either = (chance + masks - chance * masks).sum((1, 2))
    return functional.binary_cross_entropy_with_logits(logits, masks) * 3.0 + (1 - (both + 1) / (either + 1)).mean()


def overlap(chance, masks):
    ours, true = chance >= 0.5, masks >= 0.5
    return ((ours & true).sum((1, 2)).float() / (ours | true).sum((1, 2)).clamp(min=1)).numpy()


@torch.no_grad()
def validate(network, windows, masks):
    network.eval()
    found, before = [], []
    for start in range(0, len(windows), 32):
        x = torch.from_numpy(windows[start : start + 32]).float() / 255.0
        y = torch.from_numpy(masks[start : start + 32]).float() / 255.0
        found.append(overlap(torch.sigmoid(network(x)), y))
        before.append(overlap(x[:, 3], y))
    network.train()
    found, before, tangled = np.concatenate(found), np.concatenate(before), overlapping(windows)
    return found.mean(), before.mean(), found[tangled].mean(), before[tangled].mean()


def drawn(windows, masks, rng, count):
    """So many batches of varied windows."""
    for _ in range(count):
        chosen = rng.choice(len(windows), BATCH)
        yield varied(windows[chosen], masks[chosen], rng)[0]


def main():
    arguments = parser_of(__doc__, minutes=40.0, rate=4e-3).parse_args()
    rng, out = begin(arguments)
    (windows, masks), held = read(arguments.data), read(arguments.validation)
    weights = drawn_how_often(windows)
    print(f"{len(windows)} windows to train on, {len(held[0])} to watch the curve", flush=True)
    network, average = with_average(MaskNetwork(), arguments.start)
    optimizer = torch.optim.AdamW(network.parameters(), arguments.rate, betas=(0.9, 0.99), weight_decay=WEIGHT_DECAY)
    curve = curve_of(out, ["loss", "validation_iou", "pose_network_iou", "validation_iou_overlapping", "pose_network_iou_overlapping"])
    began, budget = time.process_time(), arguments.minutes * 60.0
    steps, running, reported = 0, None, 0.0
    order = []
    while True:
        elapsed = time.process_time() - began
        part = elapsed / max(budget, 1e-9)
        if part >= 1.0 or elapsed - reported >= min(60.0, budget / 3):
            reported = elapsed
            settle(average, drawn(windows, masks, rng, 30))
            found = validate(average, *held)
            curve.writerow([f"{elapsed:.0f}", steps * BATCH, f"{running or 0:.4f}", *(f"{value:.4f}" for value in found)])
            print(
                f"{elapsed:.0f} s, {steps * BATCH} windows, loss {running or 0:.3f}, iou {found[0]:.4f} (pose network {found[1]:.4f}), "
                f"overlapping {found[2]:.4f} ({found[3]:.4f})",
                flush=True,
            )
            keep(out, network, average)
        if part >= 1.0:
            break
        for group in optimizer.param_groups:
            group["lr"] = rate_at(arguments.rate, part, steps, warm_up=60)
        if len(order) < BATCH:
            order = list(rng.choice(len(windows), len(windows), p=weights))
        chosen = [order.pop() for _ in range(BATCH)]
        x, y = varied(windows[chosen], masks[chosen], rng)
        loss = loss_of(network(x), y)
        descend(network, optimizer, loss)
        steps += 1
        average_in(average, network, steps, AVERAGE)
        running = loss.item() if running is None else 0.98 * running + 0.02 * loss.item()


if __name__ == "__main__":
    main()
