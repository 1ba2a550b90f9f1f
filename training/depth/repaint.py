"""Paints other joints than the pose network's into packed samples: those of the lifting network (`lifted.npy`), or the true ones (`true.npy`).

    python3 repaint.py --packed PACKED/train lifted --checkpoint RUN/average.pt
    python3 repaint.py --packed PACKED/train true

The depth network is trained on `lifted`, of samples that the lifting network was not trained on: it must meet the mistakes that are made in use.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

from lifting import JOINTS, MIRROR, TAUGHT, LiftingNetwork, mirrored
from export import flipped
from prepare import PACKED_GRID, POSE_STEP
from train_lifting import Poses
from window import paint


@torch.no_grad()
def lifted(network, data, shard):
    """Joints N×33×3 in pixels of the crop and metres behind the hips, as the reconstructor places them."""
    rows = [place for place, (folder, _) in enumerate(data.places) if folder == shard]
    _, _, known, _, window = data.shards[shard]
    told = []
    for start in range(0, len(rows), 128):
        picture, pose, joints, _ = data.batch(rows[start : start + 128])
        halves = torch.cat([picture, picture.flip(3)])
        _, poses = flipped(picture, pose)
        both = network.told(halves, poses, torch.cat([joints, mirrored(joints)])).reshape(-1, JOINTS, 3)
        plain, other = both.chunk(2)
        told.append((plain + other[:, MIRROR] * torch.tensor([-1.0, 1.0, 1.0])) / 2)
    joints = torch.cat(told).double().numpy()
    read = np.concatenate([known[:, : 2 * JOINTS].reshape(-1, JOINTS, 2), known[:, 2 * JOINTS : 3 * JOINTS, None]], 2)
    untaught = [joint for joint in range(JOINTS) if joint not in TAUGHT]
    joints[:, untaught] = read[:, untaught]  # not painted
    joints[..., :2] = joints[..., :2] * window[:, 3, None, None] + window[:, None, :2]
    return joints


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("which", choices=("lifted", "true"))
    parser.add_argument("--packed", required=True)
    parser.add_argument("--checkpoint", help="of the lifting network")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    network, data = None, None
    if arguments.which == "lifted":
        network = LiftingNetwork()
        network.load_state_dict(torch.load(arguments.checkpoint))
        network.eval()
        data = Poses(arguments.packed)
    for file in sorted(Path(arguments.packed).rglob("window.npy")):
        shard = file.parent
        window = np.load(file)
        joints = np.load(shard / "truth.npy") if network is None else lifted(network, data, shard)
        poses = [
            paint(one[:, :2].astype(float), one[:, 2].astype(float), w[:2], w[2], w[3], w[4], PACKED_GRID).transpose(1, 2, 0) for one, w in zip(joints, window)
        ]
        np.save(shard / f"{arguments.which}.npy", np.round(np.stack(poses) / POSE_STEP).clip(-127, 127).astype(np.int8))
        print(shard.name, len(poses), flush=True)


if __name__ == "__main__":
    main()
