"""What many looks at one person add up to on rendered people, with true identities: as `reconstructor/src/numbers/decide.rs`, without its last
step (a number once in a team).

    python3 evaluate.py --model ../../assets/models/numbers.onnx --data PREPARED
"""

import argparse
from pathlib import Path

import numpy as np
import onnxruntime

from view import CELLS

# As decide.rs.
ALIKE, COMMON, COMMON_WEIGHT, PROBABILITY_MIN = 0.25, 30, 3.0, 1e-4
LIMITS = (0.5, 0.8, 0.9, 0.95, 0.98, 0.99)
HEIGHTS = [(30, 60), (60, 80), (80, 110), (110, 400)]


def likeliest(tens, units, legible):
    """Of the looks at one person (N rows each): the number and its probability."""
    numbers = np.arange(1, 100)
    likelihood = legible * tens[:, numbers // 10] * units[:, numbers % 10] * 100 + 1 - legible
    weight = 1 / (1 + ALIKE * max(legible.sum() - 1, 0))
    evidence = weight * np.log(np.maximum(likelihood, PROBABILITY_MIN)).sum(0) + np.where(numbers <= COMMON, np.log(COMMON_WEIGHT), 0)
    chance = np.exp(evidence - evidence.max())
    return numbers[chance.argmax()], 1 / chance.sum()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", required=True)
    parser.add_argument("--data", required=True)
    arguments = parser.parse_args()
    session = onnxruntime.InferenceSession(arguments.model, providers=["CPUExecutionProvider"])
    people = []
    for path in sorted(Path(arguments.data).glob("*.npz")):
        clip = np.load(path)
        first = (clip["x"].shape[1] - CELLS) // 2
        x = clip["x"][:, first : first + CELLS, first : first + CELLS].transpose(0, 3, 1, 2).astype(np.float32) / 255
        tens, units, legible = session.run(None, {"patch": x})
        for person in np.unique(clip["who"][clip["who"] >= 0]):
            mine = clip["who"] == person
            number, chance = likeliest(tens[mine], units[mine], legible[mine])
            people.append((path.stem, int(person), int(clip["wears"][mine][0]), int(number), chance, mine.sum(), np.median(clip["height"][mine])))
    for row in sorted(people, key=lambda row: -row[4]):
        print("{} person {}: wears {}, read {} with {:.3f} in {} looks at {:.0f} px".format(*row))
    for limit in LIMITS:
        given = [row for row in people if row[4] >= limit]
        right = sum(row[2] == row[3] for row in given)
        print(f"limit {limit}: {len(given)} given, {right} right; {sum(row[2] > 0 for row in people)} people with a number")
        for low, high in HEIGHTS:
            here = [row for row in people if low <= row[6] < high and row[2] > 0]
            print(f"    {low}..{high} px: {sum(row[4] >= limit and row[2] == row[3] for row in here)} of {len(here)}")


if __name__ == "__main__":
    main()
