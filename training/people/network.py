"""The network that finds people and the ball: NanoDet-g's backbone (COCO), one level of people at an 8th of the picture, the ball at a 4th."""

import torch
from torch import nn
from torch.nn import functional

BINS = 11  # NanoDet's: a side of a box is the mean of a distribution over 0..10 cells
STRIDE = 8  # of a cell of people
BALL_STRIDE = 4  # of a cell of the ball
ROLES = ("player", "goalkeeper", "official", "bystander")
MEAN_RGB = (123.675, 116.28, 103.53)  # of NanoDet's training pictures
SPREAD_RGB = (58.395, 57.12, 57.375)
BALL_WIDTH = 48


def convolution(before, after, stride=1, size=3):
    """With its activation; NanoDet's weights come with their normalisation folded in."""
    return nn.Sequential(nn.Conv2d(before, after, size, stride, size // 2), nn.LeakyReLU(0.1, inplace=True))


class Stage(nn.Module):
    """A cross-stage partial block: `deep` pairs of convolutions, everything before kept beside them."""

    def __init__(self, before, width, deep, stride):
        super().__init__()
        self.first = convolution(before, width, stride)
        half = width // 2
        self.pairs = nn.ModuleList([nn.ModuleList([convolution(width, half), convolution(half, half)]) for _ in range(deep)])
        self.last = convolution(width, width)

    def forward(self, x):
        kept = x = self.first(x)
        for a, b in self.pairs:
            y = a(x)
            x = torch.cat([b(y), y], 1)
        return torch.cat([self.last(x), kept], 1)


class PeopleNetwork(nn.Module):
    """Picture N×3×H×W (RGB 0..255, sides multiples of 32) to people N×(1+4+44)×H/8×W/8 and ball N×4×H/4×W/4, both raw."""

    def __init__(self):
        super().__init__()
        self.stem = convolution(3, 32, 2)
        self.pool = nn.MaxPool2d(3, 2, 1)
        self.stages = nn.ModuleList([Stage(32, 32, 1, 1), Stage(64, 64, 2, 2), Stage(128, 128, 2, 2), Stage(256, 256, 3, 2)])
        self.lateral = nn.ModuleList([nn.Conv2d(width, 128, 1) for width in (128, 256, 512)])
        self.people = nn.Sequential(convolution(128, 128), nn.Conv2d(128, 1 + len(ROLES) + 4 * BINS, 1))
        self.ball_near = convolution(64, BALL_WIDTH)
        self.ball_far = nn.Conv2d(128, BALL_WIDTH, 1)
        self.ball = nn.Sequential(convolution(BALL_WIDTH, BALL_WIDTH), nn.Conv2d(BALL_WIDTH, 4, 1))
        nn.init.constant_(self.ball[1].bias, 0.0)
        with torch.no_grad():
            self.ball[1].bias[0] = -5.0
        self.register_buffer("mean", torch.tensor(MEAN_RGB).view(1, 3, 1, 1))
        self.register_buffer("spread", torch.tensor(SPREAD_RGB).view(1, 3, 1, 1))

    def backbone(self):
        return [*self.stem.parameters(), *self.stages.parameters(), *self.lateral.parameters()]

    def forward(self, picture):
        x = self.pool(self.stem((picture - self.mean) / self.spread))
        levels = []
        for stage in self.stages:
            x = stage(x)
            levels.append(x)
        twice = lambda y: functional.interpolate(y, scale_factor=2.0, mode="bilinear", align_corners=False)
        top = self.lateral[2](levels[3])
        top = self.lateral[1](levels[2]) + twice(top)
        top = self.lateral[0](levels[1]) + twice(top)
        ball = functional.leaky_relu(self.ball_near(levels[0]) + twice(self.ball_far(top)), 0.1)
        return self.people(top), self.ball(ball)


def distances(people):
    """Distances from the middle of a cell to left, top, right and bottom of the box, N×4×rows×columns, pixels."""
    n, _, rows, columns = people.shape
    logits = people[:, 1 + len(ROLES) :].view(n, 4, BINS, rows, columns)
    bins = torch.arange(BINS, dtype=people.dtype, device=people.device).view(1, 1, BINS, 1, 1)
    return (torch.softmax(logits, 2) * bins).sum(2) * STRIDE


def start_from_nanodet(network, path):
    """Takes over NanoDet-g's weights (`assets/models/nanodet_g_416.onnx`): all but the second halves of its neck and its other heads."""
    import onnx
    from onnx import numpy_helper

    graph = onnx.load(path).graph
    known = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    found = {}
    for node in graph.node:
        if node.op_type == "Conv":
            number = int(node.output[0].split("Conv__")[1].split(":")[0])
            found[number] = [torch.from_numpy(known[name].copy()) for name in node.input[1:]]
    # The numbers are those of the graph, in the order of the stages; the laterals lie between them.
    laterals, heads = (156, 163, 172), (175, 176)
    plain = [module for part in (network.stem, network.stages) for module in part.modules() if isinstance(module, nn.Conv2d)]
    order = [number for number in sorted(found) if number < 172 and number not in laterals]
    assert len(plain) == len(order), (len(plain), len(order))
    with torch.no_grad():
        for module, number in zip(plain, order):
            take(module, *found[number])
        network.stem[0].weight.copy_(network.stem[0].weight.flip(1))  # blue first there, red first here
        for module, number in zip(network.lateral, laterals):
            take(module, *found[number])
        take(network.people[0][0], *found[heads[0]])
        weight, bias = found[heads[1]]
        last = network.people[1]
        last.weight[:1], last.bias[:1] = weight[:1], bias[:1]  # "person", the first of its 80 classes
        last.weight[1 : 1 + len(ROLES)] *= 0.1
        last.weight[1 + len(ROLES) :], last.bias[1 + len(ROLES) :] = weight[80:], bias[80:]


def start_from_exported(network, path):
    """Goes on from the network that `export.py` wrote: its weights keep their names."""
    import onnx
    from onnx import numpy_helper

    known = {tensor.name: torch.from_numpy(numpy_helper.to_array(tensor).copy()) for tensor in onnx.load(path).graph.initializer}
    network.load_state_dict({name: known[f"network.{name}"] for name in network.state_dict()})


def take(module, weight, bias):
    assert module.weight.shape == weight.shape, (module, weight.shape)
    module.weight.copy_(weight)
    module.bias.copy_(bias)
