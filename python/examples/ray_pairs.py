"""Matches a list of pairs on Ray, and writes each map as a NumPy array, NAME.npy (float32, pixels, +inf if unknown).

    python ray_pairs.py pairs.csv maps --threads 2

The list has columns name, left and right, as for `mrfgs batch`; relative paths start at its folder. A pair that fails is named, and the
others continue. The workers see the images and the folder of the maps under the same paths.
"""

import argparse
import csv
import sys
from pathlib import Path

import numpy as np
import ray

import mrfgs


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("list", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--max-disparity", type=int, help="pixels; found in each pair if not given")
    parser.add_argument("--method", default="default")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1, help="of each match")
    parser.add_argument("--pairs-per-task", type=int, default=8)
    args = parser.parse_args()

    with open(args.list, newline="") as file:
        rows = [(row["name"], *(str(args.list.resolve().parent / row[view]) for view in ("left", "right"))) for row in csv.DictReader(file)]
    folder = args.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    # Each process opens the device once, however many tasks it gets.
    matcher = mrfgs.Matcher(device=args.device, threads=args.threads)

    @ray.remote(num_cpus=args.threads)
    def match(rows):
        """Writes the maps of these pairs, and returns what went wrong."""
        failures = []
        found = mrfgs.match_many([views for _, *views in rows], args.max_disparity, matcher=matcher, method=args.method)
        for (name, *_), one in zip(rows, found):
            if isinstance(one, Exception):
                failures.append(f"{name}: {one}")
            else:
                np.save(folder / f"{name}.npy", one.disparity)
        return failures

    ray.init(ignore_reinit_error=True, include_dashboard=False)
    tasks = [match.remote(rows[i:i + args.pairs_per_task]) for i in range(0, len(rows), args.pairs_per_task)]
    failures = [failure for failures in ray.get(tasks) for failure in failures]
    print(f"{len(rows) - len(failures)} of {len(rows)} pairs")
    if failures:
        sys.exit("\n".join(failures))


if __name__ == "__main__":
    main()
