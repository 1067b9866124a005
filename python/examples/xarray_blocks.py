"""Matches one georeferenced pair in blocks, as a lazy xarray.DataArray, and writes its map as Zarr or as a cloud-optimized GeoTIFF.

    python xarray_blocks.py left.tif right.tif map.tif --max-disparity 75 --memory 1GiB

Needs xarray, rioxarray and dask, and zarr for a map.zarr. The map has the coordinates and the reference system of the left image, and NaN
where the disparity is unknown. No-data of the images is heeded.
"""

import argparse
from pathlib import Path

import dask
import dask.array
import numpy as np
import rasterio.shutil
import rioxarray
import xarray

import mrfgs


def disparity(left, right, max_disparity=None, **arguments):
    """The disparities of a pair in files, in pixels. Each chunk is a block, which is matched when it is needed."""
    blocks = mrfgs.Blocks(left, right, max_disparity, **arguments)

    @dask.delayed(pure=True)
    def match(i):
        found = blocks.match(i).disparity
        return np.where(np.isfinite(found), found, np.float32(np.nan))

    rows = {}
    for i in range(len(blocks)):
        _, y, width, height = blocks.part(i)
        rows.setdefault(y, []).append(dask.array.from_delayed(match(i), (height, width), np.float32))
    values = dask.array.concatenate([dask.array.concatenate(rows[y], axis=1) for y in sorted(rows)])
    with rioxarray.open_rasterio(left) as image:
        found = xarray.DataArray(values, {axis: image[axis] for axis in ("y", "x")}, ("y", "x"), "disparity", {"units": "pixels"})
        if image.rio.crs:
            found = found.rio.write_crs(image.rio.crs)
        return found.rio.write_transform(image.rio.transform()).rio.write_nodata(np.nan, encoded=False)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name in ("left", "right", "output"):
        parser.add_argument(name)
    parser.add_argument("--max-disparity", type=int, help="pixels; found in a smaller copy of the pair if not given")
    parser.add_argument("--method", default="default")
    parser.add_argument("--memory", default="4GiB", help="of each match")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, help="of each match")
    args = parser.parse_args()

    found = disparity(args.left, args.right, args.max_disparity, method=args.method, memory=args.memory, device=args.device,
                      threads=args.threads)
    # Matches of one process take turns, so one worker will do.
    with dask.config.set(scheduler="single-threaded"):
        if args.output.endswith(".zarr"):
            # All chunks of Zarr have one size.
            found.chunk(1024).to_dataset().to_zarr(args.output, mode="w")
        else:
            plain = Path(args.output).with_suffix(".part.tif")
            found.rio.to_raster(plain, windowed=True, tiled=True, BIGTIFF="IF_SAFER")
            # Overviews take the nearest pixel: the mean of two surfaces is on neither.
            rasterio.shutil.copy(plain, args.output, driver="COG", compress="deflate", predictor=3, overview_resampling="nearest",
                                 BIGTIFF="IF_SAFER")
            plain.unlink()
    print(f"{found.sizes['x']} x {found.sizes['y']} pixels, {found.data.npartitions} blocks")


if __name__ == "__main__":
    main()
