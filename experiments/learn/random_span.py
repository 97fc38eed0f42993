"""The control of the study: 18 random combinations of the span that `learned` was trained in, hermite[degree=6] in three dimensions (83 functions).

    python3 experiments/learn/random_span.py experiments/learn/random-span-3.safetensors

Standard normal entries of a fixed seed; the matrix is the same on every machine (Python's generator and its normal draws are stated to be).
"""

import pathlib
import random
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "examples"))

from write_weights import write

FEATURES, BASIS = 18, 83

if __name__ == "__main__":
    generator = random.Random(1)
    matrix = [generator.gauss(0.0, 1.0) for _ in range(FEATURES * BASIS)]
    notes = {"kind": "linear", "dim": "3", "basis": "hermite[degree=6]", "seed": "1", "data": "none: not trained"}
    write(sys.argv[1], notes, {"matrix": ([FEATURES, BASIS], matrix)})
