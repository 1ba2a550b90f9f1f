"""Writes a checkpoint as ONNX: `picture` N×3×288×512 (RGB 0..1) to `maps` N×66×72×128, probabilities.

    python3 export.py --checkpoint RUN/average.pt --out ../../assets/models/pitch.onnx
"""

import sys
from pathlib import Path

import torch

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from common import Chances, export
from dataset import HEIGHT, WIDTH
from network import PitchNetwork

if __name__ == "__main__":
    export(__doc__, PitchNetwork(), torch.zeros(1, 3, HEIGHT, WIDTH), ("picture", "maps"), "pictures", Chances)
