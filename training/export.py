"""Writes a checkpoint as ONNX: outputs `offset_m` and `presence`, each N×64×64, so that the reader needs no knowledge of the classes.

    python3 export.py --checkpoint RUN/average.pt --out ../assets/models/depth.onnx
"""

import argparse

import torch

from network import DepthNetwork, read_out
from window import GRID, PICTURE_SIZE


class Exported(torch.nn.Module):
    """The mean of what the network says of a player and of the mirrored player: steadier, for twice the time."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, picture, pose):
        both = self.network(torch.cat([picture, picture.flip(3)]), torch.cat([pose, pose.flip(3)]))
        offset, presence = read_out(both)
        (plain, mirrored), (here, there) = offset.chunk(2), presence.chunk(2)
        return (plain + mirrored.flip(2)) / 2, (here + there.flip(2)) / 2


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    network = DepthNetwork()
    network.load_state_dict(torch.load(arguments.checkpoint, map_location="cpu"))
    example = (torch.zeros(1, 4, PICTURE_SIZE, PICTURE_SIZE), torch.zeros(1, 3, GRID, GRID))
    names = {"input_names": ["picture", "pose"], "output_names": ["offset_m", "presence"]}
    free = {name: {0: "players"} for name in ("picture", "pose", "offset_m", "presence")}
    torch.onnx.export(Exported(network).eval(), example, arguments.out, opset_version=15, dynamic_axes=free, **names)


if __name__ == "__main__":
    main()
