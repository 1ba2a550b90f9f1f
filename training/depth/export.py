"""Writes a checkpoint as ONNX: in metres, so that the reader needs no knowledge of what the network computes with.

    python3 export.py lifting --checkpoint RUN/average.pt --out ../../assets/models/lifting.onnx
    python3 export.py depth --checkpoint RUN/average.pt --out ../../assets/models/depth.onnx
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from lifting import JOINTS, MIRROR, VECTOR, LiftingNetwork, mirrored
from network import DepthNetwork, read_out
from window import GRID, PICTURE_SIZE

LEAST = 256  # smaller lists of weights stay as they are
PLANES = ["seen", "body", "front_m", "back_m", "front_error_m", "back_error_m"]


def flipped(picture, pose):
    """Both and their mirror images."""
    left_is_right = torch.tensor([1.0, 1.0, -1.0, 1.0]).reshape(1, 4, 1, 1)
    return torch.cat([picture, picture.flip(3)]), torch.cat([pose, pose.flip(3) * left_is_right])


class Lifting(torch.nn.Module):
    """Joints N×33×3; the mean of what the network says of a player and of the mirrored player."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, picture, pose, joints):
        both = self.network(*flipped(picture, pose), torch.cat([joints, mirrored(joints)]))
        plain, other = both.reshape(-1, JOINTS, 3).chunk(2)
        return (plain + other[:, MIRROR] * torch.tensor([-1.0, 1.0, 1.0])) / 2


class Surfaces(torch.nn.Module):
    """The mean of what the network says of a player and of the mirrored player: steadier, for twice the time."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, picture, pose):
        both = self.network(*flipped(picture, pose))
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("network", choices=("lifting", "depth"))
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    lifts = arguments.network == "lifting"
    network = LiftingNetwork() if lifts else DepthNetwork()
    network.load_state_dict(torch.load(arguments.checkpoint, map_location="cpu"))
    example = (torch.zeros(1, 4, PICTURE_SIZE, PICTURE_SIZE), torch.zeros(1, 4, GRID, GRID))
    given, told = ["picture", "pose"], PLANES
    if lifts:
        example, given, told = (*example, torch.zeros(1, VECTOR)), [*given, "joints"], ["joints_m"]
    free = {name: {0: "players"} for name in (*given, *told)}
    whole = (Lifting if lifts else Surfaces)(network).eval()
    torch.onnx.export(whole, example, arguments.out, opset_version=15, dynamic_axes=free, input_names=given, output_names=told)
    halve(arguments.out)


if __name__ == "__main__":
    main()
