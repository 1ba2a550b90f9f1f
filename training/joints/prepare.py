"""Joints as the pose network reads them beside the true ones, from rendered frames.

    python3 prepare.py --frames ../../target/datasets/frames-train --out PREPARED.npz

`--frames` as in ../masks/prepare.py. Writes read N×33×3 (x, y in pixels, visibility) and true N×33×2.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

import prepass
import rendered

VISIBLE_MIN = 0.5
HEIGHT_MIN_PX = 17.0
POSE_MIN = 0.3


def main():
    arguments, rng, session = rendered.begin(__doc__, seed=3)
    read, true = [], []
    for picture, people, _ in rendered.frames(arguments.frames, arguments.every):
        for person in people:
            box = np.array(person["box_px"], float)
            if not person["in_view"] or person["visible_share"] < VISIBLE_MIN or box[3] - box[1] < HEIGHT_MIN_PX:
                continue
            box += rng.normal(0.0, prepass.BOX_NOISE * max(box[2] - box[0], box[3] - box[1]), 4)
            seen = rendered.look_again(session, picture, box)
            if seen.flag >= POSE_MIN:
                read.append(np.column_stack([seen.joints, seen.visibility]))
                true.append(person["joints_px"])
    np.savez(arguments.out, read=np.array(read), true=np.array(true))
    print(f"{len(read)} people")


if __name__ == "__main__":
    main()
