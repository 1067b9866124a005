"""Matches one large pair in blocks on Dask, and writes its map as a NumPy array (float32, pixels, +inf if unknown).

    python dask_blocks.py left.tif right.tif map.npy --max-disparity 75 --memory 1GiB --workers 4 --threads 2

With --scheduler ADDRESS it uses the workers of a cluster, which see the images under the same paths.
"""

import argparse
import contextlib

import numpy as np
from dask.distributed import Client, LocalCluster, as_completed

import mrfgs


def main():
    parser = argparse.ArgumentParser()
    for name in ("left", "right", "output"):
        parser.add_argument(name)
    parser.add_argument("--max-disparity", type=int, help="pixels; found in a smaller copy of the pair if not given")
    parser.add_argument("--method", default="default")
    parser.add_argument("--memory", default="4GiB", help="of each match")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1, help="of each match")
    parser.add_argument("--workers", type=int, default=2, help="processes of this machine")
    parser.add_argument("--scheduler", help="address of the scheduler of a cluster")
    args = parser.parse_args()

    blocks = mrfgs.Blocks(args.left, args.right, args.max_disparity, method=args.method, memory=args.memory, device=args.device,
                          threads=args.threads)

    def match(i):
        return i, blocks.match(i).disparity

    width, height = blocks.size
    disparity = np.lib.format.open_memmap(args.output, "w+", np.float32, (height, width))
    with cluster(args) as address, Client(address) as client:
        # Each part is written as soon as it is there, and then forgotten.
        for _, (i, part) in as_completed(client.map(match, range(len(blocks)), pure=False), with_results=True):
            x, y, columns, rows = blocks.part(i)
            disparity[y:y + rows, x:x + columns] = part
    disparity.flush()
    print(f"{width} x {height} pixels, {len(blocks)} blocks")


def cluster(args):
    """The workers: a context that gives what a Client takes."""
    if args.scheduler:
        return contextlib.nullcontext(args.scheduler)
    # One match at a time in each process; mrfgs has threads of its own.
    return LocalCluster(n_workers=args.workers, threads_per_worker=1, dashboard_address=None)


if __name__ == "__main__":
    main()
