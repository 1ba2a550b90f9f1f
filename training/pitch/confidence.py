"""Holds the confidence of the camera finder against how often it is right, on pictures that are harder than rendered ones.

    python3 confidence.py make --data ../../target/datasets/pitch/validation --out ../../target/datasets/pitch/hard
    reconstructor evaluate calibration --data target/datasets/pitch/hard --json hard.json
    python3 confidence.py fit hard.json

`make` cuts out the middle of pictures that were not trained on, so that less of the pitch is in view, and spoils them; `fit` prints
the slope and offset by which the logit of the confidence is to be changed (Platt scaling).
"""

import argparse
import json
import sys
from pathlib import Path

import cv2
import numpy as np

sys.path.append(str(Path(__file__).resolve().parent))

from dataset import degrade

WIDTH, HEIGHT = 960, 540  # `degrade` works at any size; blur and noise count in pixels of the input, so it is done there
BANDS = [0.0, 0.25, 0.5, 0.7, 0.85, 0.95, 1.001]


def make(data, out, variants, seed):
    rng = np.random.default_rng(seed)
    data, out = Path(data), Path(out)
    (out / "images").mkdir(parents=True)
    with (out / "frames.jsonl").open("w") as lines:
        for line in map(json.loads, (data / "frames.jsonl").open()):
            picture = cv2.imread(str(data / "images" / f"{line['name']}.jpg"))[..., ::-1]
            height, width = picture.shape[:2]
            for variant in range(variants):
                zoom = float(np.exp(rng.uniform(0.0, 0.9)))
                # About the picture's middle, so that the optical axis stays there.
                scale = zoom * WIDTH / width
                affine = np.array([[scale, 0, (WIDTH - 1) / 2 - scale * (width - 1) / 2], [0, scale, (HEIGHT - 1) / 2 - scale * (height - 1) / 2]])
                view = cv2.warpAffine(np.ascontiguousarray(picture), affine, (WIDTH, HEIGHT), flags=cv2.INTER_AREA)
                small = cv2.resize(view, (512, 288), interpolation=cv2.INTER_AREA).astype(np.float32)
                view = cv2.resize(degrade(degrade(small, rng), rng), (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
                name = f"{line['name']}-{variant}"
                encoded = np.clip(view, 0, 255).astype(np.uint8)[..., ::-1]
                cv2.imwrite(str(out / "images" / f"{name}.jpg"), encoded, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 80))])
                camera = dict(line["camera"], width_px=WIDTH, height_px=HEIGHT, focal_px=line["camera"]["focal_px"] * scale)
                lines.write(json.dumps({"name": name, "pitch": line["pitch"], "shot": line["shot"], "camera": camera}) + "\n")


def table(confidence, right):
    for low, high in zip(BANDS[:-1], BANDS[1:]):
        inside = (confidence >= low) & (confidence < high)
        if inside.any():
            print(f"  {low:.2f}..{min(high, 1.0):.2f}: {inside.sum()} guesses, mean {confidence[inside].mean():.3f}, right {right[inside].mean():.3f}")


def fit(files):
    guesses = np.array([guess for name in files for guess in json.load(open(name))["guesses"]], float)
    confidence, right = guesses[:, 0], guesses[:, 1]
    logit = np.log(np.clip(confidence, 1e-9, 1 - 1e-9) / np.clip(1 - confidence, 1e-9, 1))
    inputs = np.stack([logit, np.ones_like(logit)], 1)
    # A weak prior keeps the slope finite where right and wrong part cleanly.
    weights, prior = np.array([1.0, 0.0]), np.diag([1e-2, 1e-4])
    def loss(weights):
        z = inputs @ weights
        away = weights - [1.0, 0.0]
        return (np.logaddexp(0.0, z) - right * z).sum() + away @ prior @ away / 2

    for _ in range(100):  # Newton's method, with steps halved until they help
        p = 1 / (1 + np.exp(-np.clip(inputs @ weights, -30, 30)))
        hessian = inputs.T @ (inputs * (p * (1 - p))[:, None]) + prior
        step = np.linalg.solve(hessian, inputs.T @ (p - right) + prior @ (weights - [1.0, 0.0]))
        while loss(weights - step) > loss(weights) and np.abs(step).max() > 1e-9:
            step /= 2
        weights = weights - step
    print(f"{len(right)} guesses, {int(right.sum())} right; slope {weights[0]:.3f}, offset {weights[1]:.3f}")
    print("before:")
    table(confidence, right)
    print("after:")
    table(1 / (1 + np.exp(-np.clip(inputs @ weights, -30, 30))), right)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = parser.add_subparsers(dest="part", required=True)
    making = parts.add_parser("make")
    making.add_argument("--data", required=True)
    making.add_argument("--out", required=True)
    making.add_argument("--variants", type=int, default=2)
    making.add_argument("--seed", type=int, default=1)
    fitting = parts.add_parser("fit")
    fitting.add_argument("files", nargs="+")
    arguments = parser.parse_args()
    if arguments.part == "make":
        make(arguments.data, arguments.out, arguments.variants, arguments.seed)
    else:
        fit(arguments.files)


if __name__ == "__main__":
    main()
