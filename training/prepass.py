"""BlazePose over rendered players: estimated joints and masks, with the noise that the reconstructor will meet.

POSE_CONVENTION.md says how the outputs are read. The person's box is the true one, moved a little as a detector would.
"""

from typing import NamedTuple

import cv2
import numpy as np
import onnxruntime

BOX_MARGIN = 1.5  # as the reconstructor looks at people
BOX_NOISE = 0.04  # standard deviation of a box edge, of the box's larger side
INPUT = 256
POSE_FAILED = 0.1  # below this flag a sample is dropped


def samples_per_cell(side, size):
    """Samples along each axis of a cell, where `side` pixels become `size` cells: each pixel is looked at."""
    return int(np.clip(np.ceil(side / size - 1e-6), 1, 8))


def sample_quickly(image, centre, side, size, per_cell=None):
    """As `window.sample` to a level of 255, for the thousands of training players: float32."""
    n = per_cell or samples_per_cell(side, size)
    step = side / (size * n)
    first = np.asarray(centre, float) + (0.5 / (size * n) - 0.5) * side
    matrix = np.array([[step, 0.0, first[0]], [0.0, step, first[1]]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    fine = cv2.warpAffine(image.astype(np.float32), matrix, (size * n, size * n), flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return fine if n == 1 else cv2.resize(fine, (size, size), interpolation=cv2.INTER_AREA)


def load(path):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def noisy_box(mask, rng):
    """The box of the true mask with edges moved at random; x0, y0, x1, y1."""
    rows, columns = np.nonzero(mask >= 128)
    box = np.array([columns.min(), rows.min(), columns.max(), rows.max()], float)
    return box + rng.normal(0.0, BOX_NOISE * max(box[2] - box[0], box[3] - box[1]), 4)


def sigmoid(logits):
    return 1.0 / (1.0 + np.exp(-np.clip(logits, -30.0, 30.0)))


def estimate(session, image, box):
    """Joints (33, 2) in pixels of `image`, their depth (33,) in metres, mask (H, W) u8 on its pixels, flag 0..1."""
    centre = np.array([(box[0] + box[2]) / 2, (box[1] + box[3]) / 2])
    side = BOX_MARGIN * max(box[2] - box[0], box[3] - box[1])
    # The crops are enlarged clip pixels already: one sample per pixel loses nothing.
    crop = sample_quickly(image, centre, side, INPUT, per_cell=1)[None] / np.float32(255.0)
    landmarks, flag, logits, _, world = session.run(None, {"input_1": crop})
    pixels = centre + (landmarks.reshape(39, 5)[:33, :2].astype(float) / INPUT - 0.5) * side
    return pixels, _behind_hips(world), _back(sigmoid(logits.reshape(INPUT, INPUT).astype(np.float32)), image.shape, centre, side), float(flag.item())


def _behind_hips(world):
    depth = world.reshape(39, 3)[:33, 2].astype(float)
    return depth - (depth[23] + depth[24]) / 2


class Look(NamedTuple):
    """What the network sees in one box of a whole picture: joints (33, 2) in its pixels, visibility (33,), mask 0..1 on the pixels inside the
    square and the picture, of which the first is at `first` (x, y), flag 0..1, depth (33,) of the joints behind the hips in metres."""

    joints: np.ndarray
    visibility: np.ndarray
    mask: np.ndarray
    first: np.ndarray
    flag: float
    depth: np.ndarray


def look(session, picture, box):
    """As `PoseEstimator::look` of the reconstructor, before islands go."""
    centre = np.array([(box[0] + box[2]) / 2, (box[1] + box[3]) / 2])
    side = max(BOX_MARGIN * max(box[2] - box[0], box[3] - box[1]), 1.0)
    crop = sample_quickly(picture, centre, side, INPUT)[None] / np.float32(255.0)
    landmarks, flag, logits, _, world = session.run(None, {"input_1": crop})
    landmarks = landmarks.reshape(39, 5)[:33]
    joints = centre + (landmarks[:, :2].astype(float) / INPUT - 0.5) * side
    limit = np.array([picture.shape[1], picture.shape[0]]) - 1
    first = np.maximum(np.ceil(centre - side / 2), 0).astype(int)
    last = np.minimum(np.floor(centre + side / 2), limit).astype(int)
    size = np.maximum(last - first + 1, 1)
    mask = _back(sigmoid(logits.reshape(INPUT, INPUT).astype(np.float32)), (size[1], size[0]), centre - first, side)
    return Look(joints, sigmoid(landmarks[:, 3]), mask / np.float32(255.0), first, float(flag.item()), _behind_hips(world))


def _back(probability, shape, centre, side):
    """The crop's mask on the pixels of the picture; 0 outside the crop."""

    scale = INPUT / side
    first = (np.array([0.0, 0.0]) - centre) * scale + (INPUT - 1) / 2
    matrix = np.array([[scale, 0.0, first[0]], [0.0, scale, first[1]]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    out = cv2.warpAffine(probability, matrix, (shape[1], shape[0]), flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0)
    return np.round(255.0 * out).astype(np.uint8)
