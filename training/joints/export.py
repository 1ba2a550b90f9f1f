"""Writes a checkpoint as ONNX: `pose` N×100 (see network.py) to `shift` N×66.

    python3 export.py --checkpoint RUN/average.pt --out ../../assets/models/joints.onnx
"""

import argparse

import torch

from network import JOINTS, JointNetwork


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    network = JointNetwork()
    network.load_state_dict(torch.load(arguments.checkpoint, map_location="cpu"))
    names = {"input_names": ["pose"], "output_names": ["shift"]}
    free = {name: {0: "people"} for name in ("pose", "shift")}
    torch.onnx.export(network.eval(), torch.zeros(1, 3 * JOINTS + 1), arguments.out, opset_version=15, dynamic_axes=free, **names)


if __name__ == "__main__":
    main()
