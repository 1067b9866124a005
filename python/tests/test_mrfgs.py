"""Compares the Python package with the command line: the results must be identical. MRFGS is the path of the program."""

import ast
import contextlib
import copy
import functools
import gc
import inspect
import itertools
import json
import multiprocessing
import multiprocessing.pool
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import textwrap
import threading
import time
import unittest
import warnings
import weakref
import zlib
from pathlib import Path

import numpy as np

import mrfgs

PROGRAM = os.environ["MRFGS"]
TESTDATA = Path(__file__).resolve().parents[2] / "testdata"
RAW = TESTDATA / "raw"
CAMERAS = RAW / "cameras.yml"


def pair(height=60, width=80, channels=3, seed=1):
    """A textured pair: disparity 4 in the upper half, 9 in the lower."""
    random = np.random.default_rng(seed)
    left = random.integers(0, 256, (height, width + 16, channels), dtype=np.uint8)
    right = np.empty_like(left)
    for rows, d in ((slice(0, height // 2), 4), (slice(height // 2, height), 9)):
        right[rows] = np.roll(left[rows], -d, axis=1)
    return left[:, 8:-8].copy(), right[:, 8:-8].copy()


def write_ppm(path, image):
    kind, depth = ("P5" if image.ndim == 2 else "P6"), (255 if image.dtype == np.uint8 else 65535)
    height, width = image.shape[:2]
    path.write_bytes(f"{kind}\n{width} {height}\n{depth}\n".encode() + image.astype(image.dtype.newbyteorder(">")).tobytes())


def read_pfm(path):
    with open(path, "rb") as file:
        assert file.readline() == b"Pf\n"
        width, height = map(int, file.readline().split())
        assert float(file.readline()) < 0
        return np.frombuffer(file.read(), "<f4").reshape(height, width)[::-1]


def by_program(left, right, *arguments, file="out.pfm"):
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write_ppm(folder / "left.ppm", left)
        write_ppm(folder / "right.ppm", right)
        subprocess.run([PROGRAM, "match", folder / "left.ppm", folder / "right.ppm", folder / "out.pfm", "--quiet",
                        "--device", "cpu", *arguments], check=True)
        return read_pfm(folder / file)


def read_png(path):
    """Reads the samples of a PNG without a palette, as shape (height, width[, channels])."""
    data, at, packed = Path(path).read_bytes(), 8, b""
    while at < len(data):
        length, kind = int.from_bytes(data[at:at + 4], "big"), data[at + 4:at + 8]
        body = data[at + 8:at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colours = int.from_bytes(body[:4], "big"), int.from_bytes(body[4:8], "big"), body[8], body[9]
            assert depth in (8, 16) and body[12] == 0, body
        elif kind == b"IDAT":
            packed += body
        at += 12 + length
    channels = {0: 1, 2: 3, 4: 2, 6: 4}[colours]
    step = channels * depth // 8
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + width * step)
    above = [0] * (width * step)
    out = []
    for kind, *row in rows.tolist():
        for i in range(len(row)):
            left, up, corner = (row[i - step] if i >= step else 0), above[i], (above[i - step] if i >= step else 0)
            if kind == 4:
                p = left + up - corner
                row[i] += min((abs(p - left), 0, left), (abs(p - up), 1, up), (abs(p - corner), 2, corner))[2]
            else:
                row[i] += (0, left, up, (left + up) // 2)[kind]
            row[i] &= 255
        out.append(row)
        above = row
    samples = np.array(out, np.uint8).view(">u2" if depth == 16 else np.uint8)
    samples = samples.astype(samples.dtype.newbyteorder("=")).reshape(height, width, channels)
    return samples[..., 0] if channels == 1 else samples


def program(folder, *arguments):
    done = subprocess.run([PROGRAM, *map(str, arguments)], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def parameters(thing):
    """The argument names. Python 3.9 has no signatures of classes from extension modules."""
    if isinstance(thing, type) and sys.version_info < (3, 10):
        return []
    return list(inspect.signature(thing).parameters)


def raw_pair():
    return read_png(RAW / "left.png"), read_png(RAW / "right.png")


@functools.lru_cache
def has_device():
    try:
        mrfgs.Matcher(device="gpu")
    except RuntimeError as error:
        assert os.environ.get("MRFGS_REQUIRE_GPU", "0") in ("", "0"), error
        return False
    return True


def ticks_during(call):
    """How often another thread runs during `call`."""
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.002)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.monotonic()
    call()
    end = time.monotonic()
    done.set()
    thread.join()
    return sum(start < t < end for t in ticks)


class Match(unittest.TestCase):
    def same(self, left, right, *arguments, **keywords):
        expected = by_program(left, right, "--max-disparity", "15", *arguments)
        matched = mrfgs.match(left, right, max_disparity=15, device="cpu", **keywords)
        self.assertEqual(matched.disparity.dtype, np.float32)
        self.assertTrue(np.array_equal(matched.disparity, expected))
        return matched

    def test_same_bits_as_the_program(self):
        left, right = pair()
        matched = self.same(left, right)
        for array, dtype in ((matched.raw, np.float32), (matched.confidence, np.uint8), (matched.validity, np.uint8)):
            self.assertEqual((array.shape, array.dtype), (left.shape[:2], dtype))
        self.assertLess(abs(np.median(matched.disparity[:28, 16:]) - 4), 0.1)
        self.assertLess(abs(np.median(matched.disparity[32:, 16:]) - 9), 0.1)
        self.assertIn("CPU", matched.ran_on)
        self.assertEqual((matched.min_disparity, matched.max_disparity, matched.tiles), (0, 15, 1))
        # Control: another pair or another option gives other results.
        self.assertFalse(np.array_equal(matched.disparity, by_program(*pair(seed=2), "--max-disparity", "15")))
        self.assertFalse(np.array_equal(matched.disparity, by_program(left, right, "--max-disparity", "15", "--set", "fill=none")))

    def test_priors(self):
        left, right = pair()
        # The middle rows are plain, and so say nothing of themselves.
        left[20:40], right[20:40] = 128, 128
        known = np.full(left.shape[:2], np.nan, np.float32)
        known[2::6, 2::6] = np.where(np.arange(60) < 30, 4, 9)[2::6, None]
        rows, columns = np.nonzero(np.isfinite(known))
        points = np.column_stack([columns, rows, known[rows, columns]])

        def found(**keywords):
            return mrfgs.match(left, right, 15, device="cpu", warn=False, **keywords)

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "points.csv"
            np.savetxt(path, points, "%g", ",")
            expected = by_program(left, right, "--max-disparity", "15", "--prior", path)
        self.assertTrue(np.array_equal(found(prior=points).disparity, expected))
        self.assertTrue(np.array_equal(found(prior=known).disparity, expected))
        sigmas = np.column_stack([points, np.full(len(points), 0.25)])
        self.assertTrue(np.array_equal(found(prior=sigmas).disparity, expected))
        self.assertLess(np.mean(np.abs(expected[20:40] - np.where(np.arange(20, 40) < 30, 4, 9)[:, None]) > 1), 0.15)
        self.assertIn(16, found(prior=points).validity)
        # Control: without it, or as a surface, the map is another.
        self.assertFalse(np.array_equal(found().disparity, expected))
        self.assertFalse(np.array_equal(found(prior=known, prior_kind="surface", prior_sigma=2).disparity, expected))
        # One that the images contradict is not used, and a warning says so; the right one gives none.
        wrong = np.where(np.isfinite(known), 13 - known, np.nan).astype(np.float32)
        with self.assertWarnsRegex(mrfgs.MatchWarning, "the images contradict the prior, so it was not used"):
            unused = mrfgs.match(left, right, 15, device="cpu", prior=wrong)
        self.assertTrue(np.array_equal(unused.disparity, found().disparity))
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            mrfgs.match(left, right, 15, device="cpu", prior=known)
        self.assertFalse([str(one.message) for one in told if "prior" in str(one.message)])
        for keywords, word in (({"prior": known[:9]}, "shape"), ({"prior_sigma": 1}, "give a prior"), ({"prior": points, "prior_sigma": -1}, "-1 px"),
                               ({"prior": points + 900}, "none of the")):
            with self.assertRaisesRegex(ValueError, word):
                found(**keywords)
        with self.assertRaisesRegex(TypeError, "prior_kind"):
            found(prior=known, prior_kind="dots")

    def test_kinds_of_images(self):
        left, right = pair()
        self.same(left[..., 0].copy(), right[..., 0].copy())
        self.same(left.astype(np.uint16) * 16 + 3, right.astype(np.uint16) * 16 + 3)
        alone = mrfgs.match(left, right, 15, device="cpu").disparity
        # Non-contiguous slices, and an opaque alpha channel.
        wide = np.dstack([left, left])[..., :3]
        self.assertFalse(wide.flags.c_contiguous)
        self.assertTrue(np.array_equal(mrfgs.match(wide, right, 15, device="cpu").disparity, alone))
        opaque = [np.dstack([image, np.full(image.shape[:2], 7, np.uint8)]) for image in (left, right)]
        self.assertTrue(np.array_equal(mrfgs.match(*opaque, 15, device="cpu").disparity, alone))
        grey = [image[..., 0].astype(np.float64) / 255 for image in (left, right)]
        found = mrfgs.match(*grey, 15, device="cpu").disparity
        self.assertLess(abs(np.median(found[32:, 16:]) - 9), 0.1)

    def test_whole_numbers_of_any_type(self):
        def found(left, right):
            return mrfgs.match(left, right, 15, device="cpu", warn=False).disparity

        left, right = pair()
        expected = found(left, right)
        wide = [image.astype(np.uint16) * 13 + 3 for image in (left, right)]
        expected_of_wide = found(*wide)
        # Control: the bit depth of an image matters.
        self.assertFalse(np.array_equal(expected_of_wide, expected))
        for dtype in (np.int16, np.int32, np.int64, np.uint32, np.uint64, ">i4"):
            for images, same in (((left, right), expected), (wide, expected_of_wide)):
                others = [image.astype(dtype) for image in images]
                for one, two in (others, (images[0], others[1]), (others[0], images[1])):
                    self.assertTrue(np.array_equal(found(one, two), same), dtype)
        self.assertTrue(np.array_equal(found((left // 2).astype(np.int8), (right // 2).astype(np.int8)), found(left // 2, right // 2)))
        self.assertTrue(np.array_equal(found(np.asfortranarray(left.astype(int)), right.astype(int)[::-1].copy()[::-1]), expected))
        # Both views of a camera have the same bit depth, whatever their values.
        dark, bright = left.astype(np.uint16), right.astype(np.uint16) * 200
        for one, two in ((dark.astype(int), bright.astype(int)), (dark.astype(int), bright)):
            self.assertTrue(np.array_equal(found(one, two), found(dark, bright)))
        self.assertFalse(np.array_equal(found(left, bright), found(dark, bright)))
        # Masked pixels may hold any value, and `no_data` masks a value.
        mask = np.zeros(left.shape, bool)
        mask[:, :10] = True
        masked = np.ma.masked_array(np.where(mask, -9999, left.astype(int)), mask)
        self.assertTrue(np.array_equal(found(masked, right), found(np.ma.masked_array(left, mask), right)))
        holed = np.where(mask, 7, left)
        self.assertTrue(np.array_equal(mrfgs.match(holed.astype(int), right, 15, no_data=7, device="cpu").disparity,
                                       mrfgs.match(holed.astype(np.uint8), right, 15, no_data=7, device="cpu").disparity))
        views = mrfgs.Rectification(CAMERAS).apply(*(image.astype(int) for image in raw_pair()))
        for view, same in zip(views, mrfgs.Rectification(CAMERAS).apply(*raw_pair())):
            self.assertEqual(view.dtype, np.uint8)
            self.assertTrue(np.array_equal(view.data, same.data))

    def test_views_of_8_and_16_bits(self):
        left, right = pair(200, 300)
        expected = mrfgs.match(left, right, 15, device="cpu").disparity
        with warnings.catch_warnings():
            warnings.simplefilter("error", mrfgs.MatchWarning)
            # The same image with 8, 12 and 16 bits.
            for one, two in ((left, right * np.uint16(16)), (left * np.uint16(16), right), (left, right * np.uint16(257)),
                             (left, right.astype(np.uint16))):
                found = mrfgs.match(one, two, 15, device="cpu").disparity
                self.assertLess(np.abs(found - expected)[:, 16:].mean(), 0.005)
            self.assertTrue(np.array_equal(found, expected))
            # Controls: scaled as 16-bit images of one camera, one of them is dark.
            for one, two, words in ((left * np.uint16(257) - (left > 0), right.astype(np.uint16), "all one colour"),
                                    (left.astype(np.uint16), right * np.uint16(16), "far apart")):
                with self.assertRaisesRegex(mrfgs.MatchWarning, words):
                    mrfgs.match(one, two, 15, device="cpu")

    def test_disparities_are_whole_numbers_of_any_type(self):
        left, right = pair()
        expected = mrfgs.match(left, right, 15, min_disparity=-1, device="cpu").disparity
        for kind in (float, np.float32, np.float64, np.int64, np.uint8, np.float16, lambda number: np.array(number)):
            found = mrfgs.match(left, right, kind(15), min_disparity=-1.0, device="cpu")
            self.assertEqual((found.min_disparity, found.max_disparity), (-1, 15))
            self.assertTrue(np.array_equal(found.disparity, expected))
        found = next(mrfgs.Matcher(device="cpu").match_all([(left, right)], 15.0, min_disparity=np.float32(-1)))
        self.assertTrue(np.array_equal(found.disparity, expected))

    def test_layouts_of_memory(self):
        left, right = pair()
        expected = mrfgs.match(left, right, 15, device="cpu").disparity
        # Control: misinterpreting the layout changes the map.
        scrambled = left.reshape(left.shape[1], left.shape[0], 3).transpose(1, 0, 2)
        self.assertFalse(np.array_equal(mrfgs.match(scrambled, right, 15, device="cpu").disparity, expected))

        def layouts(image):
            yield "C", image.copy()
            yield "Fortran", np.asfortranarray(image)
            yield "transposed", np.ascontiguousarray(image.T).T
            for axis in range(image.ndim):
                yield f"negative stride {axis}", np.flip(np.flip(image, axis).copy(), axis)
                wide = np.repeat(image, 2, axis)
                yield f"every second {axis}", wide[(slice(None),) * axis + (slice(None, None, 2),)]
            padded = np.zeros(tuple(n + 3 for n in image.shape), image.dtype)
            view = padded[tuple(slice(1, n + 1) for n in image.shape)]
            view[...] = image
            yield "view", view
            if image.ndim == 3:
                yield "permuted channels", image[..., ::-1].copy()[..., ::-1]
            odd = np.empty(image.nbytes + 1, np.uint8)[1:].view(image.dtype).reshape(image.shape)
            odd[...] = image
            yield "odd address", odd
            yield "other byte order", image.astype(image.dtype.newbyteorder())
            readonly = image.copy()
            readonly.flags.writeable = False
            yield "read-only", readonly

        for dtype in (np.uint8, np.uint16, np.float32, np.float64):
            images = [image.astype(dtype) for image in (left, right)]
            expected = mrfgs.match(*images, 15, device="cpu").disparity
            for (name, l), (_, r) in zip(layouts(images[0]), layouts(images[1])):
                np.testing.assert_array_equal(l, images[0])
                for one, two in ((l, r), (l, images[1]), (images[0], r)):
                    found = mrfgs.match(one, two, 15, device="cpu", warn=False).disparity
                    self.assertTrue(np.array_equal(found, expected), f"{dtype.__name__}, {name}")
        grey = [image[..., 0] for image in (left, right)]
        expected = mrfgs.match(*(image.copy() for image in grey), 15, device="cpu").disparity
        self.assertTrue(np.array_equal(mrfgs.match(*map(np.asfortranarray, grey), 15, device="cpu").disparity, expected))
        # The same row repeated, with stride 0.
        row = grey[0][:1].copy()
        broadcast = np.broadcast_to(row, (60, 80))
        self.assertEqual(broadcast.strides[0], 0)
        expected = mrfgs.match(broadcast.copy(), grey[1].copy(), 15, device="cpu", warn=False).disparity
        self.assertTrue(np.array_equal(mrfgs.match(broadcast, grey[1], 15, device="cpu", warn=False).disparity, expected))

        mask = np.random.default_rng(1).random((60, 80)) < 0.1
        expected = mrfgs.match(left, right, 15, mask=mask, device="cpu").disparity
        self.assertTrue(np.array_equal(np.isinf(expected), mask))
        for name, other in layouts(mask):
            self.assertTrue(np.array_equal(mrfgs.match(left, right, 15, mask=other, device="cpu").disparity, expected), name)
        for dtype in (np.uint8, np.int64, np.float32):
            other = mask.astype(dtype) * 255
            self.assertTrue(np.array_equal(mrfgs.match(left, right, 15, mask=other, device="cpu").disparity, expected))

    def test_masked_arrays(self):
        left, right = pair()
        mask = np.zeros((60, 80), bool)
        mask[:, :10] = True
        expected = mrfgs.match(left, right, 15, mask=mask, device="cpu").disparity
        masked = np.ma.masked_array(left, np.repeat(mask[..., None], 3, 2))
        self.assertTrue(np.array_equal(mrfgs.match(masked, right, 15, device="cpu").disparity, expected))
        # A single channel is accepted, an empty one is not.
        one = np.ma.masked_array(left, np.dstack([mask, mask & False, mask & False]))
        self.assertTrue(np.array_equal(mrfgs.match(one, right, 15, device="cpu").disparity, expected))
        plain = mrfgs.match(left, right, 15, device="cpu").disparity
        self.assertTrue(np.array_equal(mrfgs.match(np.ma.masked_array(left), right, 15, device="cpu").disparity, plain))
        # Then nothing can be matched in the right view.
        both = mrfgs.match(left, np.ma.masked_array(right, np.repeat(mask[..., None], 3, 2)), 15, device="cpu").disparity
        self.assertFalse(np.array_equal(both, plain))
        self.assertTrue(np.isfinite(both).all())
        # By value.
        holed = left.copy()
        holed[:, :10] = 7
        found = mrfgs.match(holed, right, 15, no_data=7, device="cpu").disparity
        self.assertTrue(np.array_equal(found, expected))

    def test_more_than_memory_is_an_exception(self):
        code = ("import numpy as np, mrfgs; a = np.broadcast_to(np.uint8(7), (200_000, 200_000));\n"
                "try: mrfgs.match(a, a, 15, device='cpu')\n"
                "except MemoryError as e: print('told', e)")
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue(done.stdout.startswith("told left"), done.stdout)

    def test_warnings(self):
        def told(*arguments, **keywords):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                mrfgs.match(*arguments, device="cpu", **keywords)
            self.assertTrue(all(w.category is mrfgs.MatchWarning and w.filename == __file__ for w in caught))
            return [str(w.message) for w in caught]

        left, right = pair(200, 300)
        self.assertEqual(told(left, right, 15), [])
        self.assertIn("swapped", told(right, left, 15)[0])
        self.assertIn("swapped", told(right, left)[0])
        self.assertIn("not rectified", told(left, np.roll(right, 1, 0), 15)[0])
        self.assertIn("upside down", told(left, right[::-1], 15)[0])
        self.assertIn("the same", told(left, left, 15)[0])
        self.assertIn("raise max_disparity", " ".join(told(left, right, 9)))
        self.assertRegex(" ".join(told(left, 255 - right, 15)), r"only \d+ % of the pixels were found in both views")
        self.assertIn("the left view is masked everywhere", told(left, right, 15, mask=np.ones((200, 300), bool))[0])
        self.assertEqual(told(right, left, 15, warn=False), [])
        self.assertTrue(issubclass(mrfgs.MatchWarning, UserWarning))
        with warnings.catch_warnings():
            warnings.simplefilter("error", mrfgs.MatchWarning)
            with self.assertRaises(mrfgs.MatchWarning):
                mrfgs.Matcher(device="cpu").match(right, left, 15)

    def test_a_matcher_opens_where_it_arrives(self):
        matcher = mrfgs.Matcher(device="cpu", threads=1)
        again = pickle.loads(pickle.dumps(matcher))
        self.assertIsNot(again, matcher)
        self.assertIs(pickle.loads(pickle.dumps(again)), again, "one for each process")
        self.assertIs(pickle.loads(pickle.dumps(matcher)), again)
        self.assertIsNot(pickle.loads(pickle.dumps(mrfgs.Matcher(device="cpu"))), again, "other threads")
        here = matcher.match(*pair(), 15)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            for there in pool.starmap(matcher.match, [(*pair(), 15)] * 2):
                self.assertTrue(np.array_equal(there.disparity, here.disparity))

    def test_results_pickle_and_copy(self):
        matched = mrfgs.match(*pair(), 15, device="cpu")
        for other in (pickle.loads(pickle.dumps(matched)), copy.copy(matched), copy.deepcopy(matched)):
            self.assertIsInstance(other, mrfgs.Matched)
            for name in ("disparity", "raw", "confidence", "sigma", "validity", "min_disparity", "max_disparity", "iterations",
                         "tiles", "ran_on", "note"):
                self.assertTrue(np.array_equal(getattr(other, name), getattr(matched, name)), name)
        self.assertIn("80 x 60", repr(matched))

    def test_help_explains_every_argument(self):
        for function in (mrfgs.match, mrfgs.Matcher.match, mrfgs.Matcher):
            for name in parameters(function):
                text = inspect.getdoc(mrfgs.Matcher) + inspect.getdoc(mrfgs.Matcher.match)
                self.assertTrue(name == "self" or name in text, name)
        self.assertIn("Matcher", inspect.getdoc(mrfgs.match))
        for name in ("disparity", "confidence", "sigma", "validity", "note"):
            self.assertTrue(inspect.getdoc(getattr(mrfgs.Matched, name)), name)

    def test_options(self):
        left, right = pair()
        self.same(left, right, "--set", "fill=none", "--set", "sub-pixel=false", options={"fill": "none", "sub-pixel": False})
        # Options with their group as a prefix, and groups as dicts, in any order.
        grouped = {"cost": {"outside-cost": 20, "matching": "sad"}, "refinement.fill": "row"}
        flags = [flag for change in ("matching=sad", "outside-cost=20", "fill=row") for flag in ("--set", change)]
        self.same(left, right, *flags, options=grouped)
        self.same(left, right, "--method", "fgs", method="fgs")
        mask = np.zeros(left.shape[:2], bool)
        mask[:, :10] = True
        matched = mrfgs.match(left, right, 15, mask=mask, device="cpu")
        self.assertTrue(np.isinf(matched.disparity[:, :10]).all() and np.isfinite(matched.disparity[:, 10:]).all())
        self.assertTrue((matched.validity[:, :10] == 32).all())

    def test_the_map_of_the_right_view(self):
        left, right = pair()
        self.assertIsNone(mrfgs.match(left, right, 15, device="cpu").right)
        matched = mrfgs.match(left, right, 15, device="cpu", options={"right-map": True})
        self.assertEqual((matched.right.shape, matched.right.dtype), (left.shape[:2], np.float32))
        expected = by_program(left, right, "--max-disparity", "15", "--also", "right", file="out.right.pfm")
        self.assertTrue(np.array_equal(matched.right, expected))
        # Control: it differs from the map of the left view.
        self.assertFalse(np.array_equal(matched.right, matched.disparity))
        self.assertTrue(np.array_equal(pickle.loads(pickle.dumps(matched)).right, matched.right))

    def test_a_region_alone(self):
        left, right = pair()
        height, width = left.shape[:2]
        x, y, w, h = width // 3, height // 4, width // 4, height // 3
        matched = mrfgs.match(left, right, 15, device="cpu", roi=(x, y, w, h))
        expected = by_program(left, right, "--max-disparity", "15", "--roi", f"{x},{y},{w},{h}")
        self.assertTrue(np.array_equal(matched.disparity, expected))
        self.assertEqual(matched.validity.shape, (h, w))
        # Control: another region gives another map.
        self.assertFalse(np.array_equal(mrfgs.match(left, right, 15, device="cpu", roi=(x + 1, y, w, h)).disparity, expected))
        # Its points coincide with those of the full map.
        rig = mrfgs.Rig.of(100.0, 0.1, size=(width, height))
        part = rig.of_part(x, y)
        points = part.points(matched, left[y : y + h, x : x + w])
        columns = points.positions[:, 0] / points.positions[:, 2] * 100 + (width - 1) / 2
        self.assertGreater(len(points), 0)
        self.assertGreater(columns.min(), x - 0.01)
        self.assertLess(columns.max(), x + w - 0.99)
        whole = rig.points(mrfgs.match(left, right, 15, device="cpu"), left).positions
        self.assertLess((whole[:, 0] / whole[:, 2] * 100 + (width - 1) / 2).min(), x - 1)
        for roi in [(x, y, width, h), (0, 0, 0, 3), (x, y, w), (-1, 0, 2, 2), (0.5, 0, 2, 2), "abcd"]:
            with self.assertRaisesRegex((TypeError, ValueError), "roi: "):
                mrfgs.match(left, right, 15, device="cpu", roi=roi)

    def test_options_are_described(self):
        described = mrfgs.options()
        self.assertEqual(mrfgs.presets()["default"], "few errors in little time: for most pairs")
        for option in (option for keys in described.values() for option in keys.values()):
            self.assertEqual({*mrfgs.presets(), "meaning", "takes", "words", "source"}, set(option))
        window = described["cost"]["sad-window"]
        self.assertEqual((window["takes"], window["source"], window["default"]), ("pixels, odd, 1 to 31", "section 3.1: 7", 7))
        self.assertIn("census", described["cost"]["matching"]["words"])
        self.assertIs(described["refinement"]["sub-pixel"]["default"], True)
        # The values of a preset can be passed as options.
        left, right = pair()
        paper = {group: {key: option["paper"] for key, option in keys.items()} for group, keys in described.items()}
        self.same(left, right, "--method", "paper", options=paper)

    def test_a_matcher_matches_again_and_again(self):
        matcher = mrfgs.Matcher(device="cpu", threads=1)
        for seed in (1, 2, 1):
            images = pair(seed=seed)
            alone = mrfgs.match(*images, 15, device="cpu")
            self.assertTrue(np.array_equal(matcher.match(*images, 15).disparity, alone.disparity))

    def test_what_makes_no_sense_is_an_exception(self):
        left, right = pair()
        for error, words, call in (
            (ValueError, "the same size", lambda: mrfgs.match(left, right[:, 1:].copy(), 15)),
            (ValueError, "height, width", lambda: mrfgs.match(left[0, 0], right, 15)),
            (ValueError, "1 to 4 channels", lambda: mrfgs.match(np.dstack([left, left]), right, 15)),
            (ValueError, "has pixels", lambda: mrfgs.match(left[:0], right[:0], 15)),
            (ValueError, "float", lambda: mrfgs.match(left, right.astype(np.float32), 15)),
            (ValueError, "left: is int64 and contains -1; integers must be 0 to 255 or 0 to 65535: convert them",
             lambda: mrfgs.match(left.astype(np.int64) - 1 - left.min(), right, 15)),
            (ValueError, "right: is uint32 and contains 65536; integers", lambda: mrfgs.match(left, np.full((60, 80), 65536, np.uint32), 15)),
            (ValueError, "has pixels", lambda: mrfgs.match(left[:0].astype(int), right[:0].astype(int), 15)),
            (TypeError, "right: is None, as OpenCV returns for a file that it cannot read; check the name", lambda: mrfgs.match(left, None, 15)),
            (TypeError, "left: give an array of integers, float16, float32 or float64, not bool; convert it with astype", lambda: mrfgs.match(left > 9, right, 15)),
            (ValueError, "max_disparity: give a whole number of pixels within 1048576 of 0, not 63.5", lambda: mrfgs.match(left, right, 63.5)),
            (ValueError, "max_disparity: give a whole number of pixels within 1048576 of 0, not NaN", lambda: mrfgs.match(left, right, np.nan)),
            (ValueError, "max_disparity: give a whole number of pixels within 1048576 of 0, not 10000000000", lambda: mrfgs.match(left, right, 10**10)),
            (ValueError, "min_disparity: give a whole", lambda: mrfgs.match(left, right, 15, min_disparity=-np.inf)),
            (TypeError, "max_disparity: give a whole number of pixels within 1048576 of 0, not str", lambda: mrfgs.match(left, right, "63")),
            (TypeError, "max_disparity: give a whole number of pixels within 1048576 of 0, not ndarray", lambda: mrfgs.match(left, right, right)),
            (ValueError, "mask", lambda: mrfgs.match(left, right, 15, mask=np.zeros((3, 3), bool))),
            (TypeError, "left", lambda: mrfgs.match([["1"]], right, 15)),
            (TypeError, "right", lambda: mrfgs.match(left, "right.png", 15)),
            (TypeError, "mask: give an array of bool", lambda: mrfgs.match(left, right, 15, mask=np.full((60, 80), "a"))),
            (ValueError, "mask", lambda: mrfgs.match(left, right, 15, mask=np.zeros((3, 3), np.uint8))),
            (ValueError, "mask", lambda: mrfgs.match(left, right, 15, mask=np.zeros((60, 80, 3), bool))),
            (ValueError, "disparity", lambda: mrfgs.match(left, right, -5)),
            (ValueError, "neither a preset nor a file", lambda: mrfgs.match(left, right, 15, method="best")),
            (ValueError, "no-such-key", lambda: mrfgs.match(left, right, 15, options={"no-such-key": 1})),
            (ValueError, "levels", lambda: mrfgs.match(left, right, 15, options={"levels": 0})),
            (ValueError, "levels", lambda: mrfgs.match(left, right, 15, options={"graph": {"levels": 0}})),
            (ValueError, "is a group", lambda: mrfgs.match(left, right, 15, options={"cost": "sad"})),
            (ValueError, "threads", lambda: mrfgs.match(left, right, 15, device="cpu", threads=0)),
            (ValueError, "1 to 1024", lambda: mrfgs.match(left, right, 15, device="cpu", threads=1025)),
            (ValueError, "1 to 1024", lambda: mrfgs.Matcher(device="cpu", threads=4_000_000_000)),
            (ValueError, "all one colour", lambda: mrfgs.match(left * 0, right * 0)),
        ):
            with self.assertRaises(error) as raised:
                call()
            self.assertIn(words, str(raised.exception))
            self.assertNotIn("\n", str(raised.exception))
            # Messages name arguments of Python, not flags.
            self.assertNotIn("--", str(raised.exception))
        with self.assertRaises(ValueError) as raised:
            mrfgs.match(left, right, -5)
        self.assertIn("max_disparity: -5 is below the minimum disparity 0: raise it or lower min_disparity", str(raised.exception))
        with self.assertRaises(ValueError) as raised:
            mrfgs.match(left, right, 15, options={"memory": 1})
        self.assertRegex(str(raised.exception), r"^memory: 1 MiB .*; give at least \d+MiB")

    def test_floats_of_half_the_bits(self):
        left, right = (image.astype(np.float16) / 256 for image in pair())
        wide = [image.astype(np.float32) for image in (left, right)]
        expected = mrfgs.match(*wide, 15, device="cpu").disparity
        for one, two in ((left, right), (left, wide[1]), (left.astype(">f2"), right), (np.ma.masked_array(left), right)):
            self.assertTrue(np.array_equal(mrfgs.match(one, two, 15, device="cpu").disparity, expected))
        # Control: fewer bits give another image.
        self.assertFalse(np.array_equal(mrfgs.match(*(image // 32 for image in pair()), 15, device="cpu").disparity, expected))
        map_ = np.round(expected * 4).astype(np.float16) / 4
        same = map_.astype(np.float32)
        rig = mrfgs.Rig.of(100, 0.1, size=(80, 60))
        self.assertTrue(np.array_equal(rig.depth(map_), rig.depth(same)))
        self.assertEqual(mrfgs.evaluate(map_, same), mrfgs.evaluate(same, same))

    def test_arrays_of_other_libraries(self):
        class Exported:
            """An object with only this protocol."""

            def __init__(self, array):
                self.array = array

            def __dlpack__(self, **keywords):
                return self.array.__dlpack__(**keywords)

            def __dlpack_device__(self):
                return self.array.__dlpack_device__()

        class Broken:
            def __array__(self, dtype=None, copy=None):
                raise LookupError("the frame is gone")

        class OnDevice(Exported):
            def __dlpack__(self, **keywords):
                raise BufferError("it is on a device")

        left, right = pair()
        expected = mrfgs.match(left, right, 15, device="cpu").disparity
        self.assertTrue(np.array_equal(mrfgs.match(Exported(left), Exported(right), 15, device="cpu").disparity, expected))
        found = next(mrfgs.Matcher(device="cpu").match_all([(Exported(left), right)], 15))
        self.assertTrue(np.array_equal(found.disparity, expected))
        raw, by = raw_pair(), mrfgs.Rectification(CAMERAS)
        self.assertTrue(np.array_equal(by.apply(*map(Exported, raw))[0].data, by.apply(*raw)[0].data))
        self.assertEqual(mrfgs.evaluate(Exported(expected), expected), mrfgs.evaluate(expected, expected))
        led = mrfgs.Steady().follow(found, Exported(left))
        self.assertTrue(np.array_equal(led.disparity, expected))
        # Exceptions of the iterable are the cause of the one raised.
        sequence = mrfgs.Matcher(device="cpu").match_all([(left, Broken())], 15)
        for cause, call in (
            (LookupError, lambda: mrfgs.match(Broken(), right, 15)),
            (LookupError, lambda: mrfgs.match(left, right, 15, mask=Broken())),
            (LookupError, lambda: list(sequence)),
            (LookupError, lambda: by.apply(raw[0], Broken())),
            (LookupError, lambda: mrfgs.Rig.of(100, 0.1, size=(80, 60)).depth(Broken())),
            (LookupError, lambda: mrfgs.evaluate(expected, Broken())),
            (LookupError, lambda: mrfgs.Steady().follow(found, Broken())),
            (BufferError, lambda: mrfgs.match(OnDevice(left), right, 15)),
        ):
            with self.assertRaisesRegex(TypeError, "give a numpy array") as raised:
                call()
            self.assertIs(type(raised.exception.__cause__), cause)

    def test_the_words_of_arguments(self):
        left, right = pair()
        matcher = mrfgs.Matcher(device="cpu")
        found = matcher.match(left, right, 15)
        by, rig = mrfgs.Rectification(CAMERAS), mrfgs.Rig.of(100, 0.1, size=(80, 60))
        raw, first = raw_pair(), np.moveaxis(left, -1, 0)
        path, most = TESTDATA / "mixed" / "im0.png", "1 to 1024"
        for error, words, call in (
            # A path instead of an array.
            (TypeError, "left: give a numpy array, not the path of a file; read images with mrfgs.read_image", lambda: matcher.match("left.png", right, 15)),
            (TypeError, "right: give a numpy array, not the path of a file", lambda: matcher.match(left, path, 15)),
            (TypeError, "mask: give a numpy array, not the path of a file", lambda: matcher.match(left, right, 15, mask=b"mask.png")),
            (TypeError, "pair 0: left: give a numpy array, not the path", lambda: list(matcher.match_all([(str(path), right)], 15))),
            (TypeError, "left: give a numpy array, not the path of a file", lambda: by.apply(path, path)),
            (TypeError, "left: give a numpy array, not the path of a file", lambda: mrfgs.Rectification.of_pair(path, path)),
            (TypeError, "disparity: give a numpy array, not the path of a file", lambda: rig.depth("d.pfm")),
            (TypeError, "sigma: give a numpy array, not the path of a file", lambda: rig.depth_sigma(found.disparity, "d.pfm")),
            (TypeError, "truth: give a numpy array, not the path of a file; read images with mrfgs.read_image and maps with mrfgs.read_disparity",
             lambda: mrfgs.evaluate(found.disparity, Path("truth.pfm"))),
            (TypeError, "left: give a numpy array, not the path of a file", lambda: mrfgs.Steady().follow(found, path)),
            (TypeError, "left: give a numpy array, not the path of a file", lambda: mrfgs.Drift(by).follow(path, path, 15)),
            (TypeError, "left: give a numpy array, not the path of a file", lambda: rig.points(found, path)),
            # Array layouts of other libraries.
            (ValueError, "left: has the shape (3, 60, 80), with channels first: give (height, width, channels), for example "
             "numpy.moveaxis(left, 0, -1), which has 60 rows of 80 pixels", lambda: matcher.match(first, first, 15)),
            (ValueError, "right: has the shape (1, 60, 80), with channels", lambda: matcher.match(left, first[:1], 15)),
            (ValueError, "left: has the shape (3, 180, 240), with channels", lambda: by.apply(*(np.moveaxis(r, -1, 0) for r in raw))),
            (ValueError, "left: give an array of shape (height, width) or (height, width, channels), not (1, 60, 80, 3)",
             lambda: matcher.match(left[None], right, 15)),
            (ValueError, "disparity: give an array of shape (height, width), not (1, 60, 80); numpy.squeeze(disparity) has that shape",
             lambda: rig.depth(found.disparity[None])),
            (ValueError, "truth: give an array of shape (height, width), not (4800,)", lambda: mrfgs.evaluate(found.disparity, found.disparity.ravel())),
            (ValueError, "mask: give an array of shape (height, width), not (60, 80, 1); numpy", lambda: matcher.match(left, right, 15, mask=left[..., :1])),
            # Devices, threads, options and memory.
            (ValueError, "no device is called `4711`", lambda: mrfgs.Matcher(device=4711)) if has_device() else
            (RuntimeError, "no Vulkan or Metal driver", lambda: mrfgs.Matcher(device=4711)),
            (TypeError, 'device: give "auto", "cpu", "gpu", or the index', lambda: mrfgs.Matcher(device=-1)),
            (TypeError, 'device: give "auto", "cpu", "gpu", or the index of a device or part of its name, not 0.5', lambda: mrfgs.Matcher(device=0.5)),
            (TypeError, "not True", lambda: mrfgs.match(left, right, 15, device=True)),
            (ValueError, f"threads: give an integer from {most}, or None, not -1", lambda: mrfgs.Matcher(device="cpu", threads=-1)),
            (TypeError, f"threads: give an integer from {most}, or None, not '2'", lambda: mrfgs.match(left, right, 15, device="cpu", threads="2")),
            (TypeError, "threads: give an integer", lambda: mrfgs.Matcher(device="cpu", threads=1.5)),
            (ValueError, f"threads: {2**63 - 1} threads are not possible; give {most}", lambda: mrfgs.Matcher(device="cpu", threads=10**30)),
            (TypeError, "options: keys must be names of options, such as \"fill\" (see mrfgs.options()), not 3",
             lambda: matcher.match(left, right, 15, options={3: 4})),
            (TypeError, 'options["cost"]: keys must be names of options', lambda: matcher.match(left, right, 15, options={"cost": {None: 4}})),
            (TypeError, 'options: give a dict, such as {"fill": "none"}, not str', lambda: matcher.match(left, right, 15, options="fill=none")),
            (TypeError, "options: give a dict", lambda: matcher.match_all([], 15, options=[7])),
            (ValueError, "method: 'best' is neither a preset nor a file; give one of ", lambda: matcher.match(left, right, 15, method="best")),
            (TypeError, "method: give the name of a preset, or the path of a TOML file", lambda: matcher.match_all([], 15, method=7)),
            (FileNotFoundError, "none.toml: there is no such file", lambda: matcher.match(left, right, 15, method="none.toml")),
            (ValueError, "memory: give a whole number of MiB, GiB or TiB, from 1MiB to 16TiB, like 2GiB", lambda: matcher.match(left, right, 15, memory="2GB")),
            (TypeError, "memory: give a size, such as \"2GiB\", not 2048", lambda: matcher.match_all([], 15, memory=2048)),
        ):
            with self.subTest(words):
                with self.assertRaises(error) as raised:
                    call()
                self.assertIs(type(raised.exception), error, raised.exception)
                self.assertIn(words, str(raised.exception))
                self.assertNotIn("\n", str(raised.exception))
        # Valid values.
        for threads in (np.int64(1), 2):
            self.assertTrue(np.array_equal(mrfgs.match(left, right, 15, device="cpu", threads=threads).disparity, found.disparity))
        if has_device():
            self.assertTrue(np.array_equal(mrfgs.match(left, right, 15, device=0).disparity, found.disparity))
            self.assertTrue(np.array_equal(mrfgs.match(left, right, 15, device=np.int32(0)).disparity, found.disparity))
        large = [np.tile(image, (3, 3, 1)) for image in (left, right)]
        tiled = matcher.match(*large, 15, memory="8MiB")
        self.assertEqual(tiled.tiles, matcher.match(*large, 15, options={"memory": 8}).tiles)
        self.assertGreater(tiled.tiles, matcher.match(*large, 15).tiles)
        next(matcher.match_all([(left, right)], 15, memory="2GiB"))

    def test_a_method_is_a_preset_or_a_file(self):
        left, right = pair()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "mine.toml"
            path.write_text('fill = "none"\n[cost]\nmatching = "sad"\n')
            for given in (path, str(path)):
                self.same(left, right, "--method", path, method=given)
            self.same(left, right, "--method", path, "--set", "fill=row", method=path, options={"fill": "row"})

    def test_images_are_read_as_the_program_reads_them(self):
        random = np.random.default_rng(4)
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            for dtype, most in ((np.uint8, 256), (np.uint16, 4096), (np.uint16, 65536)):
                for shape in ((30, 40), (30, 40, 3)):
                    image = random.integers(0, most, shape).astype(dtype)
                    write_ppm(folder / "image.ppm", image)
                    found = mrfgs.read_image(folder / "image.ppm")
                    self.assertEqual(found.dtype, dtype)
                    self.assertTrue(np.array_equal(found, image))
                    self.assertNotIsInstance(found, np.ma.MaskedArray)
            (folder / "image.pfm").write_bytes(b"Pf\n2 1\n-1\n" + np.array([1.5, np.nan], "<f4").tobytes())
            found = mrfgs.read_image(str(folder / "image.pfm"))
            self.assertEqual((found.dtype, found.shape, found[0, 0]), (np.float32, (1, 2), 1.5))
            # RGB, and alpha that masks pixels.
            views = [mrfgs.read_image(TESTDATA / "mixed" / f"im{i}.png") for i in (0, 1)]
            for i, view in enumerate(views):
                self.assertTrue(np.array_equal(view, read_png(TESTDATA / "mixed" / f"im{i}.png")))
            program(folder, "match", TESTDATA / "mixed" / "im0.png", TESTDATA / "mixed" / "im1.png", "d.pfm", "--max-disparity", 47,
                    "--device", "cpu", "--quiet")
            self.assertTrue(np.array_equal(mrfgs.match(*views, max_disparity=47, device="cpu").disparity, read_pfm(folder / "d.pfm")))
            # With an orientation and a no-data value, which are tags of TIFF.
            pixels = np.arange(6, dtype=np.uint8).reshape(2, 3)
            tags = [(256, 3, 1, 3), (257, 3, 1, 2), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 1, 8), (274, 3, 1, 6),
                    (277, 3, 1, 1), (278, 3, 1, 2), (279, 4, 1, 6), (42113, 2, 2, int.from_bytes(b"4\0", "little"))]
            entries = b"".join(tag.to_bytes(2, "little") + kind.to_bytes(2, "little") + count.to_bytes(4, "little") + value.to_bytes(4, "little")
                               for tag, kind, count, value in tags)
            (folder / "turned.tif").write_bytes(b"II*\0" + (14).to_bytes(4, "little") + pixels.tobytes() + len(tags).to_bytes(2, "little")
                                                + entries + bytes(4))
            stored, upright = (mrfgs.read_image(folder / "turned.tif", orient=orient) for orient in (False, True))
            self.assertIsInstance(stored, np.ma.MaskedArray)
            self.assertTrue(np.array_equal(stored.data, pixels) and np.array_equal(stored.mask, pixels == 4))
            self.assertTrue(np.array_equal(upright.data, np.rot90(pixels, -1)) and np.array_equal(upright.mask, np.rot90(pixels == 4, -1)))
            (folder / "text.png").write_text("no image")
            for error, name in ((FileNotFoundError, "nowhere.png"), (ValueError, "text.png")):
                with self.assertRaisesRegex(error, name):
                    mrfgs.read_image(folder / name)
            with self.assertRaises(TypeError):
                mrfgs.read_image(pixels)

    def test_other_threads_run_meanwhile(self):
        images = pair(400, 600)
        self.assertGreater(ticks_during(lambda: mrfgs.match(*images, 63, device="cpu")), 5)

    @unittest.skipIf(sys.platform == "win32", "no signals there")
    def test_ctrl_c_ends_a_match(self):
        code = ("import signal, numpy as np, mrfgs; signal.signal(signal.SIGINT, signal.default_int_handler); "
                "a = np.random.default_rng(1).integers(0, 256, (1500, 1500), dtype=np.uint8); "
                "print('ready', flush=True); mrfgs.match(a, a, 255, device='cpu', options={'final-iterations': 1000})")
        with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            self.addCleanup(process.kill)
            self.assertEqual(process.stdout.readline(), "ready\n")
            time.sleep(1)
            process.send_signal(signal.SIGINT)
            _, told = process.communicate(timeout=60)
        self.assertIn("KeyboardInterrupt", told)


class CtrlC(unittest.TestCase):
    """The first call in a program opens the device, compiles its shaders and checks it."""

    CODE = """
import signal, sys, time
import numpy as np
import mrfgs

signal.signal(signal.SIGINT, signal.default_int_handler)
a = np.random.default_rng(1).integers(0, 256, (300, 400), dtype=np.uint8)
try:
    print("ready", flush=True)
    mrfgs.match(a, np.roll(a, -5, 1), 63, device=sys.argv[1], warn=False)
    print("matched", flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    print("told", flush=True)
"""

    def interrupted(self, device):
        during = 0
        # Drivers complain on standard error where there is no such folder.
        runtime = tempfile.TemporaryDirectory()
        self.addCleanup(runtime.cleanup)
        environment = {"XDG_RUNTIME_DIR": runtime.name, **os.environ}
        for delay in (0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2):
            with subprocess.Popen([sys.executable, "-c", self.CODE, device], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                  env=environment) as process:
                self.addCleanup(process.kill)
                self.assertEqual(process.stdout.readline(), "ready\n")
                time.sleep(delay)
                process.send_signal(signal.SIGINT)
                said, wrong = process.communicate(timeout=300)
            self.assertEqual((process.returncode, wrong), (0, ""), f"after {delay} s")
            self.assertIn(said, ("told\n", "matched\ntold\n"), f"after {delay} s")
            during += said == "told\n"
        self.assertGreater(during, 0)

    @unittest.skipIf(sys.platform == "win32", "no signals there")
    def test_on_the_cpu(self):
        self.interrupted("cpu")

    @unittest.skipIf(sys.platform == "win32", "no signals there")
    def test_on_a_device(self):
        if not has_device():
            self.skipTest("there is no device")
        self.interrupted("gpu")


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def refused(self, error, words, call):
        with self.assertRaises(error) as raised:
            call()
        self.assertIs(type(raised.exception), error)
        said = str(raised.exception)
        self.assertIn(words, said)
        # A single line that names arguments of Python.
        self.assertNotIn("\n", said)
        self.assertNotIn("--", said)

    def write(self, name, text):
        path = self.folder / name
        path.write_text(text)
        return path


class RectificationByMatches(Folder):
    def test_it_is_the_programs(self):
        left, right = raw_pair()
        program(self.folder, "rectify", RAW / "left.png", RAW / "right.png", "out", "--maps", "--quiet")
        by = mrfgs.Rectification.of_pair(left, right)
        self.assertEqual((by.size, by.raw_size), ((240, 180), (240, 180)))
        for i, view in enumerate(by.apply(left, right)):
            expected = read_png(self.folder / f"out/im{i}.png")[..., :3]
            self.assertTrue(np.array_equal(np.where(view.mask, 0, view.data), np.where(view.mask, 0, expected)))
            for axis, found in zip("xy", by.maps()[i]):
                self.assertTrue(np.array_equal(found, read_pfm(self.folder / f"out/map{i}{axis}.pfm")))
        # A copy is rebuilt from the same matches.
        again = pickle.loads(pickle.dumps(by))
        self.assertTrue(np.array_equal(again.maps()[1][1], by.maps()[1][1]))
        self.assertEqual(again.trust, by.trust)
        trust = by.trust
        self.assertEqual(list(trust), ["matches", "agreeing", "median", "percentile95", "coverage", "off_one_plane"])
        self.assertTrue(30 <= trust["agreeing"] <= trust["matches"] and 0 < trust["median"] < trust["percentile95"] < 1.5)
        # The scale is unknown.
        for use in (lambda: by.rig, by.calib_txt, by.cameras_yml):
            with self.assertRaisesRegex(ValueError, "no scale"):
                use()
        # Control: with a calibration there is a scale, and the views differ.
        known = mrfgs.Rectification(CAMERAS)
        self.assertIsNone(known.trust)
        self.assertFalse(np.array_equal(known.maps()[0][0], by.maps()[0][0]))
        shown = mrfgs.Rectification.of_pair(left, right, alpha=1)
        self.assertLess(by.apply(left, right)[0].mask.mean(), shown.apply(left, right)[0].mask.mean())

    def test_what_shows_no_geometry_is_refused(self):
        left, right = raw_pair()
        mask = np.ones(left.shape[:2], np.uint8)
        for words, call in [
            ("no depth", lambda: mrfgs.Rectification.of_pair(left, left)),
            ("only 0 of 0 matches agree", lambda: mrfgs.Rectification.of_pair(left, right, mask=mask)),
            ("alpha", lambda: mrfgs.Rectification.of_pair(left, right, alpha=2)),
            ("240 x 180", lambda: mrfgs.Rectification.of_pair(left, right[1:])),
        ]:
            with self.assertRaisesRegex(ValueError, words):
                call()


class Rectification(Folder):
    def same(self, left, right, calibration, files, *arguments, **keywords):
        """The output of the program for the files LEFT RIGHT."""
        if (self.folder / "out").exists():
            (self.folder / "out").rename(tempfile.mkdtemp(dir=self.folder) + "/out")
        program(self.folder, "rectify", *files, "out", "--calib", *arguments, "--maps", "--quiet")
        out = self.folder / "out"
        rectification = mrfgs.Rectification(calibration, left.shape[1::-1], **keywords)
        views = rectification.apply(left, right)
        for i, view in enumerate(views):
            self.assertIsInstance(view, np.ma.MaskedArray)
            expected, mask = read_png(out / f"im{i}.png"), read_png(out / f"mask{i}.png") != 0
            self.assertEqual(view.shape[1::-1], rectification.size)
            self.assertEqual(view.dtype, expected.dtype)
            self.assertTrue(np.array_equal(view.mask if view.ndim == 2 else view.mask.all(2), mask))
            self.assertTrue(np.array_equal(view.mask if view.ndim == 2 else view.mask.any(2), mask))
            colours = expected[..., 0] if view.ndim == 2 and expected.ndim == 3 else expected[..., :3] if view.ndim == 3 else expected
            self.assertTrue(np.array_equal(np.where(view.mask, 0, view.data), np.where(view.mask, 0, colours)))
            for axis, found in zip("xy", rectification.maps()[i]):
                self.assertEqual(found.dtype, np.float32)
                self.assertTrue(np.array_equal(found, read_pfm(out / f"map{i}{axis}.pfm")))
        self.assertEqual(rectification.calib_txt(), (out / "calib.txt").read_text())
        self.assertEqual(rectification.cameras_yml(), (out / "cameras.yml").read_text())
        return rectification, views

    def test_it_is_the_programs(self):
        left, right = raw_pair()
        files = RAW / "left.png", RAW / "right.png"
        by, views = self.same(left, right, CAMERAS, files, CAMERAS)
        self.assertTrue(0.01 < views[0].mask.mean() < 0.3)
        self.assertEqual((by.size, by.raw_size), ((240, 180), (240, 180)))
        self.assertIn("240 x 180", repr(by))
        self.assertEqual(mrfgs.Rectification(CAMERAS, [np.int64(240), np.uint8(180)]).maps()[0][0].shape, (180, 240))
        for rotation in by.rotations:
            self.assertEqual((rotation.shape, rotation.dtype), ((3, 3), np.float64))
            self.assertLess(np.abs(rotation @ rotation.T - np.eye(3)).max(), 1e-12)
        text = by.cameras_yml()
        for i, rotation in enumerate(by.rotations):
            data = text.split(f"fromRaw{i + 1}:")[1].split("data: [")[1].split("]")[0]
            self.assertTrue(np.array_equal(rotation.ravel(), np.array(data.split(","), float)))
        for alpha in (0, 0.5, 1):
            other, other_views = self.same(left, right, str(CAMERAS), files, CAMERAS, "--alpha", alpha, alpha=alpha)
            # Control: another option gives other views.
            self.assertFalse(np.array_equal(other_views[0].data, views[0].data))
        self.assertTrue(views[0].mask.mean() < other_views[0].mask.mean())
        self.assertNotEqual(mrfgs.Rectification(CAMERAS, zero_disparity=False).rig.doffs, 0)
        self.assertEqual(by.rig.doffs, 0)
        # Repeating it uses the cached maps.
        again = by.apply(left, right)
        self.assertTrue(all(np.array_equal(a.data, b.data) and np.array_equal(a.mask, b.mask) for a, b in zip(views, again)))
        # Control: the views are not swapped.
        swapped = by.apply(right, left)
        self.assertFalse(np.array_equal(swapped[0].data, views[0].data))

    def test_kinds_of_images(self):
        colour = raw_pair()
        grey = tuple(image[..., 1].copy() for image in colour)
        for left, right in (grey, tuple(image.astype(np.uint16) * 16 + 5 for image in colour),
                            tuple(image.astype(np.uint16) * 257 for image in grey),
                            tuple(image.astype(np.uint16) * 200 + 9 for image in grey)):
            files = self.folder / "left.ppm", self.folder / "right.ppm"
            write_ppm(files[0], left)
            write_ppm(files[1], right)
            if left.dtype == np.uint16 and (left % 257 == 0).all():
                # 16-bit images with 8-bit values remain 16-bit here, but are bytes in the program's files.
                by = mrfgs.Rectification(CAMERAS)
                views, bytes_ = by.apply(left, right), by.apply(*grey)
                self.assertTrue(np.array_equal(views[0].data, bytes_[0].data.astype(np.uint16) * 257))
            else:
                by, views = self.same(left, right, CAMERAS, files, CAMERAS)
            # Matching the views gives the map of the program for its files.
            found = mrfgs.match(*views, 31, device="cpu", warn=False).disparity
            program(self.folder, "match", *files, "d.pfm", "--rectify", "--calib", CAMERAS, "--max-disparity", 31, "--device", "cpu", "--quiet")
            if left.dtype == np.uint8 or (left % 257 == 0).all():
                self.assertTrue(np.array_equal(found, read_pfm(self.folder / "d.pfm")))
            else:
                program(self.folder, "match", "out/im0.png", "out/im1.png", "d.pfm", "--max-disparity", 31, "--device", "cpu", "--quiet")
                self.assertTrue(np.array_equal(found, read_pfm(self.folder / "d.pfm")))
        by = mrfgs.Rectification(CAMERAS)
        expected = by.apply(*colour)
        # Alpha acts as a mask, and the views may have different formats.
        opaque = [np.dstack([image, np.full(image.shape[:2], 9, np.uint8)]) for image in colour]
        found = by.apply(*opaque)
        self.assertEqual(found[0].shape, expected[0].shape)
        self.assertTrue(np.array_equal(found[0].data, expected[0].data))
        mixed = by.apply(colour[0], grey[1])
        self.assertEqual((mixed[0].shape, mixed[1].shape), ((180, 240, 3), (180, 240)))
        floats = by.apply(*(image / 255 for image in colour))
        self.assertEqual(floats[0].dtype, np.uint16)
        self.assertLess(np.abs(floats[0].data / 256.0 - expected[0].data)[~expected[0].mask].max(), 20)

    def test_layouts_and_masks(self):
        left, right = raw_pair()
        by = mrfgs.Rectification(CAMERAS)
        expected = by.apply(left, right)
        for name, change in (("Fortran", np.asfortranarray), ("flipped", lambda a: a[::-1].copy()[::-1]),
                             ("every second", lambda a: np.repeat(a, 2, 1)[:, ::2]),
                             ("BGR", lambda a: a[..., ::-1].copy()[..., ::-1])):
            found = by.apply(change(left), change(right))
            self.assertTrue(np.array_equal(found[0].data, expected[0].data), name)
            self.assertTrue(np.array_equal(found[1].data, expected[1].data), name)
        # Control.
        self.assertFalse(np.array_equal(by.apply(left[::-1], right)[0].data, expected[0].data))
        for order in ("<u2", ">u2"):
            wide = [image.astype(order) * 16 for image in (left, right)]
            self.assertTrue(np.array_equal(by.apply(*wide)[0].data, by.apply(*(w.astype(np.uint16) for w in wide))[0].data))
        mask = np.zeros(left.shape[:2], bool)
        mask[60:100, 90:130] = True
        masked = by.apply(left, right, mask=mask)
        self.assertGreater(masked[0].mask[..., 0].sum(), expected[0].mask[..., 0].sum() + 1000)
        self.assertTrue(np.array_equal(masked[1].mask, expected[1].mask))
        both = np.ma.masked_array(left, np.repeat(mask[..., None], 3, 2)), np.ma.masked_array(right, np.repeat(mask[..., None], 3, 2))
        found = by.apply(*both)
        self.assertTrue(np.array_equal(found[0].mask, masked[0].mask))
        self.assertFalse(np.array_equal(found[1].mask, expected[1].mask))
        holed = left.copy()
        holed[mask] = 7
        self.assertTrue(np.array_equal(by.apply(holed, right, no_data=7)[0].mask, masked[0].mask))

    def test_from_raw_frames_to_depth_and_points(self):
        left, right = raw_pair()
        program(self.folder, "match", RAW / "left.png", RAW / "right.png", "d.pfm", "--rectify", "--calib", CAMERAS,
                "--max-disparity", 31, "--also", "depth,depth-mm,sigma,depth-sigma,points,points.pcd,points.las,points.laz", "--device", "cpu", "--quiet")
        rectification = mrfgs.Rectification(CAMERAS)
        views = rectification.apply(left, right)
        found = mrfgs.match(*views, 31, device="cpu")
        self.assertTrue(np.array_equal(found.disparity, read_pfm(self.folder / "d.pfm")))
        rig = rectification.rig
        depth, millimetres = rig.depth(found.disparity), rig.millimetres(found.disparity)
        self.assertEqual((depth.dtype, millimetres.dtype, depth.shape), (np.float32, np.uint16, (180, 240)))
        self.assertTrue(np.array_equal(depth, read_pfm(self.folder / "d.depth.pfm")))
        self.assertTrue(np.array_equal(millimetres, read_png(self.folder / "d.depth-mm.png")))
        self.assertTrue(np.array_equal(found.sigma, read_pfm(self.folder / "d.sigma.pfm")))
        self.assertEqual((found.sigma.dtype, found.sigma.shape), (np.float32, (180, 240)))
        sigma = rig.depth_sigma(found.disparity, found.sigma)
        self.assertTrue(np.array_equal(sigma, read_pfm(self.folder / "d.depth-sigma.pfm")))
        self.assertTrue(np.array_equal(rig.depth_sigma(found.disparity, 2 * found.sigma), 2 * sigma))
        self.refused(ValueError, "sigma: is 240 x 179, but disparity is 240 x 180", lambda: rig.depth_sigma(found.disparity, found.sigma[1:]))
        near = np.isfinite(depth) & (depth < 65)
        self.assertLessEqual(np.abs(millimetres[near] - depth[near] * 1000).max(), 0.51)
        self.assertTrue((millimetres[~np.isfinite(depth)] == 0).all() and np.isinf(depth).any())
        points = rig.points(found, views[0])
        points.save(self.folder / "python.ply")
        self.assertEqual((self.folder / "python.ply").read_bytes(), (self.folder / "d.points.ply").read_bytes())
        for name in ("pcd", "las", "laz"):
            points.save(self.folder / f"python.{name}")
            self.assertEqual((self.folder / f"python.{name}").read_bytes(), (self.folder / f"d.points.{name}").read_bytes())
        self.assertEqual((rig.unit, rig.size), ("m", (240, 180)))
        self.assertAlmostEqual(rig.baseline, 0.16361, 5)
        # Control: another map gives other depths and points.
        other = mrfgs.match(*views, 12, device="cpu", warn=False)
        self.assertFalse(np.array_equal(rig.depth(other.disparity), depth))
        rig.points(other, views[0]).save(self.folder / "python.ply")
        self.assertNotEqual((self.folder / "python.ply").read_bytes(), (self.folder / "d.points.ply").read_bytes())

    def test_depths_in_the_view_of_a_third_camera(self):
        third = RAW / "third.yml"
        program(self.folder, "match", RAW / "left.png", RAW / "right.png", "d.pfm", "--rectify", "--calib", CAMERAS, "--max-disparity", 31,
                "--also", "depth-registered,depth-registered-mm", "--into", third, "--device", "cpu", "--quiet")
        rectification = mrfgs.Rectification(CAMERAS)
        disparity = mrfgs.match(*rectification.apply(*raw_pair()), 31, device="cpu").disparity
        expected = read_pfm(self.folder / "d.depth-registered.pfm")
        camera = mrfgs.ThirdCamera(third)
        self.assertEqual((camera.size, camera.unit), ((400, 240), "m"))
        rigs = {"rig": rectification.rig, "pickled": pickle.loads(pickle.dumps(rectification.rig)), "copied": copy.deepcopy(rectification).rig,
                "part": rectification.rig.of_part(0, 0)}
        cameras = {"path": str(third), "text": mrfgs.ThirdCamera.of_text(third.read_text()), "pickled": pickle.loads(pickle.dumps(camera))}
        for name, rig, given in [(name, rig, camera) for name, rig in rigs.items()] + [(name, rigs["rig"], of) for name, of in cameras.items()]:
            found = rig.registered(disparity, given)
            self.assertEqual((found.dtype, found.shape), (np.float32, (240, 400)))
            self.assertTrue(np.array_equal(found, expected), name)
        millimetres = rectification.rig.registered_millimetres(disparity, camera)
        self.assertTrue(np.array_equal(millimetres, read_png(self.folder / "d.depth-registered-mm.png")))
        # A region of the map gives the same depths, except where a surface is cut.
        part = rectification.rig.of_part(40, 30).registered(disparity[30:, 40:], camera)
        both = np.isfinite(part) & np.isfinite(expected)
        self.assertGreater((part[both] == expected[both]).mean(), 0.98)
        self.assertGreater(both.sum(), 0.6 * np.isfinite(expected).sum())
        # Control: without the rotation of the rectification, the pose of the camera is wrong.
        (self.folder / "rectified.yml").write_text(rectification.cameras_yml())
        rectified = mrfgs.Rig(self.folder / "rectified.yml")
        self.assertFalse(np.array_equal(rectified.registered(disparity, camera), expected))
        self.refused(FileNotFoundError, "none.yml: there is no such file", lambda: mrfgs.ThirdCamera("none.yml"))
        self.refused(TypeError, "camera: give a ThirdCamera, or the path of its file", lambda: rectified.registered(disparity, 7))
        self.refused(ValueError, "the text: ", lambda: mrfgs.ThirdCamera.of_text("K: [1, 2]"))
        self.refused(ValueError, "ThirdCamera.of_text", lambda: mrfgs.ThirdCamera(third.read_text()))
        self.refused(ValueError, "disparity: is 240 x 179", lambda: rectified.registered(disparity[1:], camera))
        unknown = mrfgs.Rig.of(260, 0.1, size=(240, 180))
        self.refused(ValueError, "lacks the unit", lambda: unknown.registered_millimetres(disparity, camera))

    def test_forms_of_calibrations(self):
        text = CAMERAS.read_text()

        def numbers(name):
            return text.split(f"\n{name}: ")[1].split("data: [ ")[1].split(" ]")[0].split(", ")

        def xml():
            out = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<imageSize>240 180</imageSize>\n<unit>m</unit>\n"
            for name, rows in (("K1", 3), ("D1", 1), ("K2", 3), ("D2", 1), ("R", 3), ("T", 3)):
                data = numbers(name)
                out += (f"<{name} type_id=\"opencv-matrix\"><rows>{rows}</rows><cols>{len(data) // rows}</cols><dt>d</dt>"
                        f"<data>{' '.join(data)}</data></{name}>\n")
            return out + "</opencv_storage>\n"

        def kalibr():
            out = ""
            for n in (1, 2):
                k, d = numbers(f"K{n}"), numbers(f"D{n}")
                out += (f"cam{n - 1}:\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [{', '.join(d[:4])}]\n"
                        f"  intrinsics: [{k[0]}, {k[4]}, {k[2]}, {k[5]}]\n  resolution: [240, 180]\n")
            r, t = numbers("R"), numbers("T")
            rows = "".join(f"  - [{', '.join(r[3 * y:3 * y + 3])}, {t[y]}]\n" for y in range(3))
            return out + f"  T_cn_cnm1:\n{rows}  - [0.0, 0.0, 0.0, 1.0]\n"

        expected = mrfgs.Rectification(CAMERAS).maps()
        lenses, pose = text.split("R: ")
        files = self.write("intrinsics.yml", lenses), self.write("extrinsics.yml", "%YAML:1.0\n---\nunit: m\nR: " + pose)
        for form in (mrfgs.Calibration(CAMERAS), mrfgs.Calibration(str(CAMERAS)), mrfgs.Calibration.of_texts(text),
                     mrfgs.Calibration.of_texts(xml()), mrfgs.Calibration.of_texts(kalibr()), mrfgs.Calibration(*files),
                     list(files), tuple(map(str, files)), iter(files)):
            found = mrfgs.Rectification(form, (240, 180)).maps()
            self.assertTrue(np.array_equal(found, expected), form)
            calibration = form if isinstance(form, mrfgs.Calibration) else mrfgs.Calibration(*files)
            self.assertEqual((calibration.unit, calibration.size, calibration.max_disparity), ("m", (240, 180), None))
        # Control: a lens with another distortion.
        other = mrfgs.Calibration.of_texts(text.replace("-0.16,", "-0.15,"))
        self.assertFalse(np.array_equal(mrfgs.Rectification(other).maps(), expected))
        camera = ("image_width: 240\nimage_height: 180\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [200, 0, 120, 0, 200, 90, 0, 0, 1]\n"
                  "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n"
                  "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
                  "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [200, 0, 120, {}, 0, 200, 90, 0, 0, 0, 1, 0]\n")
        ros = self.write("left.yaml", camera.format("0")), self.write("right.yaml", camera.format("-24"))
        for order in (ros, ros[::-1]):
            rig = mrfgs.Rig(order)
            self.assertEqual((rig.baseline, rig.doffs, rig.unit, rig.size), (0.12, 0, "m", (240, 180)))
            self.assertTrue(np.array_equal(rig.cameras[0], [[200, 0, 120], [0, 200, 90], [0, 0, 1]]))
            self.assertTrue(np.array_equal(rig.depth(np.full((180, 240), 6.0)), np.full((180, 240), 4, np.float32)))
        self.assertIn("left.yaml, ", repr(mrfgs.Calibration(*ros)))

    def test_one_camera_above_the_other(self):
        text = CAMERAS.read_text()
        head, pose = text.split("R: ")
        # Shifted down by a baseline, without rotation.
        below = head + ("R: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 1, 0, 0, 0, 1, 0, 0, 0, 1 ]\n"
                        "T: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [ 0.0, -0.2, 0.0 ]\n")
        path = self.write("below.yml", below)
        left, right = raw_pair()
        by, views = self.same(left, right, path, (RAW / "left.png", RAW / "right.png"), path)
        self.assertEqual((by.raw_size, by.size, by.rig.size), ((240, 180), (180, 240), (180, 240)))
        self.assertEqual(views[0].shape, (240, 180, 3))
        self.assertEqual(by.rig.baseline, 0.2)

    def copies(self, thing):
        yield copy.copy(thing)
        yield copy.deepcopy(thing)
        for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
            yield pickle.loads(pickle.dumps(thing, protocol))

    def test_calibrations_pickle_and_copy(self):
        path = self.folder / "here.yml"
        path.write_text(CAMERAS.read_text())
        lenses, pose = CAMERAS.read_text().split("R: ")
        two = self.write("intrinsics.yml", lenses), self.write("extrinsics.yml", "%YAML:1.0\n---\nunit: m\nR: " + pose)
        made = [mrfgs.Calibration(path), mrfgs.Calibration(path, unit="cm"), mrfgs.Calibration(*two),
                mrfgs.Calibration.of_texts(CAMERAS.read_text()), mrfgs.Calibration(TESTDATA / "mixed" / "calib.txt")]
        pickled = [pickle.dumps(calibration) for calibration in made]
        # The files may have been deleted or replaced.
        path.unlink()
        two[0].write_text(two[1].read_text())
        for calibration, bytes_ in zip(made, pickled):
            for other in (pickle.loads(bytes_), *self.copies(calibration)):
                self.assertIsInstance(other, mrfgs.Calibration)
                for name in ("size", "unit", "max_disparity"):
                    self.assertEqual(getattr(other, name), getattr(calibration, name))
                self.assertEqual(repr(other), repr(calibration))
                if calibration.max_disparity is None:
                    self.assertTrue(np.array_equal(mrfgs.Rectification(other).maps(), mrfgs.Rectification(calibration).maps()))
                    self.assertEqual(mrfgs.Rectification(other).cameras_yml(), mrfgs.Rectification(calibration).cameras_yml())
        # Errors name the same files.
        self.refused(ValueError, str(path), lambda: mrfgs.Rectification(pickle.loads(pickled[0]), (7, 7)))

    def test_rectifications_and_rigs_pickle_and_copy(self):
        raw = raw_pair()
        disparity = np.random.default_rng(3).uniform(1, 31, (180, 240)).astype(np.float32)
        path = self.write("here.yml", CAMERAS.read_text())
        sizeless = mrfgs.Calibration.of_texts(CAMERAS.read_text().replace("imageSize: [ 240, 180 ]\n", ""))
        seen = []
        for calibration, size, keywords in ((path, None, {}), (path, (240, 180), {"alpha": 0.3}), (path, None, {"zero_disparity": False}),
                                            (sizeless, (240, 180), {"alpha": 1}), (mrfgs.Calibration(path, unit="cm"), None, {})):
            by = mrfgs.Rectification(calibration, size, **keywords)
            views = by.apply(*raw)
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                for other in self.copies(by):
                    self.assertEqual((other.size, other.raw_size, repr(other)), (by.size, by.raw_size, repr(by)))
                    self.assertTrue(np.array_equal(other.maps(), by.maps()))
                    self.assertTrue(np.array_equal(other.rotations, by.rotations))
                    self.assertEqual((other.calib_txt(), other.cameras_yml()), (by.calib_txt(), by.cameras_yml()))
                    self.assertTrue(np.array_equal(other.rig.depth(disparity), by.rig.depth(disparity)))
                for one, same in zip(other.apply(*raw), views):
                    self.assertTrue(np.array_equal(one.data, same.data) and np.array_equal(one.mask, same.mask))
            # Control: they are not all equal.
            seen.append((by.rig.unit, by.maps()[0][0].tobytes(), by.rig.doffs))
        self.assertEqual(len(set(seen)), 5)
        ours = mrfgs.Rectification(path).rig
        rigs = [ours, mrfgs.Rig(TESTDATA / "mixed" / "calib.txt"), mrfgs.Rig.of(700, 0.1, size=(240, 180), doffs=0.1, unit="m"),
                mrfgs.Rig.of(1 / 3, 0.1, principal_point=(1 / 7, 3)),
                mrfgs.Rig(mrfgs.Calibration.of_texts("cam0=[100 0 2; 0 90 2; 0 0 1]\ndoffs=5\nbaseline=20\n"))]
        for rig in rigs:
            for other in self.copies(rig):
                for name in ("doffs", "baseline", "unit", "size"):
                    self.assertEqual(getattr(other, name), getattr(rig, name))
                self.assertTrue(np.array_equal(other.cameras, rig.cameras))
                map_ = disparity if rig.size in (None, (240, 180)) else np.full(rig.size[::-1], 9.5)
                self.assertTrue(np.array_equal(other.depth(map_), rig.depth(map_)))
        self.refused(ValueError, f"{path} is for images of 240 x 180", lambda: pickle.loads(pickle.dumps(ours)).depth(disparity[1:]))

    def test_workers_take_them(self):
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            by = mrfgs.Rectification(CAMERAS)
            self.assertTrue(np.array_equal(pool.apply(mrfgs.Rectification.maps, (by,)), by.maps()))

    def test_units(self):
        text = CAMERAS.read_text().replace("unit: m\n", "")
        disparity = np.full((180, 240), 10, np.float32)
        unknown = mrfgs.Rectification(mrfgs.Calibration.of_texts(text)).rig
        metres = mrfgs.Rectification(CAMERAS).rig
        self.assertEqual(unknown.unit, "unknown")
        self.assertTrue(np.array_equal(unknown.depth(disparity), metres.depth(disparity)))
        self.refused(ValueError, "lacks the unit of the baseline; use Calibration(..., unit=", lambda: unknown.millimetres(disparity))
        for unit, factor in (("m", 1), ("cm", 0.01), ("mm", 0.001)):
            rig = mrfgs.Rectification(mrfgs.Calibration.of_texts(text, unit=unit)).rig
            self.assertEqual(rig.unit, unit)
            expected = np.rint(metres.millimetres(disparity) * factor)
            self.assertLessEqual(np.abs(rig.millimetres(disparity) - expected).max(), 1)
        self.refused(ValueError, "unit: give mm, cm, m or unknown, not \"feet\"", lambda: mrfgs.Calibration(CAMERAS, unit="feet"))

    def test_what_is_taken_otherwise_is_a_warning(self):
        text = CAMERAS.read_text()
        of_texts = mrfgs.Calibration.of_texts
        swapped = text.replace("data: [ -0.16356857928250576", "data: [ 0.16356857928250576")
        self.assertNotEqual(swapped, text)
        for words, call in (
            ("the right camera to the left of the left one, so the two were swapped", lambda: mrfgs.Rectification(of_texts(swapped))),
            ("those of 480 x 360 count as the same, scaled; .*crop=", lambda: mrfgs.Rectification(CAMERAS, (480, 360))),
            ("mm apart.*unit=", lambda: mrfgs.Rectification(of_texts(text, unit="mm"))),
            ("120 m apart.*Rig.of", lambda: mrfgs.Rig.of(700, 120, size=(640, 480), unit="m")),
            ("4 px.*in pixels", lambda: mrfgs.Rig.of(4, 120, size=(640, 480), unit="mm")),
        ):
            with self.assertWarnsRegex(mrfgs.MatchWarning, words):
                call()
        # The caller chooses the region, and a copy keeps it.
        with warnings.catch_warnings():
            warnings.simplefilter("error", mrfgs.MatchWarning)
            part = of_texts(text, crop=(0, 20, 240, 140))
            self.assertEqual(pickle.loads(pickle.dumps(part)).size, (240, 140))
            by = mrfgs.Rectification(part)
            self.assertEqual(by.raw_size, (240, 140))
            mrfgs.Rig.of(700, 120, size=(640, 480), unit="mm")

    def test_what_makes_no_sense_is_an_exception(self):
        left, right = raw_pair()
        by = mrfgs.Rectification(CAMERAS)
        text = CAMERAS.read_text()
        of_texts = mrfgs.Calibration.of_texts
        sizeless = of_texts(text.replace("imageSize: [ 240, 180 ]\n", ""))
        for error, words, call in (
            (FileNotFoundError, "nowhere.yml: there is no such file", lambda: mrfgs.Rectification("nowhere.yml")),
            (FileNotFoundError, "nowhere.txt", lambda: mrfgs.Rig("nowhere.txt")),
            (ValueError, "cannot read", lambda: mrfgs.Calibration(self.folder)),
            (ValueError, "left.png", lambda: mrfgs.Rectification(RAW / "left.png", (240, 180))),
            (ValueError, "expected the entries of OpenCV", lambda: of_texts("a: 1\n")),
            (ValueError, "calibration: give the path", lambda: mrfgs.Calibration()),
            (ValueError, "calibration: give the path", lambda: mrfgs.Rectification([])),
            (ValueError, "Calibration.of_texts", lambda: mrfgs.Rectification(text)),
            (TypeError, "calibration: give the path", lambda: mrfgs.Rectification(7)),
            (TypeError, "calibration: give the path", lambda: mrfgs.Rectification([7])),
            (ValueError, "is not needed", lambda: mrfgs.Calibration(CAMERAS, CAMERAS, CAMERAS)),
            (ValueError, "one too many", lambda: mrfgs.Calibration(CAMERAS, CAMERAS, CAMERAS, CAMERAS)),
            (ValueError, "the text: K1", lambda: of_texts(text.replace("214.0, 0.0, 121.4", "wide, 0.0, 121.4"))),
            (ValueError, "the text: R is missing", lambda: mrfgs.Rectification(of_texts(text.split("R: ")[0]), (240, 180))),
            (ValueError, "crop: the text: the calibration is for images of 240 x 180",
             lambda: of_texts(text, crop=(0, 1, 240, 180))),
            (ValueError, "cameras.yml: the calibration is for images of 240 x 180, but these are 180 x 240; size is (width, height)",
             lambda: mrfgs.Rectification(CAMERAS, (180, 240))),
            (ValueError, "size: the text lacks the size of the images; give (width, height)", lambda: mrfgs.Rectification(sizeless)),
            (ValueError, "size: give (width, height), both above 0", lambda: mrfgs.Rectification(sizeless, (0, 180))),
            (ValueError, "size: give (width, height), both above 0", lambda: mrfgs.Rectification(sizeless, (-240, 180))),
            (TypeError, "size: give (width, height), two integers", lambda: mrfgs.Rectification(sizeless, left.shape)),
            (TypeError, "size: give (width, height), two integers", lambda: mrfgs.Rectification(sizeless, 240)),
            (TypeError, "size: give (width, height), two integers", lambda: mrfgs.Rectification(sizeless, (240.5, 180))),
            (ValueError, "alpha: give a number from 0 to 1, not 1.5", lambda: mrfgs.Rectification(CAMERAS, alpha=1.5)),
            (ValueError, "alpha", lambda: mrfgs.Rectification(CAMERAS, alpha=float("nan"))),
            (ValueError, "240 x 180 but these are 239 x 180", lambda: by.apply(left[:, 1:], right[:, 1:])),
            (ValueError, "240 x 180 but these are 239 x 180", lambda: by.apply(left, right[:, 1:])),
            (TypeError, "left: give an array of integers", lambda: by.apply(left > 9, right)),
            (TypeError, "right", lambda: by.apply(left, "right.png")),
            (ValueError, "mask", lambda: by.apply(left, right, mask=np.zeros((3, 3), bool))),
            (ValueError, "cameras.yml: describes images that are not rectified; use Rectification(...).rig", lambda: mrfgs.Rig(CAMERAS)),
            (ValueError, "the text: the calibration lacks cam0 and doffs and baseline", lambda: mrfgs.Rig(of_texts("ndisp=64\n"))),
            (ValueError, "baseline=0 is not above 0", lambda: mrfgs.Rig(of_texts("cam0=[9 0 2; 0 9 2; 0 0 1]\ndoffs=0\nbaseline=0\n"))),
        ):
            with self.subTest(words):
                self.refused(error, words, call)
        # Maps too large for any machine.
        flat = of_texts("cam0=[1e9 0 1e8; 0 1e9 1e8; 0 0 1]\ndoffs=0\nbaseline=20\n")
        self.refused(MemoryError, "of memory are needed", mrfgs.Rectification(flat, (1 << 28, 1 << 28)).maps)


class Depth(Folder):
    def test_a_rectified_pair_needs_its_calib_txt_alone(self):
        scene = TESTDATA / "mixed"
        program(self.folder, "match", scene / "im0.png", scene / "im1.png", "d.pfm", "--also", "depth,depth-mm,points", "--device", "cpu",
                "--quiet")
        left, right = read_png(scene / "im0.png"), read_png(scene / "im1.png")
        calibration = mrfgs.Calibration(scene / "calib.txt")
        found = mrfgs.match(left, right, calibration.max_disparity, device="cpu")
        rig = mrfgs.Rig(calibration)
        self.assertEqual(rig.size, left.shape[1::-1])
        self.assertTrue(np.array_equal(found.disparity, read_pfm(self.folder / "d.pfm")))
        self.assertTrue(np.array_equal(rig.depth(found.disparity), read_pfm(self.folder / "d.depth.pfm")))
        self.assertTrue(np.array_equal(rig.millimetres(found.disparity), read_png(self.folder / "d.depth-mm.png")))
        points = rig.points(found, left)
        points.save(str(self.folder / "python.ply"))
        expected = (self.folder / "d.points.ply").read_bytes()
        self.assertEqual((self.folder / "python.ply").read_bytes(), expected)
        # The arrays equal the contents of the file.
        dtype = [("position", "<f4", 3), ("colour", "u1", 3), ("quality", "<f4")]
        cloud = np.frombuffer(expected.split(b"end_header\n", 1)[1], dtype)
        self.assertTrue(np.array_equal(points.positions, cloud["position"]))
        self.assertTrue(np.array_equal(points.colours, cloud["colour"]))
        self.assertTrue(np.array_equal(points.confidence, cloud["quality"]))
        self.assertEqual((points.positions.dtype, points.colours.dtype, points.confidence.dtype), (np.float32, np.uint8, np.uint8))
        self.assertEqual(len(points), (found.validity == 0).sum())
        self.assertIn(str(len(points)), repr(points))
        # By definition: Z = baseline f / d at reliable pixels, row by row.
        y, x = np.nonzero(found.validity == 0)
        (f, _, cx), (_, _, cy) = rig.cameras[0][:2]
        z = rig.baseline * f / (found.disparity[y, x] + rig.doffs)
        self.assertLess(np.abs(points.positions - np.stack([(x - cx) * z / f, (y - cy) * z / f, z], 1)).max(), 1e-4 * z.max())
        self.assertTrue(np.array_equal(points.colours, left[y, x]))
        for other in (pickle.loads(pickle.dumps(points)), copy.deepcopy(points)):
            self.assertTrue(np.array_equal(other.positions, points.positions))
            self.assertEqual(other.unit, rig.unit)
        # A subset of a cloud is a cloud.
        near = points.positions[:, 2] < np.median(points.positions[:, 2])
        part = mrfgs.Points(points.positions[near].astype(np.float64), points.colours[near], points.confidence[near])
        part.save(self.folder / "part.ply")
        self.assertIn(b"unit that of the baseline\n", (self.folder / "part.ply").read_bytes())
        data = (self.folder / "part.ply").read_bytes().split(b"end_header\n", 1)[1]
        self.assertEqual(data, cloud[near].tobytes())
        self.assertEqual(len(mrfgs.Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0, np.uint8))), 0)

    def test_rectified_files_and_rectified_arrays_agree(self):
        program(self.folder, "rectify", RAW / "left.png", RAW / "right.png", "out", "--calib", CAMERAS, "--quiet")
        rig = mrfgs.Rectification(CAMERAS).rig
        disparity = np.random.default_rng(3).uniform(1, 31, (180, 240)).astype(np.float32)
        # calib.txt is in millimetres, cameras.yml in the unit of the calibration.
        for name, factor in (("calib.txt", 1000), ("cameras.yml", 1)):
            other = mrfgs.Rig(self.folder / "out" / name)
            self.assertTrue(np.array_equal(other.millimetres(disparity), rig.millimetres(disparity)))
            self.assertLess(np.abs(other.depth(disparity) / factor - rig.depth(disparity)).max(), 1e-5)

    def test_a_calibration_for_several_sizes(self):
        sizes = {"baseline": -50.0}
        for i, (width, height) in enumerate([(640, 480), (320, 240)]):
            for name, value in {"width": width, "height": height, "fx": 0.6 * width, "fy": 0.6 * width, "ppx": width / 2,
                                "ppy": height / 2}.items():
                sizes[f"rectified.{i}.{name}"] = value
        calibration = mrfgs.Calibration.of_texts(json.dumps(sizes))
        self.refused(ValueError, "is for images of 640 x 480, 320 x 240; say which", lambda: mrfgs.Rig(calibration))
        for size, depth in [((640, 480), 384 * 50 / 8), ((320, 240), 192 * 50 / 8)]:
            rig = mrfgs.Rig(calibration, size=size)
            self.assertAlmostEqual(float(rig.depth(np.full(size[::-1], 8, np.float32))[0, 0]), depth, places=3)

    def test_a_rig_of_numbers(self):
        left, right = pair()
        found = mrfgs.match(left, right, 15, device="cpu")
        text = "cam0=[700 0 39.5; 0 700 29.5; 0 0 1]\ndoffs={}\nbaseline=120\nwidth=80\nheight=60\n"
        for doffs, keywords in ((0, {}), (3, {"doffs": 3}), (0, {"principal_point": (39.5, 29.5)})):
            expected = mrfgs.Rig(mrfgs.Calibration.of_texts(text.format(doffs)))
            rig = mrfgs.Rig.of(700, 120, size=(80, 60), unit="mm", **keywords)
            self.assertTrue(np.array_equal(rig.cameras, expected.cameras))
            self.assertEqual((rig.baseline, rig.doffs, rig.unit, rig.size), (120, doffs, "mm", (80, 60)))
            self.assertTrue(np.array_equal(rig.depth(found.disparity), expected.depth(found.disparity)))
            self.assertTrue(np.array_equal(rig.millimetres(found.disparity), expected.millimetres(found.disparity)))
            self.assertTrue(np.array_equal(rig.points(found, left).positions, expected.points(found, left).positions))
        # Controls.
        other = mrfgs.Rig.of(700, 120, principal_point=(30, 29.5))
        self.assertIsNone(other.size)
        self.assertTrue(np.array_equal(other.depth(found.disparity), mrfgs.Rig.of(700, 120, size=(80, 60)).depth(found.disparity)))
        self.assertFalse(np.array_equal(other.points(found, left).positions, rig.points(found, left).positions))
        self.assertFalse(np.array_equal(mrfgs.Rig.of(701, 120, size=(80, 60)).depth(found.disparity), rig.depth(found.disparity)))
        self.refused(ValueError, "Rig.of: lacks the unit of the baseline", lambda: other.millimetres(found.disparity))

    def test_points_of_the_scene_are_a_prior(self):
        left, right = pair()
        # The middle rows are plain, and so say nothing of themselves.
        left[20:40], right[20:40] = 128, 128
        rig = mrfgs.Rig.of(100, 2, size=(80, 60), doffs=1)
        rows, columns = (grid.ravel() for grid in np.mgrid[2:60:6, 2:80:6])
        disparities = np.where(rows < 30, 4.0, 9.0)
        z = 200 / (disparities + 1)
        points = np.column_stack([(columns - 39.5) * z / 100, (rows - 29.5) * z / 100, z])
        seen = rig.seen(points)
        self.assertEqual((seen.dtype, seen.shape), (np.float64, points.shape))
        self.assertLess(np.abs(seen - np.column_stack([columns, rows, disparities])).max(), 1e-9)
        self.assertLess(np.abs(rig.seen(points.astype(np.float32)) - seen).max(), 1e-3)
        # Those behind the cameras, at their centre or just before it are not seen, and do not count.
        hidden = np.array([[0, 0, -3], [0, 0, 0], [0, 0, 1e-9], [np.nan, 0, 1]])
        self.assertTrue(np.isnan(rig.seen(hidden)).all())
        found = mrfgs.match(left, right, 15, device="cpu", prior=rig.seen(np.vstack([hidden, points])))
        rounded = mrfgs.match(left, right, 15, device="cpu", prior=np.round(seen))
        self.assertTrue(np.array_equal(found.disparity, rounded.disparity))
        # Control.
        self.assertFalse(np.array_equal(found.disparity, mrfgs.match(left, right, 15, device="cpu").disparity))
        self.refused(ValueError, "prior: none of the 4 points has", lambda: mrfgs.match(left, right, 15, device="cpu", prior=rig.seen(hidden)))
        self.refused(TypeError, "points: give an array of shape", lambda: rig.seen([[1, 2, 3]]))
        self.refused(ValueError, "points: give an array of shape", lambda: rig.seen(points[:, :2]))
        # They are in the frame of Points.positions, also after a rectification.
        rectification = mrfgs.Rectification(CAMERAS)
        views = rectification.apply(*raw_pair())
        matched = mrfgs.match(*views, 31, device="cpu")
        rows, columns = np.nonzero(matched.validity == 0)
        seen = rectification.rig.seen(rectification.rig.points(matched, views[0]).positions)
        self.assertLess(np.abs(seen - np.column_stack([columns, rows, matched.disparity[rows, columns]])).max(), 1e-2)

    def test_where_there_is_no_depth(self):
        rig = mrfgs.Rig(mrfgs.Calibration.of_texts("cam0=[100 0 2; 0 100 2; 0 0 1]\ndoffs=5\nbaseline=20\n"))
        self.assertIsNone(rig.size)
        disparity = np.array([[5, -5, -6, np.inf, np.nan, -np.inf, -4.99]])
        for kind in (np.float64, np.float32, ">f4", ">f8"):
            self.assertTrue(np.array_equal(rig.depth(disparity.astype(kind))[:, :6], [[200] + 5 * [np.inf]]))
            self.assertEqual(rig.millimetres(disparity.astype(kind)).tolist(), [[200, 0, 0, 0, 0, 0, 0]])
        masked = np.ma.masked_array(np.full((2, 3), 5.0), [[1, 0, 0], [0, 0, 1]])
        self.assertTrue(np.array_equal(np.isinf(rig.depth(masked)), masked.mask))
        ramp = np.arange(60, dtype=np.float32).reshape(6, 10)
        expected = 2000 / (ramp + 5)
        for other in (np.asfortranarray(ramp), ramp[::-1].copy()[::-1], np.repeat(ramp, 2, 1)[:, ::2], ramp.T.copy().T):
            self.assertTrue(np.array_equal(rig.depth(other), expected.astype(np.float32)))
        self.assertFalse(np.array_equal(rig.depth(ramp[::-1]), expected))

    def test_what_makes_no_sense_is_an_exception(self):
        left, right = pair()
        rig = mrfgs.Rig(mrfgs.Calibration.of_texts("cam0=[100 0 2; 0 100 2; 0 0 1]\ndoffs=5\nbaseline=20\n"))
        sized = mrfgs.Rig(mrfgs.Calibration.of_texts("cam0=[100 0 2; 0 100 2; 0 0 1]\ndoffs=5\nbaseline=20\nwidth=81\nheight=60\n"))
        found = mrfgs.match(left, right, 15, device="cpu")
        positions, colours, confidence = np.zeros((4, 3), np.float32), np.zeros((4, 3), np.uint8), np.zeros(4, np.uint8)
        points = mrfgs.Points(positions, colours, confidence)
        changed = copy.deepcopy(found)
        changed.disparity[:] = np.nan
        self.assertEqual(len(rig.points(changed, left)), 0)
        for error, words, call in (
            (TypeError, "disparity: give an array, such as Matched.disparity", lambda: rig.depth(found)),
            (TypeError, "divide integers by their scale", lambda: rig.depth(np.zeros((3, 3), np.int16))),
            (TypeError, "disparity", lambda: rig.depth("d.pfm")),
            (ValueError, "disparity: give an array of shape (height, width)", lambda: rig.depth(np.zeros(3))),
            (ValueError, "disparity: is 80 x 60, but the text is for images of 81 x 60", lambda: sized.depth(found.disparity)),
            (ValueError, "matched: is 80 x 60", lambda: sized.points(found, left)),
            (ValueError, "left: is 79 x 60 but the maps are 80 x 60", lambda: rig.points(found, left[:, 1:])),
            (TypeError, "left: give an array of integers", lambda: rig.points(found, left > 9)),
            (ValueError, "positions: give an array of shape (N, 3)", lambda: mrfgs.Points(positions[:, :2], colours, confidence)),
            (TypeError, "colours: give an array of shape (N, 3), uint8", lambda: mrfgs.Points(positions, colours / 255, confidence)),
            (ValueError, "unit: give mm, cm, m or unknown", lambda: mrfgs.Points(positions, colours, confidence, "feet")),
            (ValueError, "4 positions, 3 colours and 4 confidences", lambda: mrfgs.Points(positions, colours[1:], confidence)),
            (OSError, "python.xyz: point clouds end in .ply, .pcd, .las or .laz", lambda: points.save(self.folder / "python.xyz")),
            (OSError, "python.laz", lambda: mrfgs.Points(positions + np.inf, colours, confidence).save(self.folder / "python.laz")),
            (ValueError, "focal: give a number above 0, not -7", lambda: mrfgs.Rig.of(-7, 0.1, size=(8, 6))),
            (ValueError, "baseline: give a number above 0, not inf", lambda: mrfgs.Rig.of(7, np.inf, size=(8, 6))),
            (ValueError, "size: give (width, height) of the images, to use their centre", lambda: mrfgs.Rig.of(7, 0.1)),
            (ValueError, "size: give (width, height), both above 0", lambda: mrfgs.Rig.of(7, 0.1, size=(0, 6))),
            (ValueError, "principal_point and doffs: give finite numbers, not NaN", lambda: mrfgs.Rig.of(7, 0.1, principal_point=(1, np.nan))),
            (ValueError, "unit: give mm, cm, m or unknown, not \"feet\"", lambda: mrfgs.Rig.of(7, 0.1, size=(8, 6), unit="feet")),
            (ValueError, "disparity: is 80 x 60, but Rig.of is for images of 8 x 6", lambda: mrfgs.Rig.of(7, 0.1, size=(8, 6)).depth(found.disparity)),
            (OSError, "there is no folder", lambda: points.save(self.folder / "nowhere" / "python.ply")),
        ):
            with self.subTest(words):
                self.refused(error, words, call)
        self.assertEqual(os.listdir(self.folder), [])


class Evaluation(Folder):
    def test_the_figures_are_the_programs(self):
        random = np.random.default_rng(5)
        truth = random.uniform(0, 60, (50, 70)).astype(np.float32)
        truth[random.random(truth.shape) < 0.1] = np.inf
        map_ = truth + random.normal(0, 1.5, truth.shape).astype(np.float32)
        map_[~np.isfinite(map_)] = 3
        map_[random.random(truth.shape) < 0.05] = np.inf
        mask = random.choice([0, 128, 255], truth.shape, p=[0.1, 0.2, 0.7]).astype(np.uint8)

        def write_pfm(name, array):
            height, width = array.shape
            (self.folder / name).write_bytes(f"Pf\n{width} {height}\n-1\n".encode() + array[::-1].astype("<f4").tobytes())

        write_pfm("map.pfm", map_)
        write_pfm("truth.pfm", truth)
        (self.folder / "mask.pgm").write_bytes(b"P5\n70 50\n255\n" + mask.tobytes())
        program(self.folder, "evaluate", "map", "map.pfm", "--truth", "truth.pfm", "--json", "without.json")
        program(self.folder, "evaluate", "map", "map.pfm", "--truth", "truth.pfm", "--mask", "mask.pgm", "--json", "with.json")
        expected = {name: json.loads((self.folder / name).read_text())["pairs"][0]["final"] for name in ("with.json", "without.json")}
        found = mrfgs.evaluate(map_, truth, mask)
        self.assertEqual(found, expected["with.json"])
        self.assertEqual(list(found["all"]), list(expected["with.json"]["all"]))
        self.assertEqual(mrfgs.evaluate(map_, truth), expected["without.json"])
        self.assertIsNone(expected["without.json"]["nonocc"])
        # Files, with any scale factor in their header.
        expected_truth = np.where(np.isfinite(truth), truth, np.inf)
        bytes_ = (self.folder / "truth.pfm").read_bytes()
        for scale in (b"-1", b"-0.003922", b"-256.0"):
            (self.folder / "scaled.pfm").write_bytes(bytes_.replace(b"\n-1\n", b"\n" + scale + b"\n"))
            np.testing.assert_array_equal(mrfgs.read_disparity(self.folder / "scaled.pfm"), expected_truth)
        self.assertEqual(mrfgs.read_disparity(str(self.folder / "map.pfm")).dtype, np.float32)
        with self.assertRaisesRegex(FileNotFoundError, "nowhere.pfm"):
            mrfgs.read_disparity("nowhere.pfm")
        with self.assertRaisesRegex(ValueError, "mask.pgm"):
            mrfgs.read_disparity(self.folder / "mask.pgm")
        # By the definitions.
        known = np.isfinite(truth)
        error = np.abs(map_[known].astype(np.float64) - truth[known])
        valid = np.isfinite(error)
        everything = found["all"]
        self.assertEqual(everything["pixels"], known.sum())
        self.assertAlmostEqual(everything["avg"], error[valid].mean(), 12)
        self.assertAlmostEqual(everything["psnr"], 10 * np.log10(255**2 / (error[valid] ** 2).mean()), 9)
        for threshold in (0.5, 1.0, 2.0, 4.0):
            self.assertAlmostEqual(everything[f"bad{threshold}"], 100 * (~valid | (error > threshold)).mean(), 9)
        self.assertEqual(found["nonocc"]["pixels"], (known & (mask == 255)).sum())
        # The same with other kinds of arrays.
        for other in (mrfgs.evaluate(np.asfortranarray(map_), truth[::-1].copy()[::-1], mask == 255),
                      mrfgs.evaluate(map_.astype(">f8"), truth.astype(np.float64), np.asfortranarray(mask)),
                      mrfgs.evaluate(np.ma.masked_invalid(map_), np.ma.masked_array(np.where(known, truth, 7), ~known), mask)):
            self.assertEqual(other, found)
        # Controls: another map, another ground truth, another mask.
        self.assertNotEqual(mrfgs.evaluate(map_[::-1], truth, mask), found)
        self.assertNotEqual(mrfgs.evaluate(map_, np.ma.masked_array(np.where(known, truth, 7)), mask), found)
        self.assertNotEqual(mrfgs.evaluate(map_, truth, mask != 255), found)

    def test_what_does_not_exist_is_none(self):
        truth = np.ones((4, 5), np.float32)
        perfect = mrfgs.evaluate(truth, truth, np.zeros((4, 5), bool))
        self.assertIsNone(perfect["nonocc"])
        self.assertEqual((perfect["all"]["avg"], perfect["all"]["psnr"], perfect["all"]["bad0.5"]), (0, None, 0))
        nothing = mrfgs.evaluate(truth * np.inf, truth)["all"]
        self.assertEqual((nothing["avg"], nothing["density"], nothing["bad4.0"]), (None, 0, 100))

    def test_a_match_against_its_scene(self):
        scene = TESTDATA / "slanted"
        found = mrfgs.match(read_png(scene / "im0.png"), read_png(scene / "im1.png"), 31, device="cpu")
        figures = mrfgs.evaluate(found.disparity, read_pfm(scene / "disp0GT.pfm"), read_png(scene / "mask0nocc.png"))
        self.assertLess(figures["nonocc"]["avg"], 0.5)
        self.assertLess(figures["nonocc"]["bad2.0"], figures["all"]["bad2.0"] + 1)

    def test_what_makes_no_sense_is_an_exception(self):
        map_ = np.ones((4, 5), np.float32)
        for error, words, call in (
            (ValueError, "the disparity map is 5 x 4 and the ground truth 5 x 3", lambda: mrfgs.evaluate(map_, map_[1:])),
            (ValueError, "no known (finite) pixel", lambda: mrfgs.evaluate(map_, map_ * np.nan)),
            (ValueError, "the mask is 5 x 3", lambda: mrfgs.evaluate(map_, map_, np.ones((3, 5), bool))),
            (ValueError, "mask: give an array of bool, or of uint8 with 255", lambda: mrfgs.evaluate(map_, map_, np.ones((4, 5), np.uint8))),
            (TypeError, "mask: give an array of bool", lambda: mrfgs.evaluate(map_, map_, map_)),
            (TypeError, "truth: give an array of float16, float32 or float64", lambda: mrfgs.evaluate(map_, map_.astype(np.uint8))),
            (TypeError, "disparity: give an array of float16, float32", lambda: mrfgs.evaluate(map_ > 0, map_)),
            (ValueError, "truth: give an array of shape (height, width)", lambda: mrfgs.evaluate(map_, map_[None])),
        ):
            with self.subTest(words):
                self.refused(error, words, call)


class Sequences(Folder):
    def setUp(self):
        super().setUp()
        self.matcher = mrfgs.Matcher(device="cpu")

    def test_a_sequence_is_its_pairs_in_order(self):
        pairs = [pair(seed=seed) for seed in (1, 2, 3, 4, 1)] + [pair(50, 90, seed=6)]
        expected = [self.matcher.match(*images, 15).disparity for images in pairs]
        # Control: swapping two of them would be detected.
        self.assertFalse(np.array_equal(expected[0], expected[1]))
        for given in (pairs, iter(pairs), [list(images) for images in pairs], [np.stack(images) for images in pairs], zip(*zip(*pairs))):
            found = list(self.matcher.match_all(given, 15))
            self.assertEqual(len(found), len(expected))
            for one, other in zip(found, expected):
                self.assertIsInstance(one, mrfgs.Matched)
                self.assertTrue(np.array_equal(one.disparity, other))
        self.assertEqual(list(self.matcher.match_all([], 15)), [])
        # The arguments of `match`, and a separate range for each pair.
        found = list(self.matcher.match_all(pairs, 15, min_disparity=-2, method="fast", options={"fill": "none"}, no_data=7))
        for one, images in zip(found, pairs):
            self.assertTrue(np.array_equal(one.disparity, self.matcher.match(
                *images, 15, min_disparity=-2, method="fast", options={"fill": "none"}, no_data=7).disparity))
        large = [pair(200, 300, seed=seed) for seed in (1, 2)]
        for one, images in zip(self.matcher.match_all(large, options={"measure-every": 1}), large):
            self.assertEqual(one.max_disparity, mrfgs.match(*images, device="cpu").max_disparity)

    def plain(self, seed):
        """A pair whose middle rows are plain, and so say nothing of themselves, and points that do."""
        left, right = pair(seed=seed)
        left[20:40], right[20:40] = 128, 128
        rows, columns = (grid.ravel() for grid in np.mgrid[2:60:6, 2:80:6])
        return left, right, np.column_stack([columns, rows, np.where(rows < 30, 4.0, 9.0)])

    def test_pairs_have_priors_of_their_own(self):
        frames = [self.plain(seed) for seed in (1, 2, 3, 4)]
        surface = {"prior": np.full((60, 80), 4.0), "prior_sigma": np.full((60, 80), 2.0), "prior_kind": "surface"}
        given = [frames[0], (*frames[1][:2], None), (*frames[2][:2], surface), frames[3][:2]]
        arguments = [{"prior": frames[0][2]}, {}, surface, {}]
        alone = [self.matcher.match(*one[:2], 15, **more).disparity for one, more in zip(frames, arguments)]
        found = [one.disparity for one in self.matcher.match_all(given, 15)]
        self.assertEqual([np.array_equal(*both) for both in zip(found, alone)], [True] * 4)
        # Control: without priors, those that had one have other maps.
        without = [one.disparity for one in self.matcher.match_all([one[:2] for one in frames], 15)]
        self.assertEqual([np.array_equal(*both) for both in zip(found, without)], [False, True, False, True])

    def test_the_last_maps_are_known(self):
        frames = [self.plain(seed)[:2] for seed in (1, 1, 2)]
        own = [*frames[:2], self.plain(2)]
        following = [one.disparity for one in self.matcher.match_all(frames, 15, prior="last")]
        # A frame with a prior of its own takes that.
        instead = [one.disparity for one in self.matcher.match_all(own, 15, prior="last", warn=False)]
        self.assertEqual([np.array_equal(*both) for both in zip(instead, following)], [True, True, False])
        self.assertTrue(np.array_equal(instead[2], self.matcher.match(*frames[2], 15, prior=own[2][2]).disparity))
        first = self.matcher.match(*frames[0], 15)
        known = np.where(first.validity & ~np.uint8(8 + 16) == 0, first.disparity, np.nan)
        second = self.matcher.match(*frames[1], 15, prior=known, prior_kind="surface")
        self.assertEqual([np.array_equal(*both) for both in zip(following, (first.disparity, second.disparity))], [True, True])
        # Control: alone, the second frame has the map of the first, as it has its images.
        self.assertFalse(np.array_equal(following[1], first.disparity))

    def test_rectified_on_the_way(self):
        left, right = raw_pair()
        by = mrfgs.Rectification(CAMERAS)
        expected = self.matcher.match(*by.apply(left, right), 31).disparity
        frames = [(left, right), (left, right)]
        for found in self.matcher.match_all((by.apply(*frame) for frame in frames), 31):
            self.assertTrue(np.array_equal(found.disparity, expected))

    def test_no_more_pairs_are_taken_than_are_needed(self):
        taken = []

        def endless():
            for i in itertools.count():
                taken.append(i)
                yield pair(seed=1)

        results = self.matcher.match_all(endless(), 15)
        self.assertEqual(taken, [])
        for i, _ in enumerate(itertools.islice(results, 6)):
            # Result i, with at most two pairs read ahead.
            self.assertEqual(len(taken), i + 3)
        results.close()
        self.assertEqual(len(taken), 8)
        self.assertEqual(list(results), [])

    def test_steady_maps_are_those_of_the_program(self):
        left, right = pair(90, 120)
        random = np.random.default_rng(3)
        frames = [[np.minimum(255, view + random.integers(0, 4, view.shape)).astype(np.uint8) for view in (left, right)] for _ in range(4)]
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            for i, name in enumerate(("left", "right")):
                (folder / name).mkdir()
                for step, frame in enumerate(frames):
                    write_ppm(folder / name / f"{step}.ppm", frame[i])
            program(folder, "sequence", "left", "right", "maps", "--max-disparity", 15, "--device", "cpu", "--steady", "--quiet")
            expected = [read_pfm(folder / "maps" / f"{step}.pfm") for step in range(4)]
        steady, alone = mrfgs.Steady(), list(self.matcher.match_all(frames, 15))
        for step, (found, frame) in enumerate(zip(alone, frames)):
            led = steady.follow(found, frame[0])
            self.assertTrue(np.array_equal(led.disparity, expected[step]), step)
            for name in ("raw", "confidence", "sigma", "validity"):
                self.assertIs(getattr(led, name), getattr(found, name))
            # Control: only the first frame has no history.
            self.assertEqual(np.array_equal(led.disparity, found.disparity), step == 0, step)
        self.refused(ValueError, "left: is 120 x 89 but the maps are 120 x 90", lambda: steady.follow(alone[0], left[1:]))
        self.refused(TypeError, "Matched", lambda: steady.follow(alone[0].disparity, left))

    def test_a_rig_that_has_turned_is_corrected_as_the_program_does(self):
        left, right = (read_png(TESTDATA / "slanted" / name) for name in ("im0.png", "im1.png"))
        # Pitch and roll of the right camera in radians; points turn the opposite way.
        x, z = np.radians([0.4, -0.5])
        up = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
        before = up @ np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
        text = "%YAML:1.0\n---\nimageSize: [ 240, 180 ]\nunit: m\n"
        lens = np.array([[180, 0, 119.5], [0, 180, 89.5], [0, 0, 1]])
        for name, matrix in (("K1", lens), ("D1", np.zeros((5, 1))), ("K2", lens), ("D2", np.zeros((5, 1))), ("R", before),
                             ("T", -0.16 * before[:, :1])):
            rows, columns = matrix.shape
            values = ", ".join(f"{value!r}" for value in matrix.ravel().astype(float).tolist())
            text += f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {values} ]\n"
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            (folder / "wrong.yml").write_text(text)
            for name, view in (("left", left), ("right", right)):
                (folder / name).mkdir()
                for step in range(4):
                    write_ppm(folder / name / f"{step}.ppm", view)
            program(folder, "sequence", "left", "right", "maps", "--rectify", "--calib", "wrong.yml", "--max-disparity", 31, "--device",
                    "cpu", "--recalibrate", "--json", "records.json", "--quiet")
            expected = [read_pfm(folder / "maps" / f"{step}.pfm") for step in range(4)]
            turned = json.loads((folder / "records.json").read_text().splitlines()[-1])["turned"]
        calibrated = mrfgs.Rectification(mrfgs.Calibration.of_texts(text))
        drift, by, maps = mrfgs.Drift(calibrated), calibrated, []
        self.assertIsNone(drift.turn)
        self.assertIsNone(drift.correct())
        for step in range(4):
            views = by.apply(left, right)
            drift.follow(*views, 31)
            maps.append(self.matcher.match(*views, 31, warn=False).disparity)
            self.assertTrue(np.array_equal(maps[-1], expected[step]), step)
            by = drift.correct() or by
        # Control: later frames were corrected, the first one was not.
        self.assertFalse(np.array_equal(maps[0], maps[-1]))
        turn = drift.turn
        self.assertEqual(sorted(turn), ["counts", "degrees", "errors", "matches", "rows"])
        self.assertTrue(turn["counts"] and turn["rows"] > 1 and turn["matches"] > 100)
        self.assertTrue(np.allclose(turn["degrees"], turned, atol=1e-3), (turn, turned))
        self.assertTrue(np.allclose(np.array(turn["degrees"])[[0, 2]], [0.4, -0.5], atol=0.05))
        self.assertTrue(max(turn["errors"]) < 0.1)
        # The result is an ordinary rectification, also if the rig turns again.
        again = mrfgs.Drift(by)
        again.follow(*calibrated.apply(left, right), 31)
        twice = again.correct()
        for corrected in (by, twice):
            self.assertFalse(np.array_equal(corrected.rotations[1], calibrated.rotations[1]))
            self.assertTrue(np.array_equal(corrected.rotations[0], calibrated.rotations[0]))
            self.assertTrue(np.array_equal(corrected.rig.depth(maps[-1]), calibrated.rig.depth(maps[-1])))
            for other in (copy.copy(corrected), pickle.loads(pickle.dumps(corrected))):
                self.assertTrue(np.array_equal(other.rotations, corrected.rotations))
                self.assertEqual(other.cameras_yml(), corrected.cameras_yml())
        self.assertFalse(np.array_equal(by.rotations[1], twice.rotations[1]))
        self.refused(ValueError, "240 x 180 pixels, but these images have 240 x 179", lambda: drift.follow(left[1:], right[1:], 31))
        self.refused(ValueError, "disparit", lambda: drift.follow(left, right, -1))
        self.refused(TypeError, "max_disparity", lambda: drift.follow(left, right, None))
        self.refused(TypeError, "max_disparity", lambda: drift.follow(left, right))
        self.refused(ValueError, "matches", lambda: mrfgs.Drift(mrfgs.Rectification.of_pair(*raw_pair())))
        self.refused(TypeError, "Rectification", lambda: mrfgs.Drift(CAMERAS))

    def test_memory_does_not_grow_with_the_sequence(self):
        class Array(np.ndarray):
            __hash__ = object.__hash__

        alive, most = weakref.WeakSet(), 0

        def pairs():
            for seed in range(12):
                left, right = (image.view(Array) for image in pair(seed=seed))
                alive.add(left)
                yield left, right
                del left, right

        for found in self.matcher.match_all(pairs(), 15):
            del found
            gc.collect()
            most = max(most, len(alive))
        self.assertLessEqual(most, 3)

    def test_exceptions_of_the_pairs_come_after_the_results_before(self):
        class Own(Exception):
            pass

        def broken():
            yield pair(seed=1)
            yield pair(seed=2)
            raise Own("the camera is gone")

        results = self.matcher.match_all(broken(), 15)
        found = []
        with self.assertRaises(Own) as raised:
            for one in results:
                found.append(one)
        self.assertEqual((len(found), str(raised.exception)), (2, "the camera is gone"))
        self.assertEqual(list(results), [])
        # The matcher is available again.
        self.matcher.match(*pair(), 15)
        left, right = pair()
        for error, words, bad in (
            (TypeError, "pair 1: left: give an array of integers", (left > 9, right)),
            (ValueError, "pair 1: the left image is 80 x 60 and the right one is 79 x 60", (left, right[:, 1:])),
            (TypeError, "pair 1: give two arrays, left and right", left),
            (TypeError, "pair 1: give two arrays, left and right", None),
            (TypeError, "pair 1: give two arrays, left and right", {"left": left, "right": right}),
            (TypeError, "pair 1: give two arrays, left and right", (left, right, None, None)),
            (TypeError, "pair 1: prior: give an array of float16, float32 or float64", (left, right, left)),
            (ValueError, "pair 1: prior: give a map of the left image, of shape (60, 80)", (left, right, np.ones((9, 9)))),
            (ValueError, "pair 1: prior_sigma, prior_kind: give a prior too", (left, right, {"prior_sigma": 1})),
            (TypeError, "pair 1: prior_kind: give \"points\" or \"surface\"", (left, right, {"prior": np.ones((9, 3)), "prior_kind": 7})),
            (TypeError, "pair 1: prior: 'sigma' is none of prior, prior_sigma, prior_kind", (left, right, {"prior": np.ones((9, 3)), "sigma": 7})),
        ):
            found = []

            def go():
                for one in self.matcher.match_all([(left, right), bad, (left, right)], 15):
                    found.append(one)

            self.refused(error, words, go)
            self.assertEqual(len(found), 1)
        # Errors of the match itself.
        self.refused(ValueError, "pair 0: no range of disparities found", lambda: list(self.matcher.match_all([(left * 0, right * 0)])))
        self.refused(ValueError, "pair 0: memory: 1 MiB", lambda: list(self.matcher.match_all([(left, right)], 15, options={"memory": 1})))
        # Errors before any pair is read.
        taken = iter([(left, right)])
        for error, words, call in (
            (ValueError, "neither a preset nor a file", lambda: self.matcher.match_all(taken, 15, method="best")),
            (ValueError, "max_disparity", lambda: self.matcher.match_all(taken, -5)),
            (TypeError, "pairs: give an iterable of pairs", lambda: self.matcher.match_all(7, 15)),
            (TypeError, "prior: give \"last\"", lambda: self.matcher.match_all(taken, 15, prior="first")),
            (TypeError, "prior: give \"last\"", lambda: self.matcher.match_all(taken, 15, prior=np.ones((60, 80)))),
        ):
            self.refused(error, words, call)
        self.assertEqual(len(list(taken)), 1)

    def test_what_ends_a_program_ends_a_sequence_at_once(self):
        def interrupted():
            yield pair(seed=1)
            raise KeyboardInterrupt

        with self.assertRaises(KeyboardInterrupt):
            next(self.matcher.match_all(interrupted(), 15))
        self.matcher.match(*pair(), 15)

    def test_closing_early(self):
        closed = []

        def pairs():
            try:
                while True:
                    yield pair(400, 600)
            finally:
                closed.append(True)

        # Before the first pair there is nothing to release.
        results = self.matcher.match_all(pairs(), 63, warn=False)
        results.close()
        self.assertEqual(list(results), [])
        results = self.matcher.match_all(pairs(), 63, warn=False)
        next(results)
        # The iterator holds the matcher until it ends.
        self.refused(RuntimeError, "in the middle of match_all", lambda: self.matcher.match(*pair(), 15))
        self.refused(RuntimeError, "in the middle of match_all", lambda: next(self.matcher.match_all([pair()], 15)))
        self.assertEqual(closed, [])
        start = time.monotonic()
        results.close()
        results.close()
        self.assertLess(time.monotonic() - start, 5)
        self.assertEqual(closed, [True])
        self.matcher.match(*pair(), 15)
        with contextlib.closing(self.matcher.match_all(pairs(), 15, warn=False)) as results:
            next(results)
        self.matcher.match(*pair(), 15)
        # Leaving the loop releases the matcher.
        for found in self.matcher.match_all(pairs(), 15, warn=False):
            break
        self.matcher.match(*pair(), 15)
        self.assertEqual(closed, [True] * 3)

    def test_one_at_a_time(self):
        def pairs():
            yield pair(seed=1)
            with self.assertRaises(ValueError) as raised:
                next(results)
            said.append(str(raised.exception))
            yield pair(seed=2)

        said = []
        results = self.matcher.match_all(pairs(), 15)
        self.assertEqual(len(list(results)), 2)
        self.assertIn("already in use", said[0])
        # Another thread may request the next result.
        results, found = self.matcher.match_all([pair(seed=1), pair(seed=2)], 15), []
        for _ in range(2):
            thread = threading.Thread(target=lambda: found.append(next(results)))
            thread.start()
            thread.join()
        self.assertEqual(len(found), 2)

    def test_warnings(self):
        left, right = pair(200, 300)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            self.assertEqual(len(list(self.matcher.match_all([(right, left), (left, right)], 9))), 2)
        said = [str(w.message) for w in caught]
        self.assertTrue(all(w.category is mrfgs.MatchWarning and w.filename == __file__ for w in caught))
        self.assertTrue(any("swapped" in text for text in said) and any("raise max_disparity" in text for text in said), said)
        # Faults of the cameras are told once, and again for another size or if every pair is measured.
        small = left[:150], right[:150]
        for pairs, options, count in (
            ([(right, left)] * 3, {}, 1),
            ([(right, left), small[::-1], small[::-1]], {}, 2),
            ([(right, left)] * 3, {"measure-every": 1}, 3),
        ):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                list(self.matcher.match_all(pairs, 9, options=options))
            self.assertEqual(sum("swapped" in str(w.message) for w in caught), count)
        with warnings.catch_warnings():
            warnings.simplefilter("error", mrfgs.MatchWarning)
            with self.assertRaises(mrfgs.MatchWarning):
                list(self.matcher.match_all([(right, left)], 15))
            list(self.matcher.match_all([(right, left)], 15, warn=False))

    def test_other_threads_run_meanwhile(self):
        views = [pair(400, 600)] * 2
        self.assertGreater(ticks_during(lambda: list(self.matcher.match_all(views, 63))), 5)

    @unittest.skipIf(sys.platform == "win32", "no signals there")
    def test_ctrl_c_ends_a_sequence(self):
        # Tests that run in the background may ignore Ctrl-C.
        code = ("import itertools, signal, numpy as np, mrfgs\n"
                "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
                "a = np.random.default_rng(1).integers(0, 256, (1500, 1500), dtype=np.uint8)\n"
                "matcher = mrfgs.Matcher(device='cpu')\n"
                "results = matcher.match_all(itertools.repeat((a, a)), 255, options={'final-iterations': 1000}, warn=False)\n"
                "print('ready', flush=True)\n"
                "try: next(results)\n"
                "except KeyboardInterrupt: print('told', list(results), matcher.match(a[:60, :80], a[:60, :80], 15, warn=False))\n")
        with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            self.addCleanup(process.kill)
            self.assertEqual(process.stdout.readline(), "ready\n")
            time.sleep(1)
            process.send_signal(signal.SIGINT)
            said, told = process.communicate(timeout=60)
        self.assertTrue(said.startswith("told [] <mrfgs.Matched: 80 x 60"), said + told)

    def test_an_open_sequence_does_not_keep_the_program(self):
        code = ("import itertools, numpy as np, mrfgs; a = np.random.default_rng(1).integers(0, 256, (60, 80), dtype=np.uint8)\n"
                "results = mrfgs.Matcher(device='cpu').match_all(itertools.repeat((a, a)), 15, warn=False)\n"
                "print(next(results))\n")
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
        self.assertEqual((done.returncode, done.stderr), (0, ""))


# The maps of a match.
MAPS = ("disparity", "raw", "confidence", "sigma", "validity")


def coarse_pair(height, width, seed=1):
    """A grey pair whose texture a smaller copy still shows: disparity 8 in the upper half, 16 in the lower."""
    random = np.random.default_rng(seed)
    texture = np.kron(random.integers(0, 256, (height // 4 + 1, width // 4 + 10), dtype=np.uint8), np.ones((4, 4), np.uint8))[:height]
    left, right = texture[:, :width].copy(), np.empty((height, width), np.uint8)
    for rows, d in ((slice(0, height // 2), 8), (slice(height // 2, height), 16)):
        right[rows] = texture[rows, d:d + width]
    return left, right


def joined(blocks, matched=None):
    """The whole maps of all blocks, as a dict."""
    (width, height), maps = blocks.size, {}
    for i, found in enumerate(matched or map(blocks.match, range(len(blocks)))):
        x, y, columns, rows = blocks.part(i)
        for name in MAPS:
            part = getattr(found, name)
            assert part.shape == (rows, columns), name
            maps.setdefault(name, np.full((height, width), 77, part.dtype))[y:y + rows, x:x + columns] = part
    return maps


class LargePairs(Folder):
    """Pairs in files that are matched in blocks."""

    KEYWORDS = {"method": "fast", "memory": "32MiB", "device": "cpu"}
    FLAGS = ("--method", "fast", "--memory", "32MiB", "--device", "cpu")

    def setUp(self):
        super().setUp()
        self.write_pair("", *coarse_pair(520, 700))
        self.paths = [self.folder / "left.ppm", self.folder / "right.ppm"]

    def write_pair(self, before, left, right):
        write_ppm(self.folder / f"{before}left.ppm", left)
        write_ppm(self.folder / f"{before}right.ppm", right)

    def check(self, blocks, views, *flags):
        """Compares the joined blocks with the maps of the program."""
        self.assertGreater(len(blocks), 2)
        program(self.folder, "match", *views, "map.pfm", *self.FLAGS, *flags, "--quiet", "--blocks", f"job{views[0]}",
                "--also", "raw,confidence,sigma,validity")
        maps = joined(blocks)
        self.assertEqual(maps["disparity"].tobytes(), read_pfm(self.folder / "map.pfm").tobytes())
        for name in ("raw", "sigma"):
            self.assertEqual(maps[name].tobytes(), read_pfm(self.folder / f"map.{name}.pfm").tobytes(), name)
        for name in ("confidence", "validity"):
            self.assertEqual(maps[name].tobytes(), read_png(self.folder / f"map.{name}.png").tobytes(), name)

    def test_blocks_have_the_bytes_of_the_program(self):
        blocks = mrfgs.Blocks(*self.paths, 31, **self.KEYWORDS)
        self.check(blocks, ("left.ppm", "right.ppm"), "--max-disparity", 31)
        self.assertEqual((blocks.size, blocks.min_disparity, blocks.max_disparity), ((700, 520), 0, 31))
        self.assertIn(f"{len(blocks)} of 700 x 520, disparities 0 to 31", repr(blocks))
        self.assertEqual(sum(width * height for _, _, width, height in map(blocks.part, range(len(blocks)))), 700 * 520)
        # Of 16 bits, so that levels depend on the whole pair; off by a row; with a mask and a value for no data; without a range.
        left, right = coarse_pair(520, 700, seed=2)
        left, right = left.astype(np.uint16) * 9 + 3, np.roll(right, 1, axis=0).astype(np.uint16) * 9 + 3
        left[:100], right[:100] = left[:100] // 8, right[:100] // 8
        left[200:220, 300:310] = 0
        self.write_pair("16", left, right)
        mask = np.zeros((520, 700), np.uint8)
        mask[400:450, 20:300] = 255
        write_ppm(self.folder / "mask.ppm", mask)
        views = ("16left.ppm", "16right.ppm")
        blocks = mrfgs.Blocks(*(self.folder / view for view in views), min_disparity=-2, mask=self.folder / "mask.ppm", no_data=0,
                              warn=False, **self.KEYWORDS)
        _, (_, _, (_, _, (offset, *_), _)) = blocks.__reduce__()
        self.assertTrue(200 < abs(offset) < 300, "there is something to correct: a row of 256 parts")
        self.check(pickle.loads(pickle.dumps(blocks)), views, "--min-disparity", -2, "--mask", "mask.ppm", "--no-data", 0)

    def test_blocks_open_where_they_arrive(self):
        here = os.getcwd()
        os.chdir(self.folder)
        try:
            blocks = mrfgs.Blocks("left.ppm", "right.ppm", 15, threads=1, **self.KEYWORDS)
        finally:
            os.chdir(here)
        again = pickle.loads(pickle.dumps(blocks))
        self.assertIsNot(again, blocks)
        self.assertIs(pickle.loads(pickle.dumps(again)), again, "one for each process")
        self.assertIs(copy.copy(again), again)
        other = mrfgs.Blocks(*self.paths, 16, threads=1, **self.KEYWORDS)
        self.assertEqual(pickle.loads(pickle.dumps(other)).max_disparity, 16)
        expected = joined(blocks)
        for way in multiprocessing.get_all_start_methods():
            with multiprocessing.get_context(way).Pool(2) as pool:
                found = joined(blocks, pool.map_async(blocks.match, range(len(blocks)), chunksize=1).get(timeout=240))
            self.assertTrue(all(np.array_equal(found[name], expected[name]) for name in MAPS), way)
        with multiprocessing.pool.ThreadPool(4) as pool:
            found = joined(blocks, pool.map_async(pickle.loads(pickle.dumps(blocks)).match, range(len(blocks))).get(timeout=240))
        self.assertTrue(all(np.array_equal(found[name], expected[name]) for name in MAPS))

    def test_what_has_changed_is_refused(self):
        blocks = mrfgs.Blocks(*self.paths, 15, **self.KEYWORDS)
        pickled = pickle.dumps(blocks)
        expected = blocks.match(0).disparity
        make, state = blocks.__reduce__()
        self.refused(RuntimeError, "these blocks come from mrfgs 0.0.1", lambda: make("0.0.1", *state[1:]))
        with open(self.paths[1], "ab") as file:
            file.write(b"more")
        self.refused(ValueError, "right.ppm has changed since it was first opened; start again", lambda: pickle.loads(pickled).match(0))
        # An error does not stay.
        os.truncate(self.paths[1], os.path.getsize(self.paths[1]) - 4)
        self.assertTrue(np.array_equal(pickle.loads(pickled).match(0).disparity, expected))
        self.paths[1].unlink()
        pickled = pickle.dumps(mrfgs.PairWindows(self.paths[0], self.paths[0]))
        self.paths[0].unlink()
        self.refused(FileNotFoundError, "left.ppm: ", lambda: pickle.loads(pickled).window(0, 0, 9, 9))

    def test_windows_are_what_match_takes(self):
        windows = mrfgs.PairWindows(*map(str, self.paths))
        self.assertEqual((windows.size, repr(windows)), ((700, 520), "<mrfgs.PairWindows: 700 x 520>"))
        whole = [mrfgs.read_image(path) for path in self.paths]
        parts = windows.window(100, 50, 300, 200)
        for part, image in zip(parts, whole):
            self.assertEqual((part.shape, part.dtype, part.mask.any()), ((200, 300, 3), np.uint8, False))
            self.assertTrue(all(np.array_equal(part[..., i], image[50:250, 100:400]) for i in range(3)))
        expected = mrfgs.match(*(image[50:250, 100:400] for image in whole), 15, device="cpu")
        again = pickle.loads(pickle.dumps(windows))
        self.assertIs(pickle.loads(pickle.dumps(again)), again)
        found = mrfgs.match(*again.window(100, 50, 300, 200), 15, device="cpu")
        self.assertTrue(np.array_equal(found.disparity, expected.disparity))
        # The levels of 16 bits are those of the whole pair: 9 bits here, in all windows.
        left, right = coarse_pair(80, 100)
        left, right = (np.where(np.arange(100) < 50, view // 4, view.astype(np.uint16) * 2) for view in (left, right))
        left[3, 4] = 9999
        self.write_pair("16", left.astype(np.uint16), right.astype(np.uint16))
        windows = mrfgs.PairWindows(self.folder / "16left.ppm", self.folder / "16right.ppm", no_data=9999)
        whole = windows.window(0, 0, 100, 80)[0]
        self.assertEqual((whole.dtype, whole.mask[3, 4].all(), whole.mask.sum()), (np.uint16, True, 3))
        self.assertTrue(np.array_equal(np.delete(whole[..., 0].data, 3, 0), np.delete(left.astype(np.uint16) * 128, 3, 0)))
        self.assertTrue(np.array_equal(windows.window(10, 20, 30, 40)[0], whole[20:60, 10:40]))

    def test_what_makes_no_sense_is_an_exception(self):
        left, right = self.paths
        views = [mrfgs.read_image(path) for path in self.paths]
        blocks, windows = mrfgs.Blocks(left, right, 15, **self.KEYWORDS), mrfgs.PairWindows(left, right)
        write_ppm(self.folder / "small.ppm", np.zeros((7, 7), np.uint8))
        small, count = self.folder / "small.ppm", len(blocks)
        for error, words, call in (
            (TypeError, "left: give the path of a file; arrays are matched by mrfgs.match", lambda: mrfgs.Blocks(*views, 15)),
            (TypeError, "mask: give the path of a file", lambda: mrfgs.PairWindows(left, right, views[0])),
            (FileNotFoundError, "nowhere.png: ", lambda: mrfgs.Blocks(left, "nowhere.png", 15)),
            (ValueError, "it is a folder or a pipe; give a file", lambda: mrfgs.Blocks(left, self.folder, 15)),
            (ValueError, "the same size", lambda: mrfgs.Blocks(left, small, 15)),
            (ValueError, "small.ppm", lambda: mrfgs.PairWindows(left, right, small)),
            (ValueError, "neither a preset nor a file", lambda: mrfgs.Blocks(left, right, 15, method="best")),
            (ValueError, "max_disparity: give a whole number", lambda: mrfgs.Blocks(left, right, 15.5)),
            (ValueError, "threads", lambda: mrfgs.Blocks(left, right, 15, threads=0)),
            (ValueError, "memory: 1 MiB", lambda: mrfgs.Blocks(left, right, 15, memory="1MiB")),
            (ValueError, "if it really is that large, raise max_pixels of Blocks or PairWindows, or crop it",
             lambda: mrfgs.Blocks(left, right, 15, max_pixels=1000)),
            (IndexError, f"block {count}: give one of the {count} blocks, 0 to {count - 1}", lambda: blocks.match(count)),
            (IndexError, f"block 99: give one of the {count} blocks", lambda: blocks.part(99)),
            (ValueError, "a pair of 700 x 520", lambda: windows.window(600, 0, 101, 5)),
            (ValueError, "a pair of 700 x 520", lambda: windows.window(600, 0, 5, 0)),
        ):
            with self.subTest(words):
                self.refused(error, words, call)
        # A device that does not exist is missed by the first match alone, as only the machines that match need one.
        blocks = mrfgs.Blocks(left, right, 15, **{**self.KEYWORDS, "device": "no such device"})
        self.refused(ValueError, "device: no ", lambda: blocks.match(0))

    def test_probable_faults_are_warnings(self):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            mrfgs.Blocks(*self.paths[::-1], 15, **self.KEYWORDS)
        self.assertIn("swapped", str(told[0].message))
        self.assertIs(told[0].category, mrfgs.MatchWarning)


class ManyPairs(Folder):
    def test_each_pair_is_matched_by_itself(self):
        views = [pair(), pair(80, 120, seed=2), pair(seed=3)]
        paths = [self.folder / "left.ppm", str(self.folder / "right.ppm")]
        for path, view in zip(paths, views[1]):
            write_ppm(Path(path), view)
        damaged = self.write("damaged.png", "no image")
        matcher = mrfgs.Matcher(device="cpu")
        prior = np.array([[40.0, 10.0, 4.0]])
        known = {"prior": prior, "prior_sigma": 0.5}
        wanted = [views[0], paths, (paths[0], views[1][1]), (paths[0], damaged), (*views[2], prior), (*views[2], known),
                  (views[0][0], views[1][1]), 5, "ab", ("nowhere.png", paths[1]), (*views[2], {"sigma": 1}), [*views[2], None]]
        found = list(mrfgs.match_many(iter(wanted), 15, matcher=matcher, method="fast", warn=False))
        self.assertEqual(len(found), len(wanted))
        arguments = {"method": "fast", "warn": False}
        expected = [matcher.match(*both, 15, **arguments, **more) for both, more in (
            (views[0], {}), (views[1], {}), (views[1], {}), (views[2], {"prior": prior}), (views[2], known), (views[2], {}))]
        for i, other in zip((0, 1, 2, 4, 5, 11), expected):
            self.assertTrue(np.array_equal(found[i].disparity, other.disparity), i)
        two = "give two arrays or paths"
        for i, (error, words) in {3: (ValueError, "damaged.png"), 6: (ValueError, "the same size"), 7: (TypeError, two),
                                  8: (TypeError, two), 9: (FileNotFoundError, "nowhere.png"),
                                  10: (TypeError, "prior: 'sigma' is none of prior, prior_sigma, prior_kind")}.items():
            self.assertIs(type(found[i]), error, i)
            self.assertIn(words, str(found[i]))
            self.assertIsNone(found[i].__traceback__)
            self.assertIs(type(pickle.loads(pickle.dumps(found[i]))), error)
        # Each has a range of its own.
        one, two = mrfgs.match_many([pair(200, 300), [np.roll(view, 3 * i, 1) for i, view in enumerate(pair(200, 300))]], matcher=matcher)
        self.assertNotEqual(one.min_disparity, two.min_disparity)

    def test_what_no_pair_could_mend_is_raised(self):
        matcher = mrfgs.Matcher(device="cpu")
        for error, words, call in (
            (ValueError, "neither a preset nor a file", lambda: mrfgs.match_many([], 15, matcher=matcher, method="best")),
            (ValueError, "max_disparity: give a whole number", lambda: mrfgs.match_many([], 1.5, matcher=matcher)),
            (TypeError, "matcher: give a mrfgs.Matcher, not str", lambda: mrfgs.match_many([], 15, matcher="cpu")),
            (TypeError, "pairs: give an iterable of pairs of arrays or paths", lambda: mrfgs.match_many(5, 15, matcher=matcher)),
        ):
            self.refused(error, words, call)

        def broken():
            yield pair()
            raise KeyError("camera")

        results = mrfgs.match_many(broken(), 15, matcher=matcher)
        self.assertIsInstance(next(results), mrfgs.Matched)
        self.assertRaises(KeyError, next, results)


def digest(*things):
    """A checksum of all arrays and texts."""
    found = 0
    for thing in things:
        bytes_ = np.ascontiguousarray(np.ma.filled(thing, 0)).tobytes() if isinstance(thing, np.ndarray) else str(thing).encode()
        found = zlib.crc32(bytes_, found)
    return found


def everything(matcher=None):
    """A checksum of the results of all functions."""
    matcher = matcher or mrfgs.Matcher(device="cpu")
    views, raw = pair(200, 300), raw_pair()
    found = matcher.match(*views)
    maps = [matcher.match(*views, 15, roi=(100, 50, 90, 60)).disparity]
    maps += [one.disparity for one in matcher.match_all([views] * 3, 15)]
    maps += [mrfgs.match(*views, 15, device="cpu", threads=2, warn=False).disparity]
    by, of_pair = mrfgs.Rectification(CAMERAS), mrfgs.Rectification.of_pair(*raw)
    maps += [*by.apply(*raw), *by.maps()[1], *of_pair.apply(*raw), mrfgs.read_image(RAW / "left.png")]
    drift = mrfgs.Drift(by)
    drift.follow(*by.apply(*raw), 31)
    maps += [mrfgs.Steady().follow(found, views[0]).disparity, by.rig.depth(found.disparity[:180, :240])]
    return digest(*maps, found.disparity, drift.turn, mrfgs.evaluate(found.disparity, found.disparity))


def matched_by_a_worker(seed):
    return digest(mrfgs.match(*pair(200, 300, seed=seed), device="cpu").disparity)


# Runs functions in the child processes of the tests below.
FORKED = '''
import os, pickle, signal, sys, threading, time, traceback, itertools

def forked(call, leave=os._exit):
    """The result of `call` in a forked child, which is killed if it hangs."""
    read, write = os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            os.close(read)
            os.write(write, pickle.dumps(call()))
            os.close(write)
            status = 0
        except BaseException:
            traceback.print_exc()
        sys.stdout.flush()
        leave(status)
    os.close(write)
    for _ in range(1200):
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        time.sleep(0.1)
    else:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise SystemExit("the child hangs")
    assert status == 0, f"the child ended with {status}"
    with os.fdopen(read, "rb") as file:
        return pickle.load(file)
'''


@unittest.skipUnless(hasattr(os, "fork"), "no forks there")
class Processes(unittest.TestCase):
    """Child processes by fork, spawn and forkserver. A child that hangs is killed, and its test fails."""

    def apart(self, code, said, **environment):
        """Runs `code` in a separate Python, which must print `said`."""
        before = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\nfrom test_mrfgs import *\n"
        with subprocess.Popen([sys.executable, "-c", FORKED + before + textwrap.dedent(code)], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, text=True, env={**os.environ, **environment}, start_new_session=True) as process:
            try:
                out, wrong = process.communicate(timeout=300)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                self.fail("it hangs")
        self.assertEqual((out.strip(), process.returncode), (said, 0), wrong)

    def test_everything_works_in_a_child_as_in_its_parent(self):
        self.apart("""
            matcher = mrfgs.Matcher(device="cpu")
            # Before and after any other work.
            same = [forked(everything), forked(lambda: everything(matcher))]
            expected = everything(matcher)
            same += [forked(everything), forked(lambda: everything(matcher)), forked(lambda: everything(matcher), leave=sys.exit)]
            # A grandchild, and the parent after all of them.
            same += [forked(lambda: forked(lambda: everything(matcher))), everything(matcher)]
            # Control: different maps would be detected.
            assert matched_by_a_worker(1) != matched_by_a_worker(2)
            print(*(one == expected for one in same))
        """, " ".join(["True"] * 7))

    def test_a_child_is_forked_while_others_match(self):
        self.apart("""
            matcher, steady, drift = mrfgs.Matcher(device="cpu"), mrfgs.Steady(), mrfgs.Drift(mrfgs.Rectification(CAMERAS))
            views, raw = pair(200, 300), raw_pair()
            found, done = matcher.match(*views, 15), threading.Event()
            expected = digest(found.disparity)

            def busy(call):
                while not done.is_set():
                    call()

            calls = (lambda: matcher.match(*views, 15), lambda: mrfgs.match(*views, device="cpu"), lambda: steady.follow(found, views[0]),
                     lambda: drift.follow(*raw, 31), lambda: mrfgs.read_image(RAW / "left.png"))
            threads = [threading.Thread(target=busy, args=[call]) for call in calls]
            for thread in threads:
                thread.start()

            def child():
                for call in (lambda: steady.follow(found, views[0]), lambda: drift.follow(*raw, 31)):
                    try:
                        call()
                    except RuntimeError as error:
                        assert "when the process was forked" in str(error), error
                return digest(matcher.match(*views, 15).disparity)

            same = []
            for _ in range(12):
                time.sleep(0.03)
                same.append(forked(child) == expected)
            done.set()
            print(*same)
        """, " ".join(["True"] * 12))

    def test_an_iterator_stays_in_its_process(self):
        self.apart("""
            matcher = mrfgs.Matcher(device="cpu")
            results = matcher.match_all(itertools.repeat(pair()), 15)
            expected = digest(next(results).disparity)

            def child():
                try:
                    next(results)
                except RuntimeError as error:
                    print(error)
                results.close()
                return digest(matcher.match(*pair(), 15).disparity)

            print(forked(child, leave=sys.exit) == expected, digest(next(results).disparity) == expected)
        """, "this iterator belongs to the parent of this forked process; call match_all again here\nTrue True")

    def test_devices_stay_in_their_process(self):
        if not has_device():
            self.skipTest("there is no device")
        self.apart("""
            matcher = mrfgs.Matcher(device="gpu")
            expected = digest(matcher.match(*pair(), 15).disparity)

            def child():
                for call in (lambda: matcher.match(*pair(), 15), lambda: mrfgs.match(*pair(), 15, device="gpu"), lambda: mrfgs.Matcher(device=0)):
                    try:
                        call()
                        print("no error")
                    except RuntimeError as error:
                        assert '"spawn"' in str(error) and "forked" in str(error) and len(str(error).splitlines()) == 1, error
                return digest(mrfgs.match(*pair(), 15, device="cpu").disparity)

            print(forked(child) == expected, digest(matcher.match(*pair(), 15).disparity) == expected)
        """, "True True")

    def test_pools_of_processes_give_the_same_bits(self):
        seeds = [1, 2, 3]
        expected = [matched_by_a_worker(seed) for seed in seeds]
        self.assertEqual(len(set(expected)), 3)
        # With a timeout, as a deadlock would not end.
        for way in ("fork", "spawn", "forkserver"):
            with multiprocessing.get_context(way).Pool(2) as pool:
                self.assertEqual(pool.map_async(matched_by_a_worker, seeds).get(timeout=240), expected, way)
        with multiprocessing.pool.ThreadPool(3) as pool:
            self.assertEqual(pool.map_async(matched_by_a_worker, seeds).get(timeout=240), expected)

    @unittest.skipUnless(Path("/proc/self/task").is_dir(), "Linux alone counts threads so")
    def test_no_other_threads_work_than_are_asked_for(self):
        code = """
            def alive():
                return len(os.listdir("/proc/self/task"))

            views, before = pair(200, 300), alive()
            matcher, counts = mrfgs.Matcher(device="cpu", threads=%d), []
            for call in (lambda: matcher.match(*views), lambda: matcher.match(*views, 15), lambda: list(matcher.match_all([views] * 2))):
                call()
                # Threads may take a moment to end.
                time.sleep(0.5)
                counts.append(alive() - before)
            print(*counts)
        """
        self.apart(code % 1, "1 1 1")
        # Control: additional threads are counted.
        self.apart(code % 3, "3 3 3")

    @unittest.skipUnless(Path("/proc/self/task").is_dir(), "Linux alone counts threads so")
    def test_copies_share_their_threads(self):
        self.apart("""
            def alive():
                return len(os.listdir("/proc/self/task"))

            folder = Path(tempfile.mkdtemp())
            views, before = coarse_pair(520, 700), alive()
            for name, view in zip(("left.ppm", "right.ppm"), views):
                write_ppm(folder / name, view)
            files = folder / "left.ppm", folder / "right.ppm"
            blocks = mrfgs.Blocks(*files, 15, method="fast", memory="32MiB", device="cpu", threads=2)
            pickled = pickle.dumps([mrfgs.Matcher(device="cpu", threads=2), blocks])
            copies = [pickle.loads(pickled) for _ in range(300)]
            counts, expected = [alive() - before], digest(copies[0][0].match(*views, 15).disparity)
            with multiprocessing.pool.ThreadPool(4) as pool:
                same = set(pool.map(lambda copy: digest(copy[0].match(*views, 15, method="fast").disparity), copies[:20]))
                pool.map(lambda copy: copy[1].match(1), copies[:20])
            time.sleep(0.5)
            counts.append(alive() - before)
            # Control: other settings take threads of their own.
            matcher = pickle.loads(pickle.dumps(mrfgs.Matcher(device="cpu", threads=1)))
            matcher.match(*views, 15)
            # Threads may take a moment to end.
            time.sleep(0.5)
            counts.append(alive() - before)
            print(*counts, len(same), len({id(copy[1]) for copy in copies}))
        """, "2 2 3 1 1")

    def test_a_child_matches_the_blocks_of_its_parent(self):
        self.apart("""
            folder = Path(tempfile.mkdtemp())
            files = folder / "left.ppm", folder / "right.ppm"
            for file, view in zip(files, coarse_pair(520, 700)):
                write_ppm(file, view)
            blocks = mrfgs.Blocks(*files, 15, method="fast", memory="32MiB", device="cpu")
            pickled, done = pickle.dumps(blocks), threading.Event()
            same = [forked(lambda: digest(blocks.match(0).disparity))]
            expected = digest(blocks.match(0).disparity)

            def busy():
                while not done.is_set():
                    blocks.match(1)
                    pickle.loads(pickled).match(2)

            threads = [threading.Thread(target=busy) for _ in range(2)]
            for thread in threads:
                thread.start()
            for _ in range(6):
                time.sleep(0.03)
                same.append(forked(lambda: digest(blocks.match(0).disparity)))
                same.append(forked(lambda: digest(pickle.loads(pickled).match(0).disparity)))
            done.set()
            print({one == expected for one in same}, len(same))
        """, "{True} 13")

    def test_the_environment_says_how_many_threads_are_usual(self):
        code = "print(mrfgs.match(*pair(200, 300), 15, device='cpu').ran_on)"
        one, names = "the CPU path, 1 thread", ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "SLURM_CPUS_PER_TASK", "SLURM_CPUS_ON_NODE")
        nothing = dict.fromkeys(names, "")
        for name in names:
            self.apart(code, one, **{**nothing, name: "1"})
        # An explicit argument takes precedence.
        self.apart(code.replace("'cpu'", "'cpu', threads=3"), "the CPU path, 3 threads", **{**nothing, "OMP_NUM_THREADS": "1"})
        if hasattr(os, "sched_setaffinity"):
            self.apart("os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])\n" + code, one, **nothing)

    def test_far_too_many_threads_take_no_longer(self):
        for size in ((60, 80), (200, 300)):
            self.apart(f"""
                views = pair(*{size})
                many = mrfgs.match(*views, 15, device="cpu", threads=1024)
                assert np.array_equal(many.disparity, mrfgs.match(*views, 15, device="cpu", threads=1).disparity)
                print(int(many.ran_on.split()[-2]) <= 4 * os.cpu_count())
            """, "True")


class Help(unittest.TestCase):
    def test_everything_is_explained(self):
        for name in mrfgs.__all__:
            thing = getattr(mrfgs, name)
            if name == "__version__":
                continue
            self.assertTrue(inspect.getdoc(thing), name)
            own = [] if not isinstance(thing, type) or issubclass(thing, Warning) else vars(thing).items()
            for inner, value in own:
                if not inner.startswith("_"):
                    self.assertTrue(inspect.getdoc(value), f"{name}.{inner}")
        for thing, more in ((mrfgs.Calibration, None), (mrfgs.Calibration.of_texts, mrfgs.Calibration), (mrfgs.Rectification, None),
                            (mrfgs.Rectification.apply, None), (mrfgs.Rig, None), (mrfgs.Rig.depth, None), (mrfgs.Rig.millimetres, None),
                            (mrfgs.Rig.points, None), (mrfgs.Rig.seen, None), (mrfgs.Points, None), (mrfgs.Points.save, None), (mrfgs.evaluate, None),
                            (mrfgs.Matcher.match_all, mrfgs.Matcher.match), (mrfgs.Blocks, None), (mrfgs.Blocks.match, None),
                            (mrfgs.Blocks.part, None), (mrfgs.PairWindows, None), (mrfgs.PairWindows.window, None),
                            (mrfgs.match_many, mrfgs.Matcher.match)):
            text = inspect.getdoc(thing) + (inspect.getdoc(more) if more else "")
            for name in parameters(thing):
                self.assertTrue(name == "self" or name in text, f"{thing}: {name}")

    def test_the_stubs_name_what_there_is(self):
        stubs = (Path(mrfgs.__file__).parent / "__init__.pyi").read_text()
        listed = next(node.value for node in ast.parse(stubs).body if isinstance(node, ast.Assign) and node.targets[0].id == "__all__")
        self.assertEqual(ast.literal_eval(listed), mrfgs.__all__)
        for name in mrfgs.__all__:
            thing = getattr(mrfgs, name)
            self.assertRegex(stubs, rf"(class|def) {name}\b|{name}:")
            if isinstance(thing, type) and not issubclass(thing, Warning):
                body = stubs.split(f"class {name}")[1].split("\nclass ")[0]
                for inner in vars(thing):
                    self.assertTrue(inner.startswith("_") or f"def {inner}(" in body, f"{name}.{inner}")
                listed = {line.split("def ")[1].split("(")[0] for line in body.splitlines() if line.startswith("    def ")}
                self.assertTrue(all(hasattr(thing, inner) for inner in listed), listed)


if __name__ == "__main__":
    unittest.main()
