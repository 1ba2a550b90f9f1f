"""Writes a checkpoint as ONNX: `window` N×9×96×64 (0..1, see view.py) to `own` N×96×64, probabilities.

    python3 export.py --checkpoint RUN/average.pt --out ../../assets/models/masks.onnx
"""

import sys
from pathlib import Path

import torch

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from common import Chances, export
from network import CHANNELS, MaskNetwork

if __name__ == "__main__":
    export(__doc__, MaskNetwork(), torch.zeros(1, CHANNELS, 96, 64), ("window", "own"), "people", Chances)
