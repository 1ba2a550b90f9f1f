"""What the reconstructor knows of a rendered player before the depth network runs: refined joints and mask, with the noise they have in use.

The boxes are the true ones, moved as a detector's would be; the pose network looks as often as in the product; joints are refined by
`joints.onnx`, the mask is that of `masks.onnx`, which also sees the others in the crop.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

TRAINING = Path(__file__).resolve().parent.parent
sys.path.append(str(TRAINING))  # behind this folder: names are the same in both
sys.path.append(str(TRAINING / "masks"))

import prepass
import rendered
import view

MODELS = TRAINING.parent / "assets/models"
POSE_FAILED = 0.3  # below this flag the reconstructor drops people
SHIFT_UNIT, SHIFT_MAX = 0.1, 0.25  # as reconstructor/src/pose/refine.rs


class Seen(NamedTuple):
    """Joints (33, 2) in pixels of the crop, their depth (33,) behind the hips in metres, visibility (33,), mask u8 on the crop's pixels."""

    joints: np.ndarray
    depth: np.ndarray
    visibility: np.ndarray
    mask: np.ndarray


class Networks:
    """The networks of the stages before depth."""

    def __init__(self):
        self.pose, self.joints, self.masks = (prepass.load(MODELS / f"{name}.onnx") for name in ("blazepose_full", "joints", "masks"))

    def look(self, sample, rng):
        """What is known of the player of a sample; a word that says why when nothing is."""
        if (sample.mask >= 128).sum() < 64:
            return "hidden"
        look = self._look(sample.crop, sample.box, rng)
        person = view.Person(look.joints, look.visibility, look.mask, look.first)
        if look.flag < POSE_FAILED or not person.usable:
            return "pose failed"
        others = [self._look(sample.crop, sample.to_crop(np.reshape(box, (2, 2))).ravel(), rng) for box in sample.meta["others_px"]]
        others = [view.Person(other.joints, other.visibility, other.mask, other.first) for other in others if other.flag >= POSE_FAILED]
        window = view.Window(person)
        stack = view.stack(sample.crop, person, [other for other in others if other.usable], window)
        mask = self.masks.run(None, {self.masks.get_inputs()[0].name: stack[None]})[0].reshape(view.ROWS, view.COLUMNS)
        return Seen(look.joints, look.depth, look.visibility, on_crop(mask, window, sample.crop.shape[0]))

    def _look(self, crop, box, rng):
        box = np.array(box, float)
        box += rng.normal(0.0, prepass.BOX_NOISE * max(box[2] - box[0], box[3] - box[1]), 4)
        look = rendered.look_again(self.pose, crop, box)
        return look._replace(joints=look.joints + self._shift(look))

    def _shift(self, look):
        span = max(np.ptp(look.joints[:, 1]), 1.0)
        middle = (look.joints[23] + look.joints[24]) / 2
        pose = np.concatenate([(4 * (look.joints - middle) / span).ravel(), 2 * look.visibility - 1, [np.log(span / 50)]])
        shift = self.joints.run(None, {"pose": pose[None].astype(np.float32)})[0].reshape(33, 2).astype(float) * SHIFT_UNIT
        return shift * np.minimum(1.0, SHIFT_MAX / np.maximum(np.linalg.norm(shift, axis=1), 1e-9))[:, None] * span


def on_crop(mask, window, size):
    """The mask network's cells on the pixels of the crop, u8; 0 outside the window."""
    first = -window.corner / window.cell - 0.5
    matrix = np.array([[1 / window.cell, 0.0, first[0]], [0.0, 1 / window.cell, first[1]]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.round(255 * cv2.warpAffine(mask.astype(np.float32), matrix, (size, size), flags=flags)).clip(0, 255).astype(np.uint8)
