"""Writes a checkpoint as ONNX: `pose` N×100 (see network.py) to `shift` N×66.

    python3 export.py --checkpoint RUN/average.pt --out ../../assets/models/joints.onnx
"""

import sys
from pathlib import Path

import torch

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from common import export
from network import JOINTS, JointNetwork

if __name__ == "__main__":
    export(__doc__, JointNetwork(), torch.zeros(1, 3 * JOINTS + 1), ("pose", "shift"), "people")
