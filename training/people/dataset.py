"""Rendered broadcast pictures (`cargo xtask dataset frames-train`) as samples of the people network: windows of the picture, boxes, ball."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from network import BALL_STRIDE, ROLES, STRIDE
from spoil import add_noise, recolour, refocus, shade

WIDTH, HEIGHT = 480, 320  # of a window
ROLE = {"player": 0, "goalkeeper": 1, "referee": 2, "assistant": 2}
SEEN_MIN, INSIDE_MIN = 0.3, 0.4  # share of a person that must be seen, and lie in the window, to be looked for
TALL_PX = (22.0, 150.0)  # people are shown this tall
BALL_SIGMA = 1.0  # cells


class Frames:
    """The pictures of all data sets below a folder, kept as the JPEG files they are."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.known = set()
        self.frames = []
        self.refresh()

    def refresh(self):
        """Takes in the sets that were rendered since."""
        for text in sorted(set(self.folder.rglob("frames.jsonl")) - self.known):
            self.known.add(text)
            for line in map(json.loads, text.open()):
                self.frames.append(Frame(text.parent / "images" / f"{line['name']}.jpg", line))
        if not self.frames:
            raise ValueError(f"{self.folder}: no frames.jsonl below it; run `cargo xtask dataset frames-train`")

    def __len__(self):
        return len(self.frames)


class Frame:
    """What is looked for in one picture."""

    def __init__(self, path, line):
        self.file = path.read_bytes()
        roles = {person["id"]: ROLE[person["role"]] for person in line["everybody"]}
        boxes, kinds, sure = [], [], []
        for person in line["people"]:
            boxes.append(person["box_px"])
            kinds.append(roles[person["id"]])
            sure.append(person["visible_share"] >= SEEN_MIN)
        for bystander in line.get("bystanders", []):
            boxes.append(bystander["box_px"])
            kinds.append(len(ROLES) - 1)
            sure.append(True)
        self.boxes = np.array(boxes, np.float32).reshape(-1, 4)
        self.kinds = np.array(kinds, np.int64)
        self.sure = np.array(sure, bool)
        ball = line["ball"]
        self.ball = None
        if ball is not None and ball.get("px") is not None:
            self.ball = (*ball["px"], ball["radius_px"], ball["visible_share"])
        self.mistaken = []  # places (x, y) that the network took for the ball: windows are drawn about them

    def picture(self):
        return cv2.imdecode(np.frombuffer(self.file, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


class Sample:
    """A window (HEIGHT, WIDTH, 3), float 0..255, and what it shows, in pixels of the window."""

    def __init__(self, view, boxes, kinds, sure, ball):
        self.view, self.boxes, self.kinds, self.sure, self.ball = view, boxes, kinds, sure, ball


def sample(frame, rng):
    """A window drawn from a picture: scaled, mirrored, recoloured, encoded again."""
    picture = frame.picture()
    height, width = picture.shape[:2]
    tall = np.median(frame.boxes[:, 3] - frame.boxes[:, 1]) if len(frame.boxes) else 60.0
    # Mostly as tall as a main camera shows people in 720 rows, now and then anything.
    wanted = np.exp(rng.normal(np.log(48.0), 0.33)) if rng.random() < 0.7 else np.exp(rng.uniform(np.log(28.0), np.log(120.0)))
    scale = float(np.clip(wanted / max(tall, 1.0), 0.35, 1.7))
    scale = max(scale, WIDTH / width, HEIGHT / height) if rng.random() < 0.8 else scale
    stretch = np.exp(rng.normal(0.0, 0.05, 2))
    sx, sy = scale * stretch
    flip = rng.random() < 0.5
    # Half of the windows are about the ball or what was taken for it, some about a person, the rest anywhere.
    draw = rng.random()
    if draw < 0.25 and frame.mistaken:
        centre = np.array(frame.mistaken[rng.integers(len(frame.mistaken))]) + rng.uniform(-0.42, 0.42, 2) * [WIDTH / sx, HEIGHT / sy]
    elif draw < 0.5 and frame.ball is not None and frame.ball[3] > 0:
        centre = np.array(frame.ball[:2]) + rng.uniform(-0.42, 0.42, 2) * [WIDTH / sx, HEIGHT / sy]
    elif draw < 0.75 and len(frame.boxes):
        box = frame.boxes[rng.integers(len(frame.boxes))]
        centre = (box[:2] + box[2:]) / 2 + rng.uniform(-0.4, 0.4, 2) * [WIDTH / sx, HEIGHT / sy]
    else:
        centre = rng.uniform(0, 1, 2) * [width, height]
    free = np.maximum(np.array([width - WIDTH / sx, height - HEIGHT / sy]) / 2, 0.0)
    middle = (np.array([width, height]) - 1) / 2
    centre = np.clip(centre, middle - free, middle + free)
    linear = np.diag([-sx if flip else sx, sy])
    shift = (np.array([WIDTH, HEIGHT]) - 1) / 2 - linear @ centre
    affine = np.concatenate([linear, shift[:, None]], 1)
    source = picture
    if scale < 0.75:  # the reconstructor averages, too
        source, affine = shrunk(picture, affine, scale)
    view = cv2.warpAffine(source, affine, (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT).astype(np.float32)
    to_window = lambda points: points @ linear.T + shift
    low, high = to_window(frame.boxes[:, :2]), to_window(frame.boxes[:, 2:])
    boxes = np.concatenate([np.minimum(low, high) - 0.5, np.maximum(low, high) + 0.5], 1).astype(np.float32)
    ball = None
    if frame.ball is not None:
        x, y, radius, seen = frame.ball
        x, y = to_window(np.array([[x, y]]))[0]
        ball = (x, y, 2 * radius * scale, seen)
    boxes, kinds, sure = inside(boxes, frame.kinds, frame.sure)
    return Sample(degrade(view, rng), boxes, kinds, sure, ball)


def whole(frame):
    """The whole picture as it is, cut to multiples of 32: for validation."""
    picture = frame.picture().astype(np.float32)
    height, width = (side // 32 * 32 for side in picture.shape[:2])
    boxes, kinds, sure = inside(frame.boxes.copy(), frame.kinds, frame.sure, (width, height))
    ball = None if frame.ball is None else (frame.ball[0], frame.ball[1], 2 * frame.ball[2], frame.ball[3])
    return Sample(picture[:height, :width], boxes, kinds, sure, ball)


def shrunk(picture, affine, scale):
    """The picture averaged down, and the affine map from it; pixel centres are whole numbers."""
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    fx, fy = small.shape[1] / picture.shape[1], small.shape[0] / picture.shape[0]
    back = np.array([[1 / fx, 0.0, 0.5 / fx - 0.5], [0.0, 1 / fy, 0.5 / fy - 0.5], [0.0, 0.0, 1.0]])
    return small, affine @ back


def inside(boxes, kinds, sure, size=(WIDTH, HEIGHT)):
    """Boxes cut to the window; those of which little lies in it are not sure."""
    area = lambda b: np.maximum(b[:, 2] - b[:, 0], 0) * np.maximum(b[:, 3] - b[:, 1], 0)
    cut = np.stack([np.clip(boxes[:, k], -0.5, size[k % 2] - 0.5) for k in range(4)], 1)
    share = area(cut) / np.maximum(area(boxes), 1e-3)
    tall = boxes[:, 3] - boxes[:, 1]
    seen = share > 0.02
    sure = sure & (share >= INSIDE_MIN) & (tall >= TALL_PX[0]) & (tall <= TALL_PX[1])
    return cut[seen], kinds[seen], sure[seen]


def targets(sample, size=(WIDTH, HEIGHT)):
    """Maps: `kind` rows×columns (−1 nobody, −2 do not ask, else the number of the box), and the ball's heat, mask and numbers."""
    columns, rows = size[0] // STRIDE, size[1] // STRIDE
    owner = np.full((rows, columns), -1, np.int64)
    x, y = np.meshgrid((np.arange(columns) + 0.5) * STRIDE - 0.5, (np.arange(rows) + 0.5) * STRIDE - 0.5)
    # From the far to the near: who stands in front owns a cell that two people claim.
    for number in np.argsort(sample.boxes[:, 3]):
        left, top, right, bottom = sample.boxes[number]
        middle = (left + right) / 2, (top + bottom) / 2
        if sample.sure[number]:
            reach = max(0.3 * (right - left), 5.0), max(0.22 * (bottom - top), 5.0)
            near = (np.abs(x - middle[0]) <= reach[0]) & (np.abs(y - middle[1]) <= reach[1])
            ring = (x > left) & (x < right) & (y > top) & (y < bottom) & (owner == -1)
            owner[ring & ~near & (np.abs(x - middle[0]) <= 2 * reach[0]) & (np.abs(y - middle[1]) <= 1.6 * reach[1])] = -2
            owner[near] = number
        else:
            owner[(x > left) & (x < right) & (y > top) & (y < bottom) & (owner == -1)] = -2
    return owner, *ball_targets(sample.ball, size)


def ball_targets(ball, size):
    columns, rows = size[0] // BALL_STRIDE, size[1] // BALL_STRIDE
    heat, ask = np.zeros((rows, columns), np.float32), np.ones((rows, columns), np.float32)
    cell = (-1, -1, 0.0, 0.0, 0.0)  # column, row, offset across and down in cells, diameter in pixels
    if ball is not None:
        x, y, diameter, seen = ball
        u, v = (x + 0.5) / BALL_STRIDE - 0.5, (y + 0.5) / BALL_STRIDE - 0.5
        if -0.5 <= u < columns - 0.5 and -0.5 <= v < rows - 0.5:
            across, down = np.arange(columns) - u, np.arange(rows) - v
            bump = np.exp(-(down**2)[:, None] / (2 * BALL_SIGMA**2)) * np.exp(-(across**2)[None] / (2 * BALL_SIGMA**2))
            if seen >= 0.4:
                heat = bump.astype(np.float32)
                column, row = int(round(u)), int(round(v))
                cell = (column, row, u - column, v - row, diameter)
            elif seen > 0.02:
                ask[bump > 0.05] = 0.0
    return heat, ask, np.array(cell, np.float32)


def degrade(view, rng):
    """What no two broadcasts share (`spoil.py`), and blocks of a JPEG."""
    view = refocus(view, rng, share=0.4, widest=1.2)
    view = recolour(view, rng)
    view = shade(view, rng)
    view = np.clip(add_noise(view, rng, strongest=8.0), 0, 255).astype(np.float32)
    if rng.random() < 0.4:
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(35, 90))]
        view = cv2.imdecode(cv2.imencode(".jpg", view.astype(np.uint8), quality)[1], cv2.IMREAD_COLOR).astype(np.float32)
    return view
