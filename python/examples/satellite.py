"""Turns two satellite images with RPCs into a surface model: a GeoTIFF of heights and their expected errors, in metres.

    python satellite.py left.tif right.tif surface.tif --folder job --resolution 0.5 --workers 2

Needs rasterio, which evaluates the RPCs. Over a tile of an image, a satellite is almost an affine camera, so two affine maps rectify the tile.
Each tile is matched and triangulated, and its points are put into the folder. Tiles that are there are not matched again, so a run that was
killed can go on. Heights are those of the RPCs, above the ellipsoid.
"""

import argparse
import itertools
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rasterio
from affine import Affine
from rasterio.transform import RPCTransformer
from rasterio.warp import Resampling, reproject, transform
from rasterio.windows import Window

import mrfgs

# Along each side, the cells of a terrain model below a tile, and the pixels of a view for each disparity that is computed from them.
TERRAIN_CELLS = 256
TERRAIN_STEP = 8
# Powers of the terms of a polynomial of degree 3 in three variables.
POWERS = [powers for powers in itertools.product(range(4), repeat=3) if sum(powers) <= 3]


class Scene(NamedTuple):
    """Two images, and the coordinate system of the model."""

    left: str
    right: str
    crs: str

    def samples(self, window, heights):
        """Points of a window of the left image, at several heights: where the left and the right image show them, in pixels from the corner
        of an image, and where they are, in metres (east, north, height). Three arrays with a row for each point."""
        x0, y0, x1, y1 = window
        axes = np.linspace(x0, x1, 9), np.linspace(y0, y1, 9), np.linspace(*heights, 7)
        x, y, height = (axis.ravel() for axis in np.meshgrid(*axes, indexing="ij"))
        precise = {"RPC_PIXEL_ERROR_THRESHOLD": 1e-4, "RPC_MAX_ITERATIONS": 50}
        with rasterio.open(self.left) as left, rasterio.open(self.right) as right:
            with RPCTransformer(left.rpcs, **precise) as rays, RPCTransformer(right.rpcs, **precise) as camera:
                longitude, latitude = rays.xy(y, x, height, offset="ul")
                rows, columns = camera.rowcol(longitude, latitude, height, op=np.asarray)
        east, north = transform("EPSG:4326", self.crs, longitude, latitude)
        return np.stack([x, y], 1), np.stack([columns, rows], 1), np.stack([east, north, height], 1)


class Cubic:
    """A polynomial of degree 3 in three variables, fitted to samples. Over a tile it follows the RPCs within millimetres."""

    def __init__(self, arguments, values):
        self.middle, self.half = arguments.mean(axis=0), np.ptp(arguments, axis=0) / 2
        self.coefficients = np.linalg.lstsq(self.terms(arguments), values, rcond=None)[0]

    def terms(self, arguments):
        x, y, z = ((arguments - self.middle) / self.half).T
        return np.stack([x**i * y**j * z**k for i, j, k in POWERS], axis=1)

    def __call__(self, *arguments):
        return (self.terms(np.stack(arguments, axis=1)) @ self.coefficients).T


class Views:
    """A window of the left image, and what the right one shows of it, rectified. Points of one row are on the same row of the other view.
    Ground at the middle of the heights has disparities near 0, and higher ground has larger ones."""

    def __init__(self, scene, window, heights, scale=1.0, lower=0.0):
        """The window is (x0, y0, x1, y1) in pixels. A pixel becomes `scale` pixels. The right view lies `lower` rows too low."""
        self.scene = scene
        left, right, ground = scene.samples(window, heights)
        maps = rectifying(left, right, ground[:, 2], scale)
        points = [moved(map, image) for map, image in zip(maps, (left, right))]
        disparity = points[0][:, 0] - points[1][:, 0]
        self.range = float(disparity.min()), float(disparity.max())
        self.metres = np.polyfit(disparity, ground[:, 2], 1)[0]
        # Both views hold what either of them shows of the window.
        corners = moved(maps[0], np.array(list(itertools.product(window[::2], window[1::2]))))
        start = np.floor(corners.min(axis=0) - (max(self.range[1], 0), 0))
        end = np.ceil(corners.max(axis=0) - (min(self.range[0], 0), 0))
        self.size = tuple(int(length) for length in end - start)
        self.maps = [Affine.translation(*-start - (0, below)) * map for map, below in zip(maps, (0, lower))]
        x, y = (points[0] - start).T
        # A match to its place on the ground, and a height along a ray to its place and disparity.
        self.ground = Cubic(np.stack([x, y, disparity], 1), ground)
        self.ray = Cubic(np.stack([x, y, ground[:, 2]], 1), np.column_stack([ground[:, :2], disparity]))

    def view(self, index):
        """The left view, 0, or the right one, 1: a masked array of 16 bits."""
        width, height = self.size
        corners = moved(~self.maps[index], np.array(list(itertools.product((0, width), (0, height)))))
        with rasterio.open((self.scene.left, self.scene.right)[index]) as image:
            x0, y0 = np.maximum(np.floor(corners.min(axis=0)) - 4, 0)
            x1, y1 = np.minimum(np.ceil(corners.max(axis=0)) + 4, image.shape[::-1])
            if x0 >= x1 or y0 >= y1:
                return np.ma.masked_all((height, width), np.uint16)
            source = image.read(1, window=Window(x0, y0, x1 - x0, y1 - y0), masked=True).astype(np.float32).filled(np.nan)
        view = resampled(source, Affine.translation(x0, y0), self.size, ~self.maps[index], Resampling.cubic)
        gone = np.isnan(view)
        return np.ma.masked_array(np.where(gone, 0, view).clip(0, 65535).round().astype(np.uint16), gone)


def rectifying(left, right, height, scale):
    """The affine maps that rectify two images, from points that they share (Hartley and Zisserman, section 14.3)."""
    both = np.hstack([left, right])
    middle = both.mean(axis=0)
    # All points meet a x + b y + c x' + d y' = 0. The first two terms are the row in the left view, the others that in the right one.
    a, b, c, d = np.linalg.svd(both - middle, full_matrices=False)[2][-1]
    norm = np.sqrt(np.hypot(a, b) * np.hypot(c, d)) / scale
    normals = np.array([[a, b], [-c, -d]]) / norm
    maps = [Affine(q, -p, 0, p, q, 0) * Affine.translation(*-centre) for (p, q), centre in zip(normals, middle.reshape(2, 2))]
    x = [moved(map, image)[:, 0] for map, image in zip(maps, (left, right))]
    if np.corrcoef(x[0] - x[1], height)[0, 1] < 0:
        maps = [Affine.scale(-1) * map for map in maps]
    # A shear and a stretch of the right view give a plane at the middle height the disparity 0.
    plane = np.isclose(height, np.median(height))
    left, right = (moved(map, image[plane]) for map, image in zip(maps, (left, right)))
    shear = np.linalg.lstsq(np.column_stack([right, np.ones(len(right))]), left[:, 0], rcond=None)[0]
    return [maps[0], Affine(*shear, 0, 1, 0) * maps[1]]


def moved(map, points):
    """Points, of shape (n, 2), moved by an affine map."""
    return np.stack(map * points.T, axis=1)


def resampled(source, source_map, size, map, resampling):
    """Resamples an array of floats, NaN where nothing is known. Both maps lead from pixels to common coordinates."""
    found = np.full(size[::-1], np.nan, np.float32)
    # The coordinates are those of an image, so any system will do that both arrays share.
    reproject(source, found, src_transform=source_map, dst_transform=map, src_crs="EPSG:3857", dst_crs="EPSG:3857", src_nodata=np.nan,
              dst_nodata=np.nan, resampling=resampling)
    return found


class Terrain(NamedTuple):
    """A coarse model of the ground, above the ellipsoid: a file that GDAL reads, and its expected error in metres."""

    path: str
    sigma: float

    def part(self, scene, window, heights):
        """The heights below a window of the left image, NaN where they are unknown, and the map from metres to their cells."""
        west, south, _ = (ground := scene.samples(window, heights)[2]).min(axis=0)
        east, north, _ = ground.max(axis=0)
        map = Affine.translation(west, north) * Affine.scale((east - west) / TERRAIN_CELLS, (south - north) / TERRAIN_CELLS)
        with rasterio.open(self.path) as file:
            found = np.full((TERRAIN_CELLS, TERRAIN_CELLS), np.nan, np.float32)
            reproject(rasterio.band(file, 1), found, dst_transform=map, dst_crs=scene.crs, dst_nodata=np.nan, init_dest_nodata=True,
                      resampling=Resampling.bilinear)
        return found, ~map

    def range(self, part, heights):
        """The heights that a part may show, with a margin of four expected errors."""
        if np.isnan(part).all():
            return heights
        margin = 4 * self.sigma
        return max(heights[0], np.nanmin(part) - margin), min(heights[1], np.nanmax(part) + margin)

    def prior(self, views, part, to_cells):
        """What is known of the left view, as arguments of `match`."""
        size = tuple(length // TERRAIN_STEP + 2 for length in views.size)
        x, y = (axis.ravel() for axis in np.meshgrid(*((np.arange(length) + 0.5) * TERRAIN_STEP for length in size)))
        there = np.full(len(x), np.nanmean(part))
        # Go to the height that the model has where the ray is, until both are the same.
        for _ in range(6):
            east, north, disparity = views.ray(x, y, np.where(np.isnan(there), np.nanmean(part), there))
            column, row = (axis.clip(0, TERRAIN_CELLS - 1).astype(int) for axis in to_cells * (east, north))
            there = part[row, column]
        known = np.where(np.isnan(there), np.nan, disparity).astype(np.float32).reshape(size[::-1])
        known = resampled(known, Affine.scale(TERRAIN_STEP), views.size, Affine.identity(), Resampling.bilinear)
        return {"prior": known, "prior_sigma": max(self.sigma / abs(views.metres), 0.5), "prior_kind": "surface"}


def match(views, matcher, **options):
    """Both views and the maps of the left one. None if a view shows less than 1 %."""
    pair = views.view(0), views.view(1)
    if min(view.count() / view.size for view in pair) < 0.01:
        return None
    low, high = views.range
    return *pair, matcher.match(*pair, np.ceil(high), min_disparity=np.floor(low), warn=False, **options)


def look(scene, matcher, heights):
    """Matches a small copy of the pair. Returns the range of heights with a margin, and by how many rows the right view lies too low."""
    with rasterio.open(scene.left) as image:
        window = 0, 0, *image.shape[::-1]
    scale = min(0.25, 1000 / max(window))
    views = Views(scene, window, heights, scale)
    left, right, found = match(views, matcher) or (None, None, None)
    if found is None or not (found.validity == 0).any():
        raise SystemExit("satellite: the images show no common ground at these heights; give others with --heights")
    y, x = np.nonzero(found.validity == 0)
    disparity = found.disparity[y, x]
    low, high = np.percentile(views.ground(x + 0.5, y + 0.5, disparity)[2], (0.5, 99.5))
    margin = max(20, (high - low) / 5)
    # How much the views differ, by the distance of their rows.
    rows = np.arange(-5, 6)
    differences = []
    for row in rows:
        there = np.clip(y + row, 0, right.shape[0] - 1), np.clip(np.rint(x - disparity).astype(int), 0, right.shape[1] - 1)
        differences.append(np.ma.mean(np.abs(left[y, x].astype(np.float32) - right[there])))
    best = int(np.argmin(differences[1:-1])) + 1
    before, at, after = differences[best - 1:best + 2]
    lower = rows[best] + (before - after) / (2 * (before - 2 * at + after))
    return (low - margin, high + margin), float(lower / scale)


class Job(NamedTuple):
    """What all tiles have in common; it can be pickled."""

    scene: Scene
    matcher: mrfgs.Matcher
    method: str
    memory: str
    heights: tuple
    lower: float
    terrain: Terrain | None
    folder: Path

    def claim(self, side):
        """Keeps the folder for this job: what is there must be of the same images and parameters."""
        own = repr(self._replace(matcher=None, folder=None)) + f" in tiles of {side} pixels, mrfgs {mrfgs.__version__}\n"
        self.folder.mkdir(exist_ok=True)
        record = self.folder / "job.txt"
        if record.exists() and record.read_text() != own:
            raise SystemExit(f"satellite: {self.folder} holds the points of other images or parameters; give another --folder, or remove it")
        record.write_text(own)

    def tile(self, window):
        """Puts the points of a tile into the folder, if they are not there: east, north, height and expected error of the height."""
        path = self.folder / f"points-{'-'.join(str(edge) for edge in window)}.npy"
        if not path.exists():
            part = path.with_suffix(f".{os.getpid()}.part")
            with open(part, "wb") as file:
                np.save(file, self.points(window))
            part.rename(path)
        return path

    def points(self, window):
        margin = 32
        around = window[0] - margin, window[1] - margin, window[2] + margin, window[3] + margin
        heights, known = self.heights, {}
        if self.terrain:
            part, to_cells = self.terrain.part(self.scene, around, heights)
            heights = self.terrain.range(part, heights)
        views = Views(self.scene, around, heights, lower=self.lower)
        if self.terrain and not np.isnan(part).all():
            known = self.terrain.prior(views, part, to_cells)
        found = match(views, self.matcher, method=self.method, memory=self.memory, **known)
        if found is None:
            return np.empty((0, 4))
        found = found[-1]
        y, x = np.nonzero(found.validity == 0)
        place = moved(~views.maps[0], np.stack([x, y], 1) + 0.5)
        own = ((place >= window[:2]) & (place < window[2:])).all(axis=1)
        y, x = y[own], x[own]
        ground = views.ground(x + 0.5, y + 0.5, found.disparity[y, x])
        return np.column_stack([*ground, found.sigma[y, x] * abs(views.metres)])


def write(paths, output, resolution, crs):
    """Writes the surface model: in each cell the mean of its points, weighted by their expected errors."""
    east, north, height, sigma = np.concatenate([np.load(path) for path in paths]).T
    if not len(east):
        raise SystemExit("satellite: no point was found")
    west, top = np.floor(east.min() / resolution) * resolution, np.ceil(north.max() / resolution) * resolution
    column, row = ((east - west) / resolution).astype(int), ((top - north) / resolution).astype(int)
    shape = row.max() + 1, column.max() + 1
    cell, weight = row * shape[1] + column, 1 / np.maximum(sigma, 1e-3)**2

    def total(values):
        return np.bincount(cell, values, shape[0] * shape[1]).reshape(shape)

    with np.errstate(invalid="ignore", divide="ignore"):
        # Errors of neighbouring points are alike, so their mean has the error of one.
        bands = np.stack([total(weight * height) / total(weight), np.sqrt(total(np.ones(len(cell))) / total(weight))]).astype(np.float32)
    profile = {"driver": "COG", "dtype": "float32", "count": 2, "height": shape[0], "width": shape[1], "crs": crs, "nodata": np.nan,
               "transform": Affine(resolution, 0, west, 0, -resolution, top), "compress": "deflate", "predictor": 3}
    part = Path(output).with_suffix(".part.tif")
    with rasterio.open(part, "w", **profile) as file:
        file.write(bands)
        file.descriptions = "height, metres above the ellipsoid", "expected error, metres"
    part.rename(output)
    return shape, len(cell)


def interval(text):
    low, high = (float(word) for word in text.split(","))
    if not low < high:
        raise ValueError(text)
    return low, high


def utm(longitude, latitude):
    return f"EPSG:{32600 + 100 * (latitude < 0) + int((longitude + 180) // 6) + 1}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for name in ("left", "right", "output"):
        parser.add_argument(name)
    parser.add_argument("--folder", type=Path, required=True, help="the points of the tiles")
    parser.add_argument("--heights", type=interval, metavar="LOW,HIGH", help="in metres; found in a small copy of the pair if not given")
    parser.add_argument("--terrain", help="a coarse model of the ground, above the ellipsoid")
    parser.add_argument("--terrain-sigma", type=float, default=10, help="its expected error in metres")
    parser.add_argument("--resolution", type=float, default=0.5, help="of the model, in metres")
    parser.add_argument("--tile", type=int, default=1000, help="pixels")
    parser.add_argument("--method", default="default")
    parser.add_argument("--memory", default="4GiB", help="of each match")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=1, help="of each match")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    args = parser.parse_args()

    with rasterio.open(args.left) as left, rasterio.open(args.right) as right:
        for path, image in ((args.left, left), (args.right, right)):
            if not image.rpcs:
                raise SystemExit(f"satellite: {path} has no RPCs")
        width, height = left.width, left.height
        rpcs = left.rpcs
    scene = Scene(args.left, args.right, utm(rpcs.long_off, rpcs.lat_off))
    matcher = mrfgs.Matcher(device=args.device, threads=args.threads)
    found, lower = look(scene, matcher, args.heights or (rpcs.height_off - rpcs.height_scale, rpcs.height_off + rpcs.height_scale))
    heights = args.heights or found
    print(f"heights from {heights[0]:.0f} to {heights[1]:.0f} m; the rectified views are {abs(lower):.1f} rows apart", flush=True)

    terrain = Terrain(args.terrain, args.terrain_sigma) if args.terrain else None
    job = Job(scene, matcher, args.method, args.memory, heights, lower, terrain, args.folder)
    job.claim(args.tile)
    windows = [(x, y, min(x + args.tile, width), min(y + args.tile, height))
               for y in range(0, height, args.tile) for x in range(0, width, args.tile)]
    with ProcessPoolExecutor(args.workers, get_context("spawn")) as workers:
        paths = list(workers.map(job.tile, windows))
    (rows, columns), count = write(paths, args.output, args.resolution, scene.crs)
    print(f"{len(paths)} tiles, {count} points, {columns} x {rows} cells in {scene.crs}")


if __name__ == "__main__":
    main()
