#!/usr/bin/env python3
"""Run the shards of an experiment on Dask, then merge: `cfpose plan EXPERIMENT.toml --shards N --emit dask` writes jobs.json.

    python3 dask_runner.py jobs.json --workers 2                  workers of this machine
    python3 dask_runner.py jobs.json --scheduler tcp://HOST:8786   workers of a scheduler, which see the same folders

Needs Python 3.9 and dask[distributed]. A worker that dies loses nothing but time: its shard is started again elsewhere and goes on where it was.
"""

import argparse
import json
import subprocess
import sys
import time

# Seconds between two attempts at a shard whose killed predecessor may still hold its records.
PAUSE = 2
ATTEMPTS = 30

# Exit code of `cfpose run` when another process writes the same shard.
BUSY = 2


def compute(command):
    """Run one shard and return what it printed; while another process still writes it, wait."""
    for attempt in range(ATTEMPTS):
        done = subprocess.run(command, capture_output=True, text=True, preexec_fn=end_with_parent)
        if done.returncode == 0:
            return done.stdout.strip().splitlines()[-1:]
        if done.returncode != BUSY:
            break
        time.sleep(PAUSE)
    raise RuntimeError(f"exit code {done.returncode} of {' '.join(command)}: {done.stderr.strip()}")


def end_with_parent():
    """Ask Linux to end the shard with the worker that started it; elsewhere the lock of the records keeps order."""
    try:
        import ctypes
        import signal

        ctypes.CDLL(None).prctl(1, signal.SIGTERM)
    except (OSError, AttributeError):
        pass


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("jobs")
    parser.add_argument("--workers", type=int, default=2, help="local worker processes (2)")
    parser.add_argument("--scheduler", help="address of a scheduler instead")
    args = parser.parse_args()
    with open(args.jobs, encoding="utf-8") as file:
        jobs = json.load(file)

    from dask.distributed import Client, LocalCluster, as_completed

    cluster = None if args.scheduler else LocalCluster(n_workers=args.workers, threads_per_worker=1, dashboard_address=None)
    with Client(args.scheduler or cluster) as client:
        # Two shards never share a key; a shard is tried on other workers when its own dies.
        futures = {client.submit(compute, command, key=f"shard-{i}", retries=5, pure=False): i for i, command in enumerate(jobs["shards"])}
        failed = 0
        for future in as_completed(futures):
            index = futures[future]
            if future.status == "finished":
                print(f"shard {index}: {' '.join(future.result())}", flush=True)
            else:
                failed += 1
                print(f"shard {index}: {future.exception()}", file=sys.stderr, flush=True)
    if cluster is not None:
        cluster.close()
    if failed:
        sys.exit(f"{failed} shard(s) failed; run the same command again, what is there stays")
    sys.exit(subprocess.run(jobs["merge"]).returncode)


if __name__ == "__main__":
    main()
