"""What the trainings share: arguments, start, supply of batches, the course of the learning rate, the running average of the weights."""

import argparse
import csv
import math
import queue
import threading
from pathlib import Path

import numpy as np
import torch


def parser_of(text, minutes, rate):
    """A parser of the arguments that every training has; each adds its own."""
    parser = argparse.ArgumentParser(description=text)
    parser.add_argument("--data", required=True)
    parser.add_argument("--validation", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--minutes", type=float, default=minutes)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rate", type=float, default=rate, help="highest learning rate")
    parser.add_argument("--start", help="checkpoint to go on from")
    return parser


def begin(arguments):
    """One thread for the network, a seed for what is drawn; gives the generator of numbers and the folder of the run."""
    torch.set_num_threads(1)
    torch.set_flush_denormal(True)
    torch.manual_seed(arguments.seed)
    out = Path(arguments.out)
    out.mkdir(parents=True, exist_ok=True)
    return np.random.default_rng(arguments.seed), out


def with_average(network, checkpoint):
    """The network, with the weights of the checkpoint if there is one, and another that will hold their running average."""
    if checkpoint:
        network.load_state_dict(torch.load(checkpoint))
    average = type(network)()
    average.load_state_dict(network.state_dict())
    return network.to(memory_format=torch.channels_last), average.to(memory_format=torch.channels_last)


def curve_of(out, columns):
    """The open table of the run's progress; every line is on disk at once."""
    curve = csv.writer((out / "curve.csv").open("w", newline="", buffering=1))
    curve.writerow(["seconds", "samples", *columns])
    return curve


def batches(data, size, draw, make):
    """Endless batches, made by a thread beside the training: `draw` gives the indices of a round, `make` a batch of `size` of them.

    Before each round `data` takes in what was rendered since, so `draw` must look anew how much there is.
    """
    ready = queue.Queue(4)

    def work():
        order = []
        try:
            while True:
                if len(order) < size:
                    data.refresh()
                    order = list(draw())
                ready.put(make([order.pop() for _ in range(size)]))
        except Exception as error:  # else the training would wait for ever
            ready.put(error)

    threading.Thread(target=work, daemon=True).start()
    while True:
        batch = ready.get()
        if isinstance(batch, Exception):
            raise batch
        yield batch


def rate_at(highest, part, step, warm_up):
    """Learning rate after `step` steps and a share `part` of the time: rises over `warm_up` steps, falls as a cosine to a hundredth."""
    return highest * min(1.0, (step + 1) / warm_up) * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * part)))


def descend(network, optimizer, loss, longest=5.0):
    """One step down the gradient, which is shortened to `longest`."""
    optimizer.zero_grad(set_to_none=True)
    loss.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), longest)
    optimizer.step()


def keep(out, network, average):
    """Writes the weights and their running average."""
    torch.save(average.state_dict(), out / "average.pt")
    torch.save(network.state_dict(), out / "network.pt")


@torch.no_grad()
def average_in(average, network, step, keep):
    """Moves the averaged weights towards the network's, by 1 − `keep` and by more in the first steps."""
    keep = min(keep, step / (step + 20))
    for mean, value in zip(average.state_dict().values(), network.state_dict().values()):
        if mean.dtype.is_floating_point:
            mean.lerp_(value, 1 - keep)
        else:
            mean.copy_(value)


@torch.no_grad()
def settle(network, inputs):
    """Measures the batch statistics of averaged weights anew: their running average is of other weights, and one wild batch spoils it for good."""
    norms = [module for module in network.modules() if isinstance(module, (torch.nn.BatchNorm1d, torch.nn.BatchNorm2d))]
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # the plain mean over what comes
    network.train()
    for given in inputs:
        network(*given) if isinstance(given, tuple) else network(given)
    for norm in norms:
        norm.momentum = 0.1


class Chances(torch.nn.Module):
    """A network that ends in probabilities."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, seen):
        return torch.sigmoid(self.network(seen))


def export(text, network, example, names, free, last=lambda network: network):
    """The command that writes a checkpoint as ONNX: weights into `network`, behind it `last`; `names` of input and output, whose first axis is `free`."""
    parser = argparse.ArgumentParser(description=text)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    network.load_state_dict(torch.load(arguments.checkpoint, map_location="cpu"))
    axes = {name: {0: free} for name in names}
    given, told = names
    whole = last(network).eval()
    torch.onnx.export(whole, example, arguments.out, opset_version=15, dynamic_axes=axes, input_names=[given], output_names=[told])
