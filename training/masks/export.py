"""Writes a checkpoint as ONNX: `window` N×9×96×64 (0..1, see view.py) to `own` N×96×64, probabilities.

    python3 export.py --checkpoint RUN/average.pt --out ../../assets/models/masks.onnx
"""

import argparse

import torch

from network import CHANNELS, MaskNetwork


class Exported(torch.nn.Module):
    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, window):
        return torch.sigmoid(self.network(window))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    network = MaskNetwork()
    network.load_state_dict(torch.load(arguments.checkpoint, map_location="cpu"))
    names = {"input_names": ["window"], "output_names": ["own"]}
    free = {name: {0: "people"} for name in ("window", "own")}
    torch.onnx.export(Exported(network).eval(), torch.zeros(1, CHANNELS, 96, 64), arguments.out, opset_version=15, dynamic_axes=free, **names)


if __name__ == "__main__":
    main()
