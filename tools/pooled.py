"""Print a pooled table of an experiment's results: python pooled.py DIR --by PARAMETER,... (pooled over all others).

One line for each method and combination: trials, successes with their 95 % Wilson interval, median of `error`, median number of
evaluations of the residual. The tables of docs/arena.md are made by it.
"""

import argparse
import collections
import json
import math
import pathlib
import statistics


def wilson(successes, trials):
    z = 1.959963984540054
    p, z2 = successes / trials, z * z
    centre, half = p + z2 / (2 * trials), z * math.sqrt(p * (1 - p) / trials + z2 / (4 * trials * trials))
    return [100 * (centre + sign * half) / (1 + z2 / trials) for sign in (-1, 1)]


def pivot(groups, across):
    """Print methods down and values of parameters across."""
    table = collections.defaultdict(list)
    for (_, method), records in groups.items():
        for record in records:
            parameters = {"scenario": record["scenario"], **record["parameters"]}
            cell = " ".join(str(parameters[name]) for name in across if name in parameters)
            table[method, cell].append(record)
    methods, cells = list(dict.fromkeys(m for m, _ in table)), list(dict.fromkeys(c for _, c in table))
    print("| method | " + " | ".join(cells) + " |")
    print("| ---: |" + " ---: |" * len(cells))
    for method in methods:
        texts = []
        for cell in cells:
            records = table[method, cell]
            evaluations = statistics.median(record["evaluations"] for record in records)
            texts.append(f"{sum(record['success'] for record in records)} of {len(records)} ({evaluations:.0f})")
        print(f"| {method} | " + " | ".join(texts) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--by", default="", help="parameters that make rows, comma separated; `scenario` is one of them")
    parser.add_argument("--across", default="", help="parameters that make columns instead: successes of trials, median evaluations")
    parser.add_argument("--seconds", action="store_true", help="median seconds too: they depend on the machine")
    args = parser.parse_args()
    names = [name for name in args.by.split(",") if name]
    groups = collections.defaultdict(list)
    for file in sorted(args.folder.glob("trials*.jsonl")):
        for line in file.read_text().splitlines():
            record = json.loads(line)
            parameters = {"scenario": record["scenario"], **record["parameters"]}
            cell = tuple(str(parameters.get(name, "")) for name in names)
            groups[cell, record["method"]].append(record)
    across = [name for name in args.across.split(",") if name]
    if across:
        return pivot(groups, across)
    header = [*names, "method", "trials", "success %", "95 % interval", "median error", "median evaluations"]
    header += ["wrong but good"] + (["median s"] if args.seconds else [])
    print("| " + " | ".join(header) + " |")
    print("|" + " ---: |" * len(header))
    for (cell, method), records in groups.items():
        successes = sum(record["success"] for record in records)
        low, high = wilson(successes, len(records))
        error = statistics.median(r["error"] if r["error"] is not None else math.inf for r in records)
        evaluations = statistics.median(record["evaluations"] for record in records)
        wrong = sum(r["verdict"] == "good" and not (r["success"] and r.get("determined", True)) for r in records)
        cells = [*cell, method, str(len(records)), f"{100 * successes / len(records):.1f}", f"{low:.1f}..{high:.1f}"]
        cells += ["-" if math.isinf(error) else f"{error:.2g}", f"{evaluations:.0f}", str(wrong)]
        if args.seconds:
            cells.append(f"{statistics.median(record['seconds'] for record in records):.3g}")
        print("| " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
