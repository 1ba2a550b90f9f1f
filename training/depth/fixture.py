"""Writes the vector that holds the reconstructor to the trainer's arithmetic: a small rendered player and what comes of it here.

    python3 fixture.py --rendered DATA/test --sample 5 --out ../../reconstructor/src/depth/testdata
"""

import argparse
import json
from pathlib import Path

import cv2
import numpy as np

from dataset import Rendered, view_of
from lifting import JOINTS, TAUGHT, normal
from seen import MODELS, Networks
from window import PICTURE_SIZE, mask_box, paint, sample, window_of

import prepass

SIZE = 64  # the picture of the vector, pixels
INPUT_CELLS = 60
OUTPUT_CELLS = 40


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rendered", required=True)
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    rng = np.random.default_rng(1)
    player = Rendered(arguments.rendered)[arguments.sample]
    known = Networks().look(player, rng)
    assert not isinstance(known, str), f"take another sample: {known}"
    crop, joints, depth, estimated = player.crop, known.joints, known.depth, known.mask
    shrink = crop.shape[0] // SIZE
    image = cv2.resize(crop, (SIZE, SIZE), interpolation=cv2.INTER_AREA)
    mask = cv2.resize(estimated, (SIZE, SIZE), interpolation=cv2.INTER_AREA)
    joints = np.round((joints + 0.5) / shrink - 0.5, 3)
    depth = np.round(depth, 4).astype(np.float32)
    pixels_per_metre, descent = view_of(player.meta)
    pixels_per_metre = round(pixels_per_metre / shrink, 3)
    descent = round(float(descent), 4)

    centre, side = window_of(mask_box(mask), pixels_per_metre)
    picture = (sample(np.dstack([image, mask]), centre, side, PICTURE_SIZE).transpose(2, 0, 1) / 255.0).astype(np.float32)
    pose = paint(joints, depth.astype(float), centre, side, pixels_per_metre, descent).astype(np.float32)
    planes = prepass.load(MODELS / "depth.onnx").run(None, {"picture": picture[None], "pose": pose[None]})
    known = normal(joints[None], depth[None], np.ones((1, JOINTS)), centre[None], np.array([pixels_per_metre]))
    lifted = prepass.load(MODELS / "lifting.onnx").run(None, {"picture": picture[None], "pose": pose[None], "joints": known})[0][0]
    inside = np.flatnonzero(planes[0].ravel() > 0.5)
    cells = np.concatenate([rng.choice(inside, OUTPUT_CELLS // 2, replace=False), rng.choice(PICTURE_SIZE**2, OUTPUT_CELLS // 2, replace=False)])
    pictures, poses = (rng.choice(a.size, INPUT_CELLS, replace=False) for a in (picture, pose))

    def values(array, where):
        return [[int(i), round(float(array.ravel()[i]), 6)] for i in where]

    out = Path(arguments.out)
    out.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(out / "player.png"), image[..., ::-1])
    cv2.imwrite(str(out / "mask.png"), mask)
    vector = {
        "pixels_per_metre": pixels_per_metre,
        "descent": descent,
        "joints": [[float(x), float(y), float(z)] for (x, y), z in zip(joints, depth)],
        "window": [float(centre[0]), float(centre[1]), float(side)],
        "picture": values(picture, pictures),
        "pose": values(pose, poses),
        "lifted": {str(joint): [round(float(v), 5) for v in lifted[joint]] for joint in TAUGHT},
        "planes": [values(plane, cells) for plane in planes],
    }
    (out / "vector.json").write_text(json.dumps(vector).replace("], ", "],\n "))


if __name__ == "__main__":
    main()
