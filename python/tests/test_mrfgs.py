"""The Python package against the command line: the same pair gives the same bits. MRFGS is the program's path."""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
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


def by_program(left, right, *arguments):
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write_ppm(folder / "left.ppm", left)
        write_ppm(folder / "right.ppm", right)
        subprocess.run([PROGRAM, "match", folder / "left.ppm", folder / "right.ppm", folder / "out.pfm", "--quiet",
                        "--backend", "cpu", *arguments], check=True)
        return read_pfm(folder / "out.pfm")


class Match(unittest.TestCase):
    def same(self, left, right, *arguments, **keywords):
        expected = by_program(left, right, "--max-disparity", "15", *arguments)
        matched = mrfgs.match(left, right, max_disparity=15, backend="cpu", **keywords)
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
        alone = mrfgs.match(left, right, 15, backend="cpu").disparity
        # Slices that do not lie in one piece, and alpha that says nothing.
        wide = np.dstack([left, left])[..., :3]
        self.assertFalse(wide.flags.c_contiguous)
        self.assertTrue(np.array_equal(mrfgs.match(wide, right, 15, backend="cpu").disparity, alone))
        opaque = [np.dstack([image, np.full(image.shape[:2], 7, np.uint8)]) for image in (left, right)]
        self.assertTrue(np.array_equal(mrfgs.match(*opaque, 15, backend="cpu").disparity, alone))
        grey = [image[..., 0].astype(np.float64) / 255 for image in (left, right)]
        found = mrfgs.match(*grey, 15, backend="cpu").disparity
        self.assertLess(abs(np.median(found[32:, 16:]) - 9), 0.1)

    def test_options(self):
        left, right = pair()
        self.same(left, right, "--set", "fill=none", "--set", "sub-pixel=false", options={"fill": "none", "sub-pixel": False})
        self.same(left, right, "--preset", "fgs", preset="fgs")
        mask = np.zeros(left.shape[:2], bool)
        mask[:, :10] = True
        matched = mrfgs.match(left, right, 15, mask=mask, backend="cpu")
        self.assertTrue(np.isinf(matched.disparity[:, :10]).all() and np.isfinite(matched.disparity[:, 10:]).all())
        self.assertTrue((matched.validity[:, :10] == 32).all())

    def test_a_matcher_matches_again_and_again(self):
        matcher = mrfgs.Matcher(backend="cpu", threads=1)
        for seed in (1, 2, 1):
            images = pair(seed=seed)
            alone = mrfgs.match(*images, 15, backend="cpu")
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
            (TypeError, "uint8", lambda: mrfgs.match(left.astype(np.int64), right, 15)),
            (TypeError, "", lambda: mrfgs.match([[1]], right, 15)),
            (ValueError, "disparity", lambda: mrfgs.match(left, right, -5)),
            (ValueError, "no preset", lambda: mrfgs.match(left, right, 15, preset="best")),
            (ValueError, "no-such-key", lambda: mrfgs.match(left, right, 15, options={"no-such-key": 1})),
            (ValueError, "levels", lambda: mrfgs.match(left, right, 15, options={"levels": 0})),
            (ValueError, "backend", lambda: mrfgs.match(left, right, 15, backend="tpu")),
            (ValueError, "threads", lambda: mrfgs.match(left, right, 15, backend="cpu", threads=0)),
            (ValueError, "max_disparity", lambda: mrfgs.match(left * 0, right * 0)),
        ):
            with self.assertRaises(error) as raised:
                call()
            self.assertIn(words, str(raised.exception))
            self.assertNotIn("\n", str(raised.exception))

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
        mrfgs.match(*images, 63, backend="cpu")
        end = time.monotonic()
        done.set()
        thread.join()
        self.assertGreater(sum(start < t < end for t in ticks), 5)

    @unittest.skipIf(sys.platform == "win32", "no signals there")
    def test_ctrl_c_ends_a_match(self):
        code = ("import numpy as np, mrfgs; a = np.random.default_rng(1).integers(0, 256, (1500, 1500), dtype=np.uint8); "
                "print('ready', flush=True); mrfgs.match(a, a, 255, backend='cpu', options={'final-iterations': 1000})")
        with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            self.addCleanup(process.kill)
            self.assertEqual(process.stdout.readline(), "ready\n")
            time.sleep(1)
            process.send_signal(signal.SIGINT)
            _, told = process.communicate(timeout=60)
        self.assertIn("KeyboardInterrupt", told)


if __name__ == "__main__":
    unittest.main()
