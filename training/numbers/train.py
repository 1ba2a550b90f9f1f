"""Trains the number network on what `prepare.py` wrote, logs the curve, keeps the running average of the weights, and settles how sure it may be.

    python3 train.py --data PREPARED --validation PREPARED-VALIDATION --out RUN --minutes 12
"""

import argparse
import csv
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import torch
from torch.nn import functional

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from common import average_in, descend, rate_at, settle
from network import NumberNetwork, split
from paint import colours, glyphs
from view import CELLS

BATCH = 64
WEIGHT_DECAY = 0.02
AVERAGE = 0.998
LEGIBLE = 0.7  # share of a batch that shows a number
FRESH = 0.5  # share of the numbers in a batch that are painted while training, on patches that show none
SHEETS = 3000  # of them in as many hands
PER_M = 56.0  # cells per metre of an upright back
HEIGHTS = [(30, 45), (45, 60), (60, 80), (80, 110), (110, 400)]


class Patches:
    def __init__(self, folder):
        parts = [np.load(path) for path in sorted(Path(folder).glob("*.npz"))]
        self.x, self.number, self.height, self.turn, self.painted = [
            np.concatenate([part[name][part["number"] >= 0] for part in parts]) for name in ("x", "number", "height", "turn", "painted")
        ]

    def draw(self, count, rng):
        """Windows, numbers and heights. Every tens digit as often as every other, none among them, and every units digit."""
        if not hasattr(self, "groups"):
            legible = self.number > 0
            self.none = np.nonzero(~legible)[0]
            self.groups = {}
            for index in np.nonzero(legible)[0]:
                key = (bool(self.painted[index]), int(self.number[index]))
                self.groups.setdefault(key, []).append(index)
            self.numbers = [[[n for n in range(max(t * 10, 1), t * 10 + 10) if (p, n) in self.groups] for t in range(10)] for p in (False, True)]
            self.sheets = [[] for _ in range(10)]
            for _ in range(SHEETS):
                tens = int(rng.integers(10))
                number = int(rng.integers(max(tens * 10, 1), tens * 10 + 10))
                sheet = glyphs(str(number), rng)
                self.sheets[tens].append((number, cv2.resize(sheet, (max(sheet.shape[1] // 3, 2), sheet.shape[0] // 3), interpolation=cv2.INTER_AREA)))
        chosen, fresh = [], {}
        for place in range(count):
            if rng.random() > LEGIBLE:
                chosen.append(self.none[rng.integers(len(self.none))])
                continue
            if rng.random() < FRESH:
                # Large ones more often: there is more to learn from them.
                chosen.append(max(self.none[rng.integers(len(self.none), size=2)], key=lambda index: self.height[index]))
                sheets = self.sheets[rng.integers(10)]
                fresh[place] = sheets[rng.integers(len(sheets))]
                continue
            painted = bool(rng.random() < 0.4) and any(self.numbers[True])
            tens = [numbers for numbers in self.numbers[painted] if numbers]
            numbers = tens[rng.integers(len(tens))]
            group = self.groups[painted, numbers[rng.integers(len(numbers))]]
            chosen.append(group[rng.integers(len(group))])
        windows, numbers = self.x[chosen], self.number[chosen].copy()
        for place, (number, sheet) in fresh.items():
            windows[place] = over(windows[place], sheet, number < 10, self.height[chosen[place]], rng)
            numbers[place] = number
        return windows, numbers, self.height[chosen]


def over(window, sheet, one_digit, height, rng):
    """A number over a patch, as far as the patch's cells and the clip's pixels are known: flat, but turned, sheared and narrowed."""
    tall = rng.uniform(0.17, 0.33)
    wide = min(tall * sheet.shape[1] / sheet.shape[0] * rng.uniform(0.75, 1.15), 0.2 if one_digit else 0.34) * rng.uniform(0.55, 1.0)
    fine = 3
    size = np.array([wide, tall]) * PER_M * fine
    turn = np.deg2rad(rng.normal(0, 5))
    across = np.array([np.cos(turn), np.sin(turn) + rng.normal(0, 0.06)]) * size[0] / sheet.shape[1]
    down = np.array([-np.sin(turn) + rng.normal(0, 0.04), np.cos(turn)]) * size[1] / sheet.shape[0]
    middle = (np.array([len(window) / 2, len(window) / 2 - 11 + (rng.uniform(0.01, 0.11) + tall / 2) * PER_M]) + rng.normal(0, [2.0, 1.0])) * fine
    corner = middle - across * sheet.shape[1] / 2 - down * sheet.shape[0] / 2
    cover = cv2.warpAffine(sheet, np.array([[across[0], down[0], corner[0]], [across[1], down[1], corner[1]]]), (len(window) * fine,) * 2, flags=cv2.INTER_AREA)
    # Only as sharp as the clip's pixels and its lens allow.
    pixels = int(np.clip(len(window) * height / 99, 8, len(window) * fine))
    cover = cv2.resize(cover, (pixels, pixels), interpolation=cv2.INTER_AREA)
    cover = cv2.GaussianBlur(cover, (0, 0), rng.uniform(0.25, 0.9))
    cover = cv2.resize(cover, window.shape[:2], interpolation=cv2.INTER_LINEAR)[..., None]
    image = window.astype(np.float32) / 255
    shirt = np.median(image[16:32, 16:32].reshape(-1, 3), 0)
    ink, rim = colours(shirt, rng)
    shade = (cv2.GaussianBlur(image, (0, 0), 4) @ np.array([0.299, 0.587, 0.114], np.float32) / max(shirt @ [0.299, 0.587, 0.114], 0.05)).clip(0.6, 1.4)[..., None]
    return ((image * (1 - cover) + (ink * shade).clip(0, 1) * cover) * 255).clip(0, 255).astype(np.uint8)


def targets(number):
    number = torch.from_numpy(number.astype(np.int64))
    return number // 10, number % 10, (number > 0).float()


def plain(x):
    first = (x.shape[1] - CELLS) // 2
    part = x[:, first : first + CELLS, first : first + CELLS]
    return torch.from_numpy(np.ascontiguousarray(part.transpose(0, 3, 1, 2))).float() / 255


def varied(windows, heights, rng):
    """Placed and stretched as noisier joints would, softer as smaller players are, coded again, in other colours and other light."""
    out = np.empty((len(windows), 3, CELLS, CELLS), np.float32)
    for k, window in enumerate(windows):
        image = window.astype(np.float32)
        if rng.random() < 0.25 and heights[k] > 50:
            part = max(rng.uniform(0.5, 0.95), 40 / heights[k])
            # As many pixels as a smaller player has: 0.4 of the height is 48 cells wide.
            pixels = max(int(0.48 * heights[k] * part), 10)
            if pixels < len(image):
                image = cv2.resize(cv2.resize(image, (pixels, pixels), interpolation=cv2.INTER_AREA), image.shape[:2], interpolation=cv2.INTER_LINEAR)
        if rng.random() < 0.2:
            length, angle = rng.uniform(0, 2.5), rng.uniform(0, np.pi)
            kernel = np.zeros((7, 7), np.float32)
            for step in np.linspace(-length / 2, length / 2, 9):
                kernel[int(round(3 + step * np.sin(angle))), int(round(3 + step * np.cos(angle)))] += 1
            image = cv2.filter2D(image, -1, kernel / kernel.sum())
        if rng.random() < 0.25:
            coded = cv2.imencode(".jpg", image.clip(0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(35, 90))])[1]
            image = cv2.imdecode(coded, cv2.IMREAD_COLOR).astype(np.float32)
        turn, shear = np.deg2rad(rng.normal(0, 4)), rng.normal(0, 0.05)
        sx, sy = np.exp(rng.normal(0, 0.10, 2))
        matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ np.array([[sx, shear], [0, sy]])
        middle = (image.shape[0] - 1) / 2 + rng.normal(0, 1.3, 2)
        shift = middle - matrix @ np.full(2, (CELLS - 1) / 2)
        image = cv2.warpAffine(image, np.column_stack([matrix, shift]), (CELLS, CELLS), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_REPLICATE)
        if rng.random() < 0.3:
            image = image[..., rng.permutation(3)]
        if rng.random() < 0.1:
            image = 255 - image
        gain, lift = np.exp(rng.normal(0, 0.12, 3)), rng.normal(0, 12)
        image = image * gain + lift + rng.normal(0, rng.uniform(0, 5), image.shape)
        out[k] = image.clip(0, 255).transpose(2, 0, 1) / 255
    return torch.from_numpy(out)


def loss_of(logits, number):
    tens, units, legible = split(logits)
    true_tens, true_units, there = targets(number)
    digits = functional.cross_entropy(tens, true_tens, reduction="none") + functional.cross_entropy(units, true_units, reduction="none")
    return (digits * there).sum() / there.sum().clamp(min=1) + functional.binary_cross_entropy_with_logits(legible[:, 0], there)


@torch.no_grad()
def logits_of(network, patches):
    network.eval()
    found = torch.cat([network(plain(patches.x[start : start + 256])) for start in range(0, len(patches.x), 256)])
    network.train()
    return found


def right(logits, number):
    tens, units, _ = split(logits)
    return (tens.argmax(1) * 10 + units.argmax(1)).numpy() == number


def drawn(patches, rng, count):
    """So many batches of varied patches."""
    for _ in range(count):
        windows, _, heights = patches.draw(BATCH, rng)
        yield varied(windows, heights, rng)


def temperatures(logits, number):
    """By which the logits of digits and of legibility are divided so that probabilities are what they say, on validation patches."""
    tens, units, legible = split(logits)
    true_tens, true_units, there = targets(number)
    shown = there > 0
    def best(loss):
        tried = np.exp(np.linspace(np.log(0.5), np.log(4), 60))
        return float(min(tried, key=lambda t: loss(t).item()))
    digits = best(lambda t: functional.cross_entropy(tens[shown] / t, true_tens[shown]) + functional.cross_entropy(units[shown] / t, true_units[shown]))
    return digits, best(lambda t: functional.binary_cross_entropy_with_logits(legible[:, 0] / t, there))


def table(logits, patches):
    """By height: patches with a number, share read right, and of those read with a chance above 0.9 the number and the share right."""
    tens, units, legible = split(logits)
    chance = (tens.softmax(1).max(1).values * units.softmax(1).max(1).values * torch.sigmoid(legible[:, 0])).numpy()
    is_right = right(logits, patches.number)
    rows = []
    for low, high in HEIGHTS:
        here = (patches.height >= low) & (patches.height < high) & ~patches.painted
        shown, sure = here & (patches.number > 0), here & (chance > 0.9)
        rows.append((low, high, shown.sum(), is_right[shown].mean() if shown.any() else 0, sure.sum(), is_right[sure].mean() if sure.any() else 1))
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", required=True)
    parser.add_argument("--validation", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--minutes", type=float, default=12.0, help="of processor time")
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--start", help="checkpoint to go on from")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.set_flush_denormal(True)
    cv2.setNumThreads(1)
    torch.manual_seed(arguments.seed)
    rng = np.random.default_rng(arguments.seed)
    out = Path(arguments.out)
    out.mkdir(parents=True, exist_ok=True)
    patches, held = Patches(arguments.data), Patches(arguments.validation)
    print(f"{len(patches.x)} patches to train on, {len(held.x)} to watch the curve", flush=True)
    network, average = NumberNetwork(), NumberNetwork()
    if arguments.start:
        network.load_state_dict(torch.load(arguments.start)["network"])
    average.load_state_dict(network.state_dict())
    optimizer = torch.optim.AdamW(network.parameters(), arguments.rate, betas=(0.9, 0.99), weight_decay=WEIGHT_DECAY)
    curve = csv.writer((out / "curve.csv").open("w", newline=""))
    curve.writerow(["seconds", "patches", "loss", "validation_loss", "validation_right"])
    began, budget = time.process_time(), arguments.minutes * 60.0
    steps, running, reported = 0, None, 0.0
    while True:
        elapsed = time.process_time() - began
        part = elapsed / budget
        if part >= 1.0 or elapsed - reported >= min(60.0, budget / 3):
            reported = elapsed
            settle(average, drawn(patches, rng, 30))
            found = logits_of(average, held)
            shown = (held.number > 0) & ~held.painted
            loss, share = loss_of(found, held.number).item(), right(found, held.number)[shown].mean()
            curve.writerow([f"{elapsed:.0f}", steps * BATCH, f"{running or 0:.4f}", f"{loss:.4f}", f"{share:.4f}"])
            print(f"{elapsed:.0f} s, {steps * BATCH} patches, loss {running or 0:.3f}, held out {loss:.3f}, right {share:.3f}", flush=True)
            torch.save({"network": average.state_dict(), "temperatures": temperatures(found, held.number)}, out / "average.pt")
        if part >= 1.0:
            break
        for group in optimizer.param_groups:
            group["lr"] = rate_at(arguments.rate, part, steps, warm_up=60)
        windows, numbers, heights = patches.draw(BATCH, rng)
        loss = loss_of(network(varied(windows, heights, rng)), numbers)
        descend(network, optimizer, loss)
        steps += 1
        average_in(average, network, steps, AVERAGE)
        running = loss.item() if running is None else 0.98 * running + 0.02 * loss.item()
    digits, legible = temperatures(found, held.number)
    print(f"temperatures: digits {digits:.2f}, legible {legible:.2f}")
    tens, units, there = split(found)
    for low, high, count, share, sure, sure_right in table(torch.cat([tens / digits, units / digits, there / legible], 1), held):
        print(f"{low}..{high} px: {count} with a number, {share:.3f} right; {sure} surer than 0.9, {sure_right:.3f} right")


if __name__ == "__main__":
    main()
