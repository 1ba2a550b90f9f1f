"""Rendered pictures with their truth, and the pose network's look at the people in them."""

import argparse
import json
from pathlib import Path

import cv2
import numpy as np

import prepass

OFF_CENTRE, SURE, NARROW = 0.12, 0.5, 0.8  # as reconstructor/src/pose


def begin(text, seed):
    """The arguments of a preparation, its generator of numbers, and the pose network."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--every", type=int, default=1, help="one frame of so many")
    parser.add_argument("--model", default=str(Path(__file__).resolve().parents[1] / "assets/models/blazepose_full.onnx"))
    parser.add_argument("--seed", type=int, default=seed)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    return arguments, np.random.default_rng(arguments.seed), prepass.load(arguments.model)


def frames(folder, every=1):
    """Picture, people and map of every frame that is no close-up. `folder` is what `dataset frames` or `reconstructor synthesize --maps` wrote."""
    folder = Path(folder)
    rows = [json.loads(line) for line in (folder / "frames.jsonl").open()]
    clip = cv2.VideoCapture(str(folder / "clip.mp4")) if (folder / "clip.mp4").exists() else None
    for number, row in enumerate(rows):
        picture = clip.read()[1] if clip else None
        if number % every or row["shot"]["kind"] == "close-up" or row["shot"].get("mixed_with"):
            continue
        name = f"{row['frame']:06}" if clip else row["name"]
        if not clip:
            picture = cv2.imread(str(folder / "images" / f"{name}.jpg"))
        labels = cv2.imread(str(folder / "maps" / f"{name}-people.png"), cv2.IMREAD_UNCHANGED)
        if picture is not None and labels is not None:
            yield picture[..., ::-1].copy(), row["people"], labels


def look_again(session, picture, box):
    """The pose network as the product asks it: once more from the hips, or narrower in a tangle."""
    side = max(box[2] - box[0], box[3] - box[1])
    best = prepass.look(session, picture, box)
    hips = best.joints[23:25].mean(0)
    centre = np.array([box[0] + box[2], box[1] + box[3]]) / 2
    inside = (np.abs(hips - centre) < [0.25 * (box[2] - box[0]), 0.4 * (box[3] - box[1])]).all()
    around = lambda middle, side: [*(middle - side / 2), *(middle + side / 2)]
    if not inside:
        second = prepass.look(session, picture, around(centre, side * NARROW))
        return second if second.flag > best.flag else best
    if np.linalg.norm(hips - centre) / (prepass.BOX_MARGIN * side) > OFF_CENTRE or best.flag < SURE:
        second = prepass.look(session, picture, around(hips, side))
        return second if second.flag > best.flag - 0.1 else best
    return best
