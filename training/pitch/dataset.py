"""Rendered broadcast pictures (`cargo xtask dataset frames-train`) as samples of the pitch network: picture and target maps."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from points import CHANNELS, POINTS, area, lines, mirrored, points
from spoil import add_noise, recolour, refocus, shade

WIDTH, HEIGHT = 512, 288
STRIDE = 4
COLUMNS, ROWS = WIDTH // STRIDE, HEIGHT // STRIDE
POINT_SIGMA = 1.2  # cells
MIRROR_X, MIRROR_Z = mirrored(0), mirrored(2)
SHIFT = 4  # fractional bits of drawn coordinates


class Camera:
    """A camera of `frames.jsonl`; the world turned so that it stands on the near side, or behind the left goal."""

    def __init__(self, camera, pitch):
        self.size = np.array([camera["width_px"], camera["height_px"]], float)
        self.focal, self.k1 = camera["focal_px"], camera["k1"]
        # glam writes matrices by columns.
        self.rotation = np.array(camera["rotation"], float).reshape(3, 3).T
        self.position = np.array(camera["position"], float)
        x, _, z = self.position
        self.behind = abs(x) > pitch["length_m"] / 2 + 2.0 and abs(x) - pitch["length_m"] / 2 > abs(z) - pitch["width_m"] / 2
        if (self.behind and x > 0) or (not self.behind and z < 0):
            turn = np.diag([-1.0, 1.0, -1.0])
            self.rotation, self.position = self.rotation @ turn, turn @ self.position

    def project(self, world):
        """Pixels (n, 2) and whether each is before the camera and where the lens does not fold."""
        c = (world - self.position) @ self.rotation.T
        ahead = c[:, 2] > 0.5
        n = c[:, :2] / np.where(ahead, c[:, 2], 1.0)[:, None]
        bend = self.k1 * (n**2).sum(1)
        return n * (1.0 + bend)[:, None] * self.focal + (self.size - 1.0) / 2.0, ahead & (1.0 + 3.0 * bend > 0.1)


def _runs(pixels, good):
    """The stretches of a polyline that are before the camera."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
    return [pixels[a:b] for a, b in zip(edges[::2], edges[1::2]) if b - a >= 2]


def targets(camera, pitch, affine):
    """Maps (CHANNELS, ROWS, COLUMNS) in 0..1 of what `camera` shows after `affine` (2×3, pixels of the picture to pixels of the input)."""
    maps = np.zeros((CHANNELS, ROWS, COLUMNS), np.float32)
    size = pitch["length_m"], pitch["width_m"]
    # Cell (i, j) covers the pixels 4i..4i+3; its middle is at 4i + 1.5.
    to_cells = lambda pixels: (pixels @ affine[:, :2].T + affine[:, 2] - (STRIDE - 1) / 2) / STRIDE

    pixels, good = camera.project(points(*size))
    cells = to_cells(pixels)
    rows, columns = np.arange(ROWS), np.arange(COLUMNS)
    for k in np.flatnonzero(good):
        x, y = cells[k]
        if -0.5 <= x < COLUMNS - 0.5 and -0.5 <= y < ROWS - 0.5:
            across = np.exp(-((columns - x) ** 2) / (2 * POINT_SIGMA**2))
            down = np.exp(-((rows - y) ** 2) / (2 * POINT_SIGMA**2))
            maps[k] = down[:, None] * across[None]

    fine = np.empty((2 * ROWS, 2 * COLUMNS), np.uint8)
    for kind, parts in enumerate(lines(*size)):
        fine[:] = 0
        drawn = False
        for part in parts:
            for run in _runs(*camera.project(part)):
                at = to_cells(run) * 2 + 0.5
                at = at[(np.abs(at) < 4000).all(1)]
                if len(at) >= 2:
                    cv2.polylines(fine, [np.round(at * (1 << SHIFT)).astype(np.int32)], False, 255, 3, cv2.LINE_AA, SHIFT)
                    drawn = True
        if drawn:
            maps[POINTS + kind] = fine.reshape(ROWS, 2, COLUMNS, 2).mean((1, 3)) / 255.0

    pixels, good = camera.project(area(*size))
    if good.sum() >= 3:
        fine[:] = 0
        at = np.clip(to_cells(pixels[good]) * 2 + 0.5, -4000, 4000)
        cv2.fillPoly(fine, [np.round(at * (1 << SHIFT)).astype(np.int32)], 255, cv2.LINE_AA, SHIFT)
        maps[CHANNELS - 1] = fine.reshape(ROWS, 2, COLUMNS, 2).mean((1, 3)) / 255.0
    return maps


class Frames:
    """The pictures of all data sets below a folder, decoded once into memory as 8-bit."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.known = set()
        self.pitches, self.cameras, self.pictures = [], [], []
        self.refresh()
        if not self.cameras:
            raise ValueError(f"{folder}: no frames.jsonl below it; run `cargo xtask dataset frames-train`")

    def refresh(self):
        """Takes in the sets that were rendered since."""
        for text in sorted(set(self.folder.rglob("frames.jsonl")) - self.known):
            self.known.add(text)
            for line in map(json.loads, text.open()):
                self.pitches.append(line["pitch"])
                self.cameras.append(Camera(line["camera"], line["pitch"]))
                self.pictures.append(cv2.imread(str(text.parent / "images" / f"{line['name']}.jpg"))[..., ::-1].copy())

    def __len__(self):
        return len(self.cameras)

    def weight(self, index):
        """How often a picture is drawn: most play is round the centre circle, but most of what is shown again is before a goal."""
        camera, pitch = self.cameras[index], self.pitches[index]
        pixels, good = camera.project(points(pitch["length_m"], pitch["width_m"]))
        inside = good & (pixels > 0).all(1) & (pixels < camera.size).all(1)
        centre, ends = inside[:7].sum(), inside[7:].sum()
        if not inside.any():
            return 1.0
        if camera.behind:
            return 3.0
        return 4.0 if ends >= 4 and centre <= 2 else 1.5 if ends >= 4 else 0.6

    def drawn(self, rng):
        """As many indices as there are pictures, drawn by their weights."""
        weights = np.array([self.weight(index) for index in range(len(self))])
        return rng.choice(len(self), len(self), p=weights / weights.sum())

    def _end(self, index):
        """Where the penalty area in view is (the near one from behind a goal), pixels; none when none is."""
        camera, pitch = self.cameras[index], self.pitches[index]
        pixels, good = camera.project(points(pitch["length_m"], pitch["width_m"]))
        for first in (7, 25):
            seen = pixels[first : first + 18][good[first : first + 18]]
            seen = seen[(seen > 0).all(1) & (seen < camera.size).all(1)]
            if len(seen) >= 4:
                return seen.mean(0)
        return None

    def sample(self, index, rng=None):
        """Picture (HEIGHT, WIDTH, 3) float 0..255 and target maps; cropped, turned, mirrored and recoloured with `rng`."""
        picture, camera = self.pictures[index], self.cameras[index]
        height, width = picture.shape[:2]
        scale = WIDTH / width
        affine = np.array([[scale, 0.0, (scale - 1) / 2], [0.0, scale, (scale - 1) / 2]])
        flip = False
        if rng is not None:
            flip = rng.random() < 0.5
            affine = _drawn_affine(rng, width, height, flip, self._end(index) if rng.random() < 0.5 else None)
        maps = targets(camera, self.pitches[index], affine)
        view = cv2.warpAffine(picture, affine, (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)
        if flip:
            maps = maps[MIRROR_Z if camera.behind else MIRROR_X]
        view = view.astype(np.float32)
        if rng is not None:
            view = degrade(view, rng)
        return view, maps


def _drawn_affine(rng, width, height, flip, towards=None):
    """A window of the picture, a little turned and stretched, as pixels to pixels of the input; mirrored when `flip`; round `towards` when given."""
    zoom = np.exp(rng.uniform(0.0, 0.5)) if rng.random() < 0.7 else 1.0
    if towards is not None:
        zoom = np.exp(rng.uniform(0.2, 0.8))
    stretch = np.exp(rng.normal(0.0, 0.04, 2))
    angle = np.radians(rng.normal(0.0, 1.2))
    scale = np.maximum(WIDTH / width * zoom * stretch, WIDTH / width)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    linear = np.diag(scale) @ turn
    free = np.maximum(np.array([width, height]) - np.array([WIDTH, HEIGHT]) / scale, 0.0) / 2
    whole = (np.array([width, height]) - 1) / 2
    middle = whole + rng.uniform(-1, 1, 2) * free
    if towards is not None:
        middle = whole + np.clip(towards + rng.normal(0.0, 0.08 * width, 2) - whole, -free, free)
    if flip:
        linear[0] = -linear[0]
    shift = (np.array([WIDTH, HEIGHT]) - 1) / 2 - linear @ middle
    return np.concatenate([linear, shift[:, None]], 1)


def degrade(view, rng):
    """What no two broadcasts share (`spoil.py`), and graphics."""
    view = refocus(view, rng, share=0.35, widest=1.3)
    view = recolour(view, rng)
    view = shade(view, rng)
    view = add_noise(view, rng, strongest=9.0)
    for _ in range(rng.integers(0, 3)):  # graphics and people close to the camera
        if rng.random() < 0.4:
            w, h = rng.integers(20, 180), rng.integers(8, 60)
            x, y = rng.integers(0, WIDTH - w), rng.integers(0, HEIGHT - h)
            view[y : y + h, x : x + w] = rng.uniform(0, 255, 3)
    return np.clip(view, 0, 255).astype(np.float32)
