"""Run other programs on the point files that `cfpose run --export-data` wrote; write rows for `cfpose run --import-rows`.

    python run.py DATA METHOD... --rows ROWS.jsonl [--limit N]

DATA/trials.jsonl names one trial a line: key, model, theta of the start, files of both point sets, and the truth, which only
methods that are *given* something (matches, a start near the truth) look at; each says so in its docstring. Rows hold theta alone:
cfpose measures it against the truth, so every method is scored by the same rule. A method is one file in methods/ and one line
below.
"""

import argparse
import importlib
import json
import pathlib
import time
import traceback

import numpy as np

# Name in the experiment, module, models that the method can treat.
METHODS = {
    "open3d": ("open3d_fpfh", {"rigid3"}),
    "small-gicp": ("small_gicp_local", {"rigid3"}),
    "kiss-matcher": ("kiss", {"rigid3"}),
    "pycpd": ("cpd", {"rigid3"}),
    "mmd-reg": ("mmd_reg", {"rigid3"}),
    "pnp-given-matches": ("pnp", {"bearing3"}),
    "softposit": ("softposit", {"bearing3"}),
}


class Trial:
    """One trial: source and target as N x D arrays, start and truth as (rotation vector, translation) or None."""

    def __init__(self, folder, line):
        self.key, self.model = line["key"], line["model"]
        self.source = points(folder / line["source"])
        self.target = points(folder / line["target"])
        self.start = None if line["start"] is None else np.array(line["start"])
        self.truth = np.array(line["truth"])
        self.seed = int(line["key"], 16) % 2**31


def points(path):
    """Read a CSV file with or without a header."""
    with open(path) as file:
        first = file.readline().split(",")
    try:
        [float(cell) for cell in first]
        skip = 0
    except ValueError:
        skip = 1
    return np.loadtxt(path, delimiter=",", skiprows=skip, ndmin=2)


def row(name, module, trial):
    """Solve one trial; a failure is a row too."""
    begin = time.perf_counter()
    out = {"key": trial.key, "method": name, "theta": None, "usable": False, "message": None}
    try:
        theta, message = module.solve(trial)
        if theta is not None and np.all(np.isfinite(theta)):
            out |= {"theta": [float(value) for value in theta], "usable": True}
        out["message"] = message
    except Exception as problem:  # a program of others may raise anything
        out["message"] = "".join(traceback.format_exception_only(problem)).strip()
    out["seconds"] = time.perf_counter() - begin
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("methods", nargs="+", choices=sorted(METHODS))
    parser.add_argument("--rows", type=pathlib.Path, required=True)
    parser.add_argument("--limit", type=int, help="trials at most")
    args = parser.parse_args()
    lines = [json.loads(line) for line in (args.data / "trials.jsonl").read_text().splitlines()]
    modules = {name: importlib.import_module(f"methods.{METHODS[name][0]}") for name in args.methods}
    with open(args.rows, "w") as file:
        for line in lines[: args.limit]:
            trial = Trial(args.data, line)
            for name, module in modules.items():
                if trial.model.split("[")[0] in METHODS[name][1]:
                    file.write(json.dumps(row(name, module, trial)) + "\n")
                    file.flush()


if __name__ == "__main__":
    main()
