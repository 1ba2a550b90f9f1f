"""Writes a checkpoint as ONNX: `patch` N×3×32×32 (0..1, see view.py) to the probabilities `tens` N×10 (0: none), `units` N×10, `legible` N×1.

    python3 export.py --checkpoint RUN/average.pt --out ../../assets/models/numbers.onnx
"""

import argparse

import torch

from network import NumberNetwork, split
from view import CELLS


class Exported(torch.nn.Module):
    def __init__(self, network, digits, legible):
        super().__init__()
        self.network, self.digits, self.legible = network, digits, legible

    def forward(self, patch):
        tens, units, there = split(self.network(patch))
        return torch.softmax(tens / self.digits, 1), torch.softmax(units / self.digits, 1), torch.sigmoid(there / self.legible)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    kept = torch.load(arguments.checkpoint, map_location="cpu")
    network = NumberNetwork()
    network.load_state_dict(kept["network"])
    names = {"input_names": ["patch"], "output_names": ["tens", "units", "legible"]}
    free = {name: {0: "people"} for name in ("patch", "tens", "units", "legible")}
    exported = Exported(network, *kept["temperatures"]).eval()
    torch.onnx.export(exported, torch.zeros(1, 3, CELLS, CELLS), arguments.out, opset_version=15, dynamic_axes=free, **names)


if __name__ == "__main__":
    main()
