"""Trains the joint network on what `prepare.py` wrote, logs the curve, keeps the running average of the weights.

    python3 train.py --data TRAIN.npz --validation VALIDATION.npz --out RUN
"""

import sys
import time
from pathlib import Path

import numpy as np
import torch

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from common import average_in, begin, curve_of, parser_of, rate_at, with_average
from network import JointNetwork, normal, span_of

BATCH = 256
WEIGHT_DECAY = 0.02
AVERAGE = 0.998
NOISE = 0.02  # of the input, in quarters of the span
USED = [0, *range(11, 17), *range(23, 33)]  # the joints that later stages read
OTHER_PERSON = 0.12  # of the span: joints farther off than this (median) are somebody else's
BODY_M = 1.8  # span and true box differ by little: errors in metres are for the eye only
MIRROR = [0, 4, 5, 6, 1, 2, 3, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15, 18, 17, 20, 19, 22, 21, 24, 23, 26, 25, 28, 27, 30, 29, 32, 31]


def read(path, mirrored):
    with np.load(path) as data:
        seen, true = data["read"], data["true"]
    if mirrored:
        flip = lambda joints: joints[:, MIRROR] * np.array([-1, 1, 1])[: joints.shape[2]]
        seen, true = np.concatenate([seen, flip(seen)]), np.concatenate([true, flip(true)])
    shifts = (true - seen[:, :, :2]) / span_of(seen)[:, None, None]
    return seen, shifts


def validate(network, seen, shifts):
    """Median error of the used joints before and after, shares of the span times 1.8 m."""
    with torch.no_grad():
        told = network(torch.from_numpy(normal(seen))).numpy().reshape(-1, 33, 2) * 0.1
    error = lambda shift: BODY_M * np.median(np.linalg.norm(shift[:, USED], axis=2))
    return error(shifts - told), error(shifts)


def main():
    arguments = parser_of(__doc__, minutes=1.5, rate=2e-3).parse_args()
    rng, out = begin(arguments)
    seen, shifts = read(arguments.data, mirrored=True)
    held = read(arguments.validation, mirrored=False)
    right = np.median(np.linalg.norm(shifts[:, USED], axis=2), axis=1) < OTHER_PERSON
    inputs, wanted = torch.from_numpy(normal(seen[right])), torch.from_numpy(shifts[right].astype(np.float32))
    print(f"{len(inputs)} poses to train on, mirrored ones included; {len(held[0])} to watch the curve", flush=True)
    network, average = with_average(JointNetwork(), arguments.start)
    optimizer = torch.optim.AdamW(network.parameters(), arguments.rate, weight_decay=WEIGHT_DECAY)
    curve = curve_of(out, ["loss", "validation_error_m", "pose_network_error_m"])
    began, budget = time.process_time(), arguments.minutes * 60.0
    steps, running, reported = 0, 0.0, 0.0
    while True:
        elapsed = time.process_time() - began
        part = elapsed / max(budget, 1e-9)
        if part >= 1.0 or elapsed - reported >= 15.0:
            reported = elapsed
            found = validate(average, *held)
            curve.writerow([f"{elapsed:.0f}", steps * BATCH, f"{running:.5f}", *(f"{value:.4f}" for value in found)])
            print(f"{elapsed:.0f} s, {steps * BATCH} poses, loss {running:.4f}, error {found[0]:.4f} m (pose network {found[1]:.4f})", flush=True)
            torch.save(average.state_dict(), out / "average.pt")
        if part >= 1.0:
            break
        for group in optimizer.param_groups:
            group["lr"] = rate_at(arguments.rate, part, steps, warm_up=60)
        chosen = torch.from_numpy(rng.integers(0, len(inputs), BATCH))
        pose = inputs[chosen]
        told = network(pose + NOISE * torch.randn_like(pose)).reshape(-1, 33, 2) * 0.1
        # Distances, not their squares: a joint taken for the other leg's must not pull at all others.
        loss = ((told - wanted[chosen])[:, USED].square().sum(2) + 1e-5).sqrt().mean()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        steps += 1
        average_in(average, network, steps, AVERAGE)
        running = loss.item() if steps == 1 else 0.99 * running + 0.01 * loss.item()


if __name__ == "__main__":
    main()
