"""Patches for the number network from rendered people: the pose network's view of everybody, and the number on the back when it can be seen.

    python3 prepare.py --crops ../../target/datasets/numbers-train --out PREPARED --paint 12
    python3 prepare.py --clip CLIP --every 5 --out PREPARED

`--crops` is a folder that `dataset depth` wrote, `--clip` one of `reconstructor synthesize`. On backs without a number, `--paint` others are painted
in other hands. Writes `NAME.npz`: x N×48×48×3, the patch with a margin; number, 0 where none can be read; height of the person in pixels; the
patch's turn; painted or not; who it is (−1 of painted ones) and the number worn. The number is −1 where it cannot be said whether it can be read.
"""

import argparse
import json
import sys
from pathlib import Path

import cv2
import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

import paint
import prepass
import view

MARGIN_CELLS = 48
POSE_MIN = 0.3  # as reconstructor/src/pose
TURN_MIN = view.TURN_MIN - 0.05
# A number can be read on backs turned to the camera so far (cosine) and this free; between the two nothing is said.
TURNED, NOT_TURNED = 0.35, 0.15
FREE, HIDDEN = 0.75, 0.4
WRONG_PLACE = 0.3  # of the patch's side: the pose is another person's
NUMBERS_OF_ONE_DIGIT = 0.3


def trunk_axes(joints_m):
    """Middle of the shoulders; unit vectors across (to the right seen from behind), down, and out of the back."""
    shoulders = (joints_m[11] + joints_m[12]) / 2
    down = (joints_m[23] + joints_m[24]) / 2 - shoulders
    down /= np.linalg.norm(down)
    across = joints_m[12] - joints_m[11]
    across -= (across @ down) * down
    across /= np.linalg.norm(across)
    return shoulders, across, down, np.cross(down, across)


def projection(camera):
    """World points (N, 3) to pixels; the rotation's columns come one after the other."""
    rotation, position = np.array(camera["rotation"], float).reshape(3, 3).T, np.array(camera["position"], float)
    centre = (np.array([camera["width_px"], camera["height_px"]], float) - 1) / 2
    def project(points):
        c = (points - position) @ rotation.T
        n = c[:, :2] / c[:, 2:]
        return camera["focal_px"] * n * (1 + camera["k1"] * (n**2).sum(1, keepdims=True)) + centre
    return project


def facing(joints_m, camera_m):
    """Cosine between what the back looks at and the way to the camera."""
    shoulders, _, _, behind = trunk_axes(joints_m)
    way = camera_m - shoulders
    return behind @ way / np.linalg.norm(way)


def label(number, cosine, free, apart):
    """The number that can be read, 0 for none, or None when it cannot be said."""
    if number is None or cosine < NOT_TURNED or free < HIDDEN or apart > WRONG_PLACE:
        return 0
    return number if cosine > TURNED and free > FREE else None


class Rows:
    def __init__(self):
        self.rows = []

    def add(self, x, number, height, turn, painted, who=-1, wears=0):
        number = -1 if number is None else number
        self.rows.append((x.clip(0, 255).round().astype(np.uint8), number, height, turn, painted, who, wears))

    def save(self, path):
        x, number, height, turn, painted, who, wears = [np.array(column) for column in zip(*self.rows)]
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, x=x, number=number, height=height, turn=turn, painted=painted, who=who, wears=wears)
        print(f"{path.name}: {len(x)} patches, {(number > 0).sum()} with a number, {painted.sum()} of them painted", flush=True)


def compressed(picture, rng):
    """What a codec leaves of 0..255."""
    if rng.random() < 0.15:
        return picture
    coded = cv2.imencode(".jpg", picture.clip(0, 255).astype(np.uint8)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(40, 93))])[1]
    return cv2.imdecode(coded, cv2.IMREAD_COLOR)[..., ::-1].astype(np.float32)


def painted(crop, mask, meta, project, joints_m, patch, rng):
    """The crop's own pixels of the clip with a number painted on the back; None when it does not fit."""
    x0, y0, scale = meta["crop"]
    # Back to the clip's pixels, whose first is where the crop begins.
    size = int(len(crop) * scale)
    matrix = np.array([[1 / scale, 0, 0], [0, 1 / scale, 0]], float)
    native, visible = [
        cv2.warpAffine(part.astype(np.float32), matrix, (size, size), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP) / 255 for part in (crop, mask)
    ]
    local = view.sample(native, patch, 12)
    shirt = np.median(local.reshape(-1, 3), 0)
    text = str(rng.integers(1, 10) if rng.random() < NUMBERS_OF_ONE_DIGIT else rng.integers(10, 100))
    to_native = lambda points: project(points) - [x0, y0]
    drawn = paint.on_back(native, visible, to_native, *trunk_axes(joints_m), shirt, text, rng)
    return None if drawn is None else (compressed(drawn * 255, rng), int(text))


def from_crops(folder, session, paint_count, rng):
    out, figures = Rows(), {}
    for shard in sorted(Path(folder).glob("shard-*")):
        if not (shard / "meta.jsonl").exists():
            continue
        crops, masks = np.load(shard / "crops.npy", mmap_mode="r"), np.load(shard / "mask.npy", mmap_mode="r")
        for crop, mask, line in zip(crops, masks, (shard / "meta.jsonl").open()):
            meta = json.loads(line)
            joints_m, joints_px = np.array(meta["joints_m"]), np.array(meta["joints_px"])
            camera_m = np.array(meta["camera"]["position"], float)
            cosine = facing(joints_m, camera_m)
            # Of people who face the camera few are ever looked at: one in four shows what those are like.
            if (mask >= 128).sum() < 200 or (cosine < -0.2 and meta["index"] % 4):
                continue
            x0, y0, scale = meta["crop"]
            to_clip = lambda pixels: pixels * scale
            estimated, _, _, flag = prepass.estimate(session, crop, prepass.noisy_box(mask, rng))
            estimated = to_clip(estimated)
            patch = view.patch(estimated, meta["height_px"]) if flag >= POSE_MIN else None
            true = view.patch(joints_px - [x0, y0], meta["height_px"])
            if patch is None or true is None or patch.turn < TURN_MIN or patch.cell * view.CELLS < view.TRUNK_MIN_PX * view.SIDE:
                continue
            free = view.sample(mask.astype(np.float32), true, 16, 1 / scale).mean() / 255 if cosine > 0 else 1.0
            apart = np.linalg.norm(patch.middle - true.middle) / (true.cell * view.CELLS)
            number = label(meta["number"], cosine, free, apart)
            who = figures.setdefault((shard.name, meta["body"], meta["kit"], meta["number"]), len(figures))
            out.add(view.sample(crop, patch, MARGIN_CELLS, 1 / scale), number, meta["height_px"], patch.turn, False, who, meta["number"] or 0)
            if meta["number"] is None and label(1, cosine, free, apart):
                project = projection(meta["camera"])
                for _ in range(paint_count):
                    made = painted(crop, mask, meta, project, joints_m, true, rng)
                    if made:
                        out.add(view.sample(made[0], patch, MARGIN_CELLS), made[1], meta["height_px"], patch.turn, True)
    return out


def from_clip(folder, every, session, rng):
    out = Rows()
    folder = Path(folder)
    who = {person["id"]: person for person in json.loads((folder / "truth.json").read_text())["people"]}
    clip = cv2.VideoCapture(str(folder / "clip.mp4"))
    for index, line in enumerate((folder / "frames.jsonl").open()):
        picture = clip.read()[1]
        if index % every:
            continue
        row = json.loads(line)
        if row["shot"].get("mixed_with"):
            continue
        picture = picture[..., ::-1].copy()
        for person in row["people"]:
            joints_m, joints_px = np.array(person["joints_m"]), np.array(person["joints_px"])
            cosine = facing(joints_m, np.array(row["camera"]["position"], float))
            box = np.array(person["box_px"], float)
            height = box[3] - box[1]
            if not person["in_view"] or height < 30 or cosine < -0.2 or person["visible_share"] < 0.3:
                continue
            box += rng.normal(0.0, prepass.BOX_NOISE * max(box[2] - box[0], height), 4)
            seen = prepass.look(session, picture, box)
            patch = view.patch(seen.joints, height) if seen.flag >= POSE_MIN else None
            true = view.patch(joints_px, height)
            if patch is None or true is None or patch.turn < TURN_MIN or patch.cell * view.CELLS < view.TRUNK_MIN_PX * view.SIDE:
                continue
            apart = np.linalg.norm(patch.middle - true.middle) / (true.cell * view.CELLS)
            number = label(who[person["id"]].get("number"), cosine, person["visible_share"], apart)
            bottom = person["box_px"][3]
            nearer = [other["box_px"] for other in row["people"] if other is not person and other["box_px"][3] > bottom]
            if any(b[0] <= patch.middle[0] <= b[2] and b[1] <= patch.middle[1] <= b[3] for b in nearer):
                continue
            wears = who[person["id"]].get("number") or 0
            out.add(view.sample(picture, patch, MARGIN_CELLS), number, height, patch.turn, False, person["id"], wears)
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--crops")
    parser.add_argument("--clip")
    parser.add_argument("--every", type=int, default=5, help="one frame of so many")
    parser.add_argument("--paint", type=int, default=0, help="numbers painted on every back without one")
    parser.add_argument("--out", required=True)
    parser.add_argument("--model", default=str(Path(__file__).resolve().parents[2] / "assets/models/blazepose_full.onnx"))
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    rng = np.random.default_rng(arguments.seed)
    session = prepass.load(arguments.model)
    folder = arguments.crops or arguments.clip
    rows = from_crops(folder, session, arguments.paint, rng) if arguments.crops else from_clip(folder, arguments.every, session, rng)
    rows.save(Path(arguments.out) / f"{Path(folder).resolve().name}.npz")


if __name__ == "__main__":
    main()
