"""Writes a checkpoint as ONNX: `picture` 1×3×H×W (RGB 0..255, sides multiples of 32) to `people` 1×9×H/8×W/8 and `ball` 1×4×H/4×W/4.

    python3 export.py --checkpoint RUN/average.pt --out ../../assets/models/people.onnx
"""

import argparse

import torch

from network import BALL_STRIDE, ROLES, PeopleNetwork, distances


class Exported(torch.nn.Module):
    """Scores and roles as probabilities, distances and the ball's diameter in pixels."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, picture):
        people, ball = self.network(picture)
        roles = torch.softmax(people[:, 1 : 1 + len(ROLES)], 1)
        people = torch.cat([torch.sigmoid(people[:, :1]), roles, distances(people)], 1)
        ball = torch.cat([torch.sigmoid(ball[:, :1]), ball[:, 1:3], ball[:, 3:].clamp(-3, 4).exp() * BALL_STRIDE], 1)
        return people, ball


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    network = PeopleNetwork()
    network.load_state_dict(torch.load(arguments.checkpoint, map_location="cpu"))
    free = {name: {2: f"{name}_rows", 3: f"{name}_columns"} for name in ("picture", "people", "ball")}
    torch.onnx.export(
        Exported(network).eval(),
        torch.zeros(1, 3, 320, 480),
        arguments.out,
        input_names=["picture"],
        output_names=["people", "ball"],
        dynamic_axes=free,
        opset_version=13,
    )


if __name__ == "__main__":
    main()
