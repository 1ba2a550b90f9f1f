#!/usr/bin/env python3
"""Turn recorded positions (npz with xy, ball, role, team at 50 Hz) into the JSON that `synthesize --trajectories` reads.

    python training/convert_trajectories.py RECORDING.npz --from 20 --to 32 --out target/trajectories.json

The recording's pitch frame is x along the touchline, y across, z up; the main camera's side is given by --near.
A build input of the demo clip only: neither recording nor JSON is part of the project.
"""

import argparse
import json
from pathlib import Path

import numpy as np


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--from", dest="start", type=float, default=0.0, help="seconds")
    parser.add_argument("--to", dest="end", type=float, required=True, help="seconds")
    parser.add_argument("--near", choices=["-y", "+y"], default="-y", help="which touchline the camera stands on")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    data = np.load(options.recording)
    rate, sign = 50.0, -1.0 if options.near == "-y" else 1.0
    # Seen from +y the recording is mirrored in both axes: a half turn keeps it right-handed.
    turn = np.array([1.0, -1.0]) if sign < 0 else np.array([-1.0, 1.0])
    times = np.arange(int(options.start * rate), int(options.end * rate) + 1)
    times = times[times < len(data["xy"])]
    ball = data["ball"]
    moments = times / rate
    track = np.stack([np.interp(moments, ball[:, 0], ball[:, k]) for k in (1, 2, 3)], 1)
    kinds = {"Goalkeeper": "goalkeeper", "Referee": "referee"}
    teams = sorted({name for name, _ in data["team"] if name != "ref"})
    people = []
    for index, (role, (team, number)) in enumerate(zip(data["role"], data["team"])):
        kind = "assistant" if str(role).startswith("Assistant") else kinds.get(str(role), "player")
        xz = data["xy"][times, index] * turn
        people.append({
            "role": kind,
            "team": teams.index(team) if team in teams else None,
            "number": int(number) if team in teams else None,
            "xz": np.round(xz, 3).tolist(),
        })  # fmt: skip
    xyz = np.stack([track[:, 0] * turn[0], track[:, 2], track[:, 1] * turn[1]], 1)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps({"rate_hz": rate, "people": people, "ball": np.round(xyz, 3).tolist()}))
    print(f"{options.out}: {len(people)} people, {len(times)} samples")


if __name__ == "__main__":
    main()
