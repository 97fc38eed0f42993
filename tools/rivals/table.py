"""Print the table of docs/rivals.md from the results of a run: python table.py DIR [--by PARAMETER,...]"""

import argparse
import collections
import json
import pathlib
import statistics


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--by", default="", help="parameters that make rows, comma separated; others are pooled")
    args = parser.parse_args()
    names = [name for name in args.by.split(",") if name]
    groups = collections.defaultdict(list)
    files = [args.folder / "records.jsonl"]
    if not files[0].is_file():
        files = sorted(args.folder.glob("trials*.jsonl"))
    for file in files:
        for line in file.read_text().splitlines():
            record = json.loads(line)
            cell = tuple(str(record["parameters"].get(name, "")) for name in names)
            groups[cell, record["method"]].append(record)
    header = [*names, "method", "trials", "right", "called good", "wrong but called good", "median rot. deg", "median s"]
    print("| " + " | ".join(header) + " |")
    print("|" + " ---: |" * len(header))
    for (cell, method), records in groups.items():
        verdicts = [record["verdict"] for record in records if record["usable"]]
        has = any(verdict is not None for verdict in verdicts)
        right = sum(record["success"] for record in records)
        good = sum(record["verdict"] == "good" for record in records)
        wrong = sum(record["verdict"] == "good" and not record["success"] for record in records)
        angle = statistics.median(r["rotation_deg"] if r["rotation_deg"] is not None else 180.0 for r in records)
        seconds = statistics.median(record["seconds"] for record in records)
        cells = [*cell, method, str(len(records)), str(right)]
        cells += [str(good), str(wrong)] if has else ["no verdict", "no verdict"]
        print("| " + " | ".join([*cells, f"{angle:.2f}", f"{seconds:.2f}"]) + " |")


if __name__ == "__main__":
    main()
