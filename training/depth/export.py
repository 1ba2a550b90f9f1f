"""Writes a checkpoint as ONNX: six planes, each N×128×128, so that the reader needs no knowledge of what the network computes with.

    python3 export.py --checkpoint RUN/average.pt --out ../../assets/models/depth.onnx
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from network import DepthNetwork, read_out
from window import GRID, PICTURE_SIZE

LEAST = 256  # smaller lists of weights stay as they are
PLANES = ["seen", "body", "front_m", "back_m", "front_error_m", "back_error_m"]


class Exported(torch.nn.Module):
    """The mean of what the network says of a player and of the mirrored player: steadier, for twice the time."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, picture, pose):
        left_is_right = torch.tensor([1.0, 1.0, -1.0, 1.0]).reshape(1, 4, 1, 1)
        both = self.network(torch.cat([picture, picture.flip(3)]), torch.cat([pose, pose.flip(3) * left_is_right]))
        seen, body, front, back, error, back_error = read_out(both)
        planes = (torch.sigmoid(seen), torch.sigmoid(body), front, back, torch.exp(error), torch.exp(back_error))
        halves = (plane.chunk(2) for plane in planes)
        return tuple((plain + mirrored.flip(2)) / 2 for plain, mirrored in halves)


def halve(path):
    """Keeps the weights in half precision, of which training made use, and widens them when the file is read."""
    model = onnx.load(path)
    graph, casts = model.graph, []
    for tensor in graph.initializer:
        values = numpy_helper.to_array(tensor)
        if values.dtype == np.float32 and values.size >= LEAST:
            name = tensor.name
            tensor.CopyFrom(numpy_helper.from_array(values.astype(np.float16), f"{name}.half"))
            casts.append(helper.make_node("Cast", [f"{name}.half"], [name], to=TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    del graph.node[:]
    graph.node.extend(nodes)
    onnx.checker.check_model(model)
    onnx.save(model, path)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    network = DepthNetwork()
    network.load_state_dict(torch.load(arguments.checkpoint, map_location="cpu"))
    example = (torch.zeros(1, 4, PICTURE_SIZE, PICTURE_SIZE), torch.zeros(1, 4, GRID, GRID))
    free = {name: {0: "players"} for name in ("picture", "pose", *PLANES)}
    torch.onnx.export(
        Exported(network).eval(), example, arguments.out, opset_version=15, dynamic_axes=free, input_names=["picture", "pose"], output_names=PLANES
    )
    halve(arguments.out)


if __name__ == "__main__":
    main()
