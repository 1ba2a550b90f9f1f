"""Windows for the mask network from rendered frames with maps: the pose network's view of everybody, and the true visible pixels.

    python3 prepare.py --frames ../../target/datasets/frames-train --out PREPARED
    python3 prepare.py --frames CLIP --every 40 --out PREPARED

`--frames` is a folder that `dataset frames` (pictures) or `reconstructor synthesize --maps` (a clip) wrote. Writes `NAME.npz`: x N×9×96×64, y
N×96×64, both 0..255.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

import prepass
import rendered
from view import Person, Window, stack

VISIBLE_MIN = 0.25  # as the measure counts people
HEIGHT_MIN_PX = 17.0
POSE_MIN = 0.3
SAME_PERSON = 0.12  # below this overlap the pose is another person's
SHIFT, SCALE = 0.03, 0.06  # standard deviations of a window's place (shares of the box) and logarithm of its size


def people(session, picture, true_people, rng):
    """Everybody whom the pose network sees, with the true person."""
    for true in true_people:
        box = np.array(true["box_px"], float)
        if not true["in_view"] or true["visible_share"] < 0.2 or box[3] - box[1] < HEIGHT_MIN_PX * 0.7:
            continue
        box += rng.normal(0.0, prepass.BOX_NOISE * max(box[2] - box[0], box[3] - box[1]), 4)
        seen = rendered.look_again(session, picture, box)
        person = Person(seen.joints, seen.visibility, seen.mask, seen.first)
        if person.usable and seen.flag >= POSE_MIN:
            yield person, true


def main():
    arguments, rng, session = rendered.begin(__doc__, seed=1)
    windows, masks = [], []
    for picture, true_people, labels in rendered.frames(arguments.frames, arguments.every):
        found = list(people(session, picture, true_people, rng))
        for person, true in found:
            height = true["box_px"][3] - true["box_px"][1]
            if true["visible_share"] < VISIBLE_MIN or height < HEIGHT_MIN_PX:
                continue
            window = Window(person, rng.normal(0, SHIFT, 2), np.exp(rng.normal(0, SCALE)))
            x = stack(picture, person, [other for other, _ in found if other is not person], window)
            y = window.sample((labels == true["id"] + 1).astype(np.float32))
            if np.minimum(x[3], y).sum() >= SAME_PERSON * np.maximum(x[3], y).sum():
                windows.append((x * 255).round().astype(np.uint8))
                masks.append((y * 255).round().astype(np.uint8))
    out = Path(arguments.out)
    out.mkdir(parents=True, exist_ok=True)
    np.savez(out / f"{Path(arguments.frames).resolve().name}.npz", x=np.array(windows), y=np.array(masks))
    print(f"{len(windows)} windows")


if __name__ == "__main__":
    main()
