"""Writes a checkpoint as ONNX: `picture` N×3×288×512 (RGB 0..1) to `maps` N×66×72×128, probabilities.

    python3 export.py --checkpoint RUN/average.pt --out ../../assets/models/pitch.onnx
"""

import argparse

import torch

from dataset import HEIGHT, WIDTH
from network import PitchNetwork


class Exported(torch.nn.Module):
    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, picture):
        return torch.sigmoid(self.network(picture))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    network = PitchNetwork()
    network.load_state_dict(torch.load(arguments.checkpoint, map_location="cpu"))
    names = {"input_names": ["picture"], "output_names": ["maps"]}
    free = {name: {0: "pictures"} for name in ("picture", "maps")}
    torch.onnx.export(Exported(network).eval(), torch.zeros(1, 3, HEIGHT, WIDTH), arguments.out, opset_version=15, dynamic_axes=free, **names)


if __name__ == "__main__":
    main()
