"""What both trainings share: the course of the learning rate, and the running average of the weights."""

import math

import torch


def rate_at(highest, part, step, warm_up):
    """Learning rate after `step` steps and a share `part` of the time: rises over `warm_up` steps, then falls as a cosine to a hundredth."""
    return highest * min(1.0, (step + 1) / warm_up) * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * part)))


@torch.no_grad()
def average_in(average, network, step, keep):
    """Moves the averaged weights towards the network's, by 1 − `keep` and by more in the first steps."""
    keep = min(keep, step / (step + 20))
    for mean, value in zip(average.state_dict().values(), network.state_dict().values()):
        if mean.dtype.is_floating_point:
            mean.lerp_(value, 1 - keep)
        else:
            mean.copy_(value)
