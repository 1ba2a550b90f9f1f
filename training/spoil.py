"""What no two broadcasts share, drawn at random, on pictures rows×columns×3 of 0..255 that may leave that range on the way.

The order of the draws is part of it: a seed stands for the same pictures only as long as nobody changes it.
"""

import cv2
import numpy as np


def refocus(view, rng, share, widest):
    """Blurs or sharpens a `share` of the pictures, with a radius of up to `widest` pixels."""
    if rng.random() < share:
        sigma = rng.uniform(0.3, widest)
        blurred = cv2.GaussianBlur(view, (0, 0), sigma)
        view = blurred if rng.random() < 0.5 else view + (view - blurred) * rng.uniform(0.3, 1.5)
    return view


def recolour(view, rng):
    """Exposure, white balance, saturation and contrast."""
    gain = rng.uniform(0.65, 1.35) * rng.uniform(0.88, 1.12, 3)
    grey = view.mean(2, keepdims=True)
    view = (grey + (view - grey) * rng.uniform(0.5, 1.4)) * gain.astype(np.float32) + rng.uniform(-25.0, 25.0)
    if rng.random() < 0.5:
        view = np.clip(view, 0, 255) ** rng.uniform(0.8, 1.25)
        view *= 255.0 / max(view.max(), 1.0) * rng.uniform(0.8, 1.0)
    return view


def shade(view, rng):
    """Now and then a shadow of the stand over part of the pitch."""
    if rng.random() < 0.3:
        x, y = np.meshgrid(np.linspace(-1, 1, view.shape[1]), np.linspace(-1, 1, view.shape[0]))
        angle = rng.uniform(0, 2 * np.pi)
        side = x * np.cos(angle) + y * np.sin(angle) > rng.uniform(-0.6, 0.6)
        view = view * np.where(side, rng.uniform(0.45, 0.8), 1.0)[..., None]
    return view


def add_noise(view, rng, strongest):
    """Noise on half of the pictures, of a deviation of up to `strongest`."""
    if rng.random() < 0.5:
        view = view + rng.standard_normal(view.shape, np.float32) * rng.uniform(1.0, strongest)
    return view
