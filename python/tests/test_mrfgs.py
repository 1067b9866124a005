"""The Python package against the command line: the same pair gives the same bits. MRFGS is the program's path."""

import copy
import inspect
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import warnings
from pathlib import Path

import numpy as np

import mrfgs

PROGRAM = os.environ["MRFGS"]


def pair(height=60, width=80, channels=3, seed=1):
    """A textured pair: the upper half at disparity 4, the lower at 9."""
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
        # Control: another pair, and another option, give other bits.
        self.assertFalse(np.array_equal(matched.disparity, by_program(*pair(seed=2), "--max-disparity", "15")))
        self.assertFalse(np.array_equal(matched.disparity, by_program(left, right, "--max-disparity", "15", "--set", "fill=none")))

    def test_kinds_of_images(self):
        left, right = pair()
        self.same(left[..., 0].copy(), right[..., 0].copy())
        self.same(left.astype(np.uint16) * 16 + 3, right.astype(np.uint16) * 16 + 3)
        alone = mrfgs.match(left, right, 15, device="cpu").disparity
        # Slices that do not lie in one piece, and alpha that says nothing.
        wide = np.dstack([left, left])[..., :3]
        self.assertFalse(wide.flags.c_contiguous)
        self.assertTrue(np.array_equal(mrfgs.match(wide, right, 15, device="cpu").disparity, alone))
        opaque = [np.dstack([image, np.full(image.shape[:2], 7, np.uint8)]) for image in (left, right)]
        self.assertTrue(np.array_equal(mrfgs.match(*opaque, 15, device="cpu").disparity, alone))
        grey = [image[..., 0].astype(np.float64) / 255 for image in (left, right)]
        found = mrfgs.match(*grey, 15, device="cpu").disparity
        self.assertLess(abs(np.median(found[32:, 16:]) - 9), 0.1)

    def test_layouts_of_memory(self):
        left, right = pair()
        expected = mrfgs.match(left, right, 15, device="cpu").disparity
        # Control: a layout that is taken for another makes another map.
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
        # The same row again and again, without a stride.
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
        # One channel is enough, and none is nothing.
        one = np.ma.masked_array(left, np.dstack([mask, mask & False, mask & False]))
        self.assertTrue(np.array_equal(mrfgs.match(one, right, 15, device="cpu").disparity, expected))
        plain = mrfgs.match(left, right, 15, device="cpu").disparity
        self.assertTrue(np.array_equal(mrfgs.match(np.ma.masked_array(left), right, 15, device="cpu").disparity, plain))
        # In the right view there is nothing to match then.
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
        self.assertEqual(told(right, left, 15, warn=False), [])
        self.assertTrue(issubclass(mrfgs.MatchWarning, UserWarning))
        with warnings.catch_warnings():
            warnings.simplefilter("error", mrfgs.MatchWarning)
            with self.assertRaises(mrfgs.MatchWarning):
                mrfgs.Matcher(device="cpu").match(right, left, 15)

    def test_results_pickle_and_copy(self):
        matched = mrfgs.match(*pair(), 15, device="cpu")
        for other in (pickle.loads(pickle.dumps(matched)), copy.copy(matched), copy.deepcopy(matched)):
            self.assertIsInstance(other, mrfgs.Matched)
            for name in ("disparity", "raw", "confidence", "validity", "min_disparity", "max_disparity", "iterations",
                         "tiles", "ran_on", "note"):
                self.assertTrue(np.array_equal(getattr(other, name), getattr(matched, name)), name)
        self.assertIn("80 x 60", repr(matched))

    def test_help_explains_every_argument(self):
        for function in (mrfgs.match, mrfgs.Matcher.match, mrfgs.Matcher):
            for name in inspect.signature(function).parameters:
                text = inspect.getdoc(mrfgs.Matcher) + inspect.getdoc(mrfgs.Matcher.match)
                self.assertTrue(name == "self" or name in text, name)
        self.assertIn("Matcher", inspect.getdoc(mrfgs.match))
        for name in ("disparity", "confidence", "validity", "note"):
            self.assertTrue(inspect.getdoc(getattr(mrfgs.Matched, name)), name)

    def test_options(self):
        left, right = pair()
        self.same(left, right, "--set", "fill=none", "--set", "sub-pixel=false", options={"fill": "none", "sub-pixel": False})
        # With its group in front, and a group as a dict, in any order.
        grouped = {"cost": {"outside-cost": 20, "matching": "sad"}, "refinement.fill": "row"}
        flags = [flag for change in ("matching=sad", "outside-cost=20", "fill=row") for flag in ("--set", change)]
        self.same(left, right, *flags, options=grouped)
        self.same(left, right, "--method", "fgs", preset="fgs")
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
        # Control: it is not the map of the left view.
        self.assertFalse(np.array_equal(matched.right, matched.disparity))
        self.assertTrue(np.array_equal(pickle.loads(pickle.dumps(matched)).right, matched.right))

    def test_options_are_described(self):
        described = mrfgs.options()
        window = described["cost"]["sad-window"]
        self.assertEqual((window["takes"], window["source"], window["default"]), ("pixels, odd, 1 to 31", "section 3.1: 7", 7))
        self.assertIn("census", described["cost"]["matching"]["words"])
        self.assertIs(described["refinement"]["sub-pixel"]["default"], True)
        # What a preset sets is an option as it stands.
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
            (ValueError, "one size", lambda: mrfgs.match(left, right[:, 1:].copy(), 15)),
            (ValueError, "height, width", lambda: mrfgs.match(left[0, 0], right, 15)),
            (ValueError, "1 to 4 channels", lambda: mrfgs.match(np.dstack([left, left]), right, 15)),
            (ValueError, "has pixels", lambda: mrfgs.match(left[:0], right[:0], 15)),
            (ValueError, "float", lambda: mrfgs.match(left, right.astype(np.float32), 15)),
            (ValueError, "mask", lambda: mrfgs.match(left, right, 15, mask=np.zeros((3, 3), bool))),
            (TypeError, "left: give an array of uint8, uint16, float32 or float64, not int64",
             lambda: mrfgs.match(left.astype(np.int64), right, 15)),
            (TypeError, "left", lambda: mrfgs.match([[1]], right, 15)),
            (TypeError, "right", lambda: mrfgs.match(left, "right.png", 15)),
            (TypeError, "mask: give an array of bool", lambda: mrfgs.match(left, right, 15, mask=np.full((60, 80), "a"))),
            (ValueError, "mask", lambda: mrfgs.match(left, right, 15, mask=np.zeros((3, 3), np.uint8))),
            (ValueError, "mask", lambda: mrfgs.match(left, right, 15, mask=np.zeros((60, 80, 3), bool))),
            (ValueError, "disparity", lambda: mrfgs.match(left, right, -5)),
            (ValueError, "no preset", lambda: mrfgs.match(left, right, 15, preset="best")),
            (ValueError, "no-such-key", lambda: mrfgs.match(left, right, 15, options={"no-such-key": 1})),
            (ValueError, "levels", lambda: mrfgs.match(left, right, 15, options={"levels": 0})),
            (ValueError, "levels", lambda: mrfgs.match(left, right, 15, options={"graph": {"levels": 0}})),
            (ValueError, "is a group", lambda: mrfgs.match(left, right, 15, options={"cost": "sad"})),
            (ValueError, "threads", lambda: mrfgs.match(left, right, 15, device="cpu", threads=0)),
            (ValueError, "max_disparity", lambda: mrfgs.match(left * 0, right * 0)),
        ):
            with self.assertRaises(error) as raised:
                call()
            self.assertIn(words, str(raised.exception))
            self.assertNotIn("\n", str(raised.exception))
            # In the words of Python.
            self.assertNotIn("--", str(raised.exception))
        with self.assertRaises(ValueError) as raised:
            mrfgs.match(left, right, -5)
        self.assertIn("max_disparity: -5 is below the minimum disparity 0: raise it or lower min_disparity", str(raised.exception))
        with self.assertRaises(ValueError) as raised:
            mrfgs.match(left, right, 15, options={"memory": 1})
        self.assertIn('options["memory"]: 1 MiB', str(raised.exception))

    def test_other_threads_run_meanwhile(self):
        images = pair(400, 600)
        ticks, done = [], threading.Event()

        def tick():
            while not done.is_set():
                ticks.append(time.monotonic())
                time.sleep(0.002)

        thread = threading.Thread(target=tick)
        thread.start()
        start = time.monotonic()
        mrfgs.match(*images, 63, device="cpu")
        end = time.monotonic()
        done.set()
        thread.join()
        self.assertGreater(sum(start < t < end for t in ticks), 5)

    @unittest.skipIf(sys.platform == "win32", "no signals there")
    def test_ctrl_c_ends_a_match(self):
        code = ("import numpy as np, mrfgs; a = np.random.default_rng(1).integers(0, 256, (1500, 1500), dtype=np.uint8); "
                "print('ready', flush=True); mrfgs.match(a, a, 255, device='cpu', options={'final-iterations': 1000})")
        with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            self.addCleanup(process.kill)
            self.assertEqual(process.stdout.readline(), "ready\n")
            time.sleep(1)
            process.send_signal(signal.SIGINT)
            _, told = process.communicate(timeout=60)
        self.assertIn("KeyboardInterrupt", told)


if __name__ == "__main__":
    unittest.main()
