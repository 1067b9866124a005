# `from __future__` must come first; some tools execute this file.
from __future__ import annotations

import os
from typing import Any, Iterable, Iterator, Literal, Mapping, Sequence, TypedDict, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "Blocks",
    "Calibration",
    "Drift",
    "Matched",
    "MatchedSequence",
    "Matcher",
    "MatchWarning",
    "PairWindows",
    "Points",
    "Rectification",
    "Rig",
    "Steady",
    "ThirdCamera",
    "__version__",
    "evaluate",
    "match",
    "match_many",
    "options",
    "presets",
    "read_disparity",
    "read_image",
]

__version__: str

# Anything that numpy or __dlpack__ turns into an array of uint8, uint16, float16, float32, float64, or of other integers with values of the
# first two, of shape (height, width) or (height, width, channels).
_Image = npt.ArrayLike

# The path of a file.
_Path = str | os.PathLike[str]

class MatchWarning(UserWarning):
    """A probable fault of a pair or of the disparity range, and its remedy."""

@final
class Matched:
    """The maps of a pair, of shape (height, width), and how they were computed."""

    def __new__(
        cls,
        disparity: npt.NDArray[np.float32],
        raw: npt.NDArray[np.float32],
        confidence: npt.NDArray[np.uint8],
        sigma: npt.NDArray[np.float32],
        validity: npt.NDArray[np.uint8],
        right: npt.NDArray[np.float32] | None,
        min_disparity: int,
        max_disparity: int,
        iterations: int,
        tiles: int,
        ran_on: str,
        note: str | None,
    ) -> Matched: ...
    @property
    def disparity(self) -> npt.NDArray[np.float32]:
        """Disparity in pixels, +inf if unknown."""
    @property
    def raw(self) -> npt.NDArray[np.float32]:
        """Disparity before post-processing in pixels, +inf where the left image is masked."""
    @property
    def confidence(self) -> npt.NDArray[np.uint8]:
        """How sure each pixel is: the lead of the best disparity over the runner-up in 1/8 nat, averaged over neighbouring pixels (those
        with another disparity count 0). 0 for pixels without a measurement."""
    @property
    def sigma(self) -> npt.NDArray[np.float32]:
        """The expected error of every measured disparity in pixels, from its confidence: about two thirds of the errors are smaller. +inf
        for pixels without a measurement."""
    @property
    def validity(self) -> npt.NDArray[np.uint8]:
        """The status of each pixel: the sum of 1 match outside the right image, 2 occluded, 4 in a small region, 8 low confidence, 16
        filled (alone: a prior gave it), 32 masked, 64 a tie of two disparities, 128 outvoted by neighbouring pixels; 0 is measured and trusted."""
    @property
    def right(self) -> npt.NDArray[np.float32] | None:
        """Disparity of the right view in pixels, +inf if unknown: right (x, y) with disparity d appears at left (x + d, y). None without
        the option "right-map"."""
    @property
    def min_disparity(self) -> int:
        """Smallest disparity that was searched, in pixels."""
    @property
    def max_disparity(self) -> int:
        """Largest disparity that was searched, in pixels."""
    @property
    def iterations(self) -> int:
        """Number of iterations, over all phases."""
    @property
    def tiles(self) -> int:
        """Number of tiles that the image was split into."""
    @property
    def ran_on(self) -> str:
        """The device."""
    @property
    def note(self) -> str | None:
        """Why the preferred device was not used, else None."""

@final
class Matcher:
    """Matches pairs, keeping the device, its compiled shaders and its buffers in between."""

    def __new__(cls, *, device: str | int | None = None, threads: int | None = None) -> Matcher: ...
    def match(
        self,
        left: _Image,
        right: _Image,
        max_disparity: float | None = None,
        *,
        min_disparity: float | None = None,
        mask: npt.ArrayLike | None = None,
        no_data: float | None = None,
        roi: Sequence[int] | None = None,
        prior: npt.ArrayLike | None = None,
        prior_sigma: npt.ArrayLike | None = None,
        prior_kind: Literal["points", "surface"] | None = None,
        method: _Path | None = None,
        options: Mapping[str, Any] | None = None,
        memory: str | None = None,
        warn: bool = True,
    ) -> Matched:
        """Matches a rectified pair, and returns its maps; help(mrfgs.Matcher) explains every argument."""
    def match_all(
        self,
        pairs: Iterable[Sequence[_Image | Mapping[str, Any] | None]],
        max_disparity: float | None = None,
        *,
        min_disparity: float | None = None,
        no_data: float | None = None,
        prior: Literal["last"] | None = None,
        method: _Path | None = None,
        options: Mapping[str, Any] | None = None,
        memory: str | None = None,
        warn: bool = True,
    ) -> MatchedSequence:
        """Matches pair after pair, and returns an iterator over their results, in order. At most three pairs are consumed ahead of the
        results; an exception from `pairs` comes after the results of earlier pairs. The pairs are frames of one pair of cameras, unless
        options={"measure-every": 1}. A pair is (left, right) or (left, right, prior); its prior is an array as for `match`, a dict of the
        arguments `prior`, `prior_sigma` and `prior_kind` of `match`, or None. With prior="last" each frame without one takes what was
        measured in the frame before, for cameras that stand still."""

@final
class MatchedSequence(Iterator[Matched]):
    """The results of Matcher.match_all, in the order of the pairs."""

    def __next__(self) -> Matched: ...
    def close(self) -> None:
        """Ends the sequence: stops the running match, consumes no more pairs, and releases the matcher."""

@final
class Blocks:
    """A rectified pair in files that is matched block by block, as the program does with --blocks: for pairs that are larger than memory,
    or shared by several processes or machines. It can be pickled, and opens files and device where it arrives."""

    def __new__(
        cls,
        left: _Path,
        right: _Path,
        max_disparity: float | None = None,
        *,
        min_disparity: float | None = None,
        mask: _Path | None = None,
        no_data: float | None = None,
        orient: bool = False,
        max_pixels: int | None = None,
        scratch: _Path | None = None,
        method: _Path | None = None,
        options: Mapping[str, Any] | None = None,
        memory: str | None = None,
        warn: bool = True,
        device: str | int | None = None,
        threads: int | None = None,
    ) -> Blocks: ...
    def __len__(self) -> int: ...
    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the whole map, in pixels."""
    @property
    def min_disparity(self) -> int:
        """Smallest disparity to search, in pixels."""
    @property
    def max_disparity(self) -> int:
        """Largest disparity to search, in pixels."""
    def part(self, index: int) -> tuple[int, int, int, int]:
        """The part of the left image that a block covers: (x, y, width, height) in pixels."""
    def match(self, index: int) -> Matched:
        """Matches a block, and returns the maps of its part, of shape (height, width)."""

@final
class PairWindows:
    """A rectified pair in files, of which windows are read, in the memory of a window. It can be pickled, and opens the files again where
    it arrives."""

    def __new__(
        cls,
        left: _Path,
        right: _Path,
        mask: _Path | None = None,
        *,
        no_data: float | None = None,
        orient: bool = False,
        max_pixels: int | None = None,
        scratch: _Path | None = None,
    ) -> PairWindows: ...
    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of both images, in pixels."""
    def window(
        self, x: int, y: int, width: int, height: int
    ) -> tuple[np.ma.MaskedArray[Any, Any], np.ma.MaskedArray[Any, Any]]:
        """Reads a part of both images, for `match`: masked arrays of shape (height, width, 3), RGB, uint8 for images of 8 bits, else uint16
        with the levels of the whole pair."""

@final
class Calibration:
    """The calibration of a pair of cameras, read from files of OpenCV, ROS, Kalibr, Middlebury and others."""

    def __new__(
        cls, *files: _Path, unit: str | None = None, crop: tuple[int, int, int, int] | None = None
    ) -> Calibration: ...
    @staticmethod
    def of_texts(
        *texts: str, unit: str | None = None, crop: tuple[int, int, int, int] | None = None
    ) -> Calibration:
        """Reads a calibration from the texts of such files: one, or two that belong together."""
    @property
    def size(self) -> tuple[int, int] | None:
        """(width, height) of the raw images; None if the files lack it."""
    @property
    def unit(self) -> str:
        """The unit of the baseline: "mm", "cm", "m", or "unknown"."""
    @property
    def max_disparity(self) -> int | None:
        """The largest disparity of the pair, in pixels, from ndisp in a calib.txt, else None."""

# A calibration, the path of its file, or two paths that belong together.
_Cameras = Calibration | _Path | Iterable[_Path]

@final
class Rectification:
    """Turns raw images into rectified pairs. It is computed once and applies to any number of pairs."""

    def __new__(
        cls,
        calibration: _Cameras,
        size: tuple[int, int] | None = None,
        *,
        alpha: float | None = None,
        zero_disparity: bool = True,
    ) -> Rectification: ...
    @staticmethod
    def of_pair(
        left: _Image,
        right: _Image,
        *,
        mask: npt.ArrayLike | None = None,
        no_data: float | None = None,
        alpha: float | None = None,
        zero_disparity: bool = True,
    ) -> Rectification:
        """Rectifies a pair from its own matches, without a calibration: two photos taken side by side with one hand-held camera. `trust`
        tells how reliable it is; `rig` raises ValueError, as there is no scale."""
    def apply(
        self,
        left: _Image,
        right: _Image,
        *,
        mask: npt.ArrayLike | None = None,
        no_data: float | None = None,
    ) -> tuple[np.ma.MaskedArray[Any, Any], np.ma.MaskedArray[Any, Any]]:
        """Rectifies a pair, and returns both views as masked arrays, masked without a source: uint8 for two uint8 images, else uint16; of
        shape (height, width) or (height, width, 3)."""
    def maps(
        self,
    ) -> tuple[
        tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]],
        tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]],
    ]:
        """The source position of each pixel of the rectified views: ((left_x, left_y), (right_x, right_y)), in pixels; +inf without a
        source."""
    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the rectified views, in pixels."""
    @property
    def raw_size(self) -> tuple[int, int]:
        """(width, height) of the raw left images, in pixels."""
    @property
    def rotations(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The rotations from each camera's frame to that of its rectified view: R1 and R2 in OpenCV, of shape (3, 3)."""
    @property
    def rig(self) -> Rig:
        """The cameras of the rectified pair, for depth and points. Raises ValueError without a calibration."""
    @property
    def trust(self) -> dict[str, float] | None:
        """How reliable a rectification without a calibration is: `matches`, `agreeing`, `median` and `percentile95` of the row errors
        (pixels), `coverage` and `off_one_plane` (0 to 1). None with a calibration."""
    def calib_txt(self) -> str:
        """The calibration of the rectified pair as Middlebury's calib.txt, in millimetres if the unit is known."""
    def cameras_yml(self) -> str:
        """The calibration of the rectified pair as OpenCV's YAML, in the unit of the calibration."""

@final
class Rig:
    """The cameras of a rectified pair, which turn disparities into depths and points, in the unit of the baseline."""

    def __new__(cls, calibration: _Cameras, *, size: Sequence[int] | None = None) -> Rig:
        """From the calibration of a rectified pair; size is that of the images, if the calibration has several."""
    def of_part(self, x: int, y: int) -> Rig:
        """The rig of a crop of the images whose first pixel is (x, y), such as the roi of match."""
    @staticmethod
    def of(
        focal: float,
        baseline: float,
        *,
        principal_point: Sequence[float] | None = None,
        doffs: float = 0.0,
        size: Sequence[int] | None = None,
        unit: str = "unknown",
    ) -> Rig:
        """From focal length (pixels) and baseline; the principal point defaults to the centre of images of `size`."""
    def depth(self, disparity: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """The depth of every pixel along the optical axis, in the unit of the baseline, +inf if unknown."""
    def depth_sigma(self, disparity: npt.ArrayLike, sigma: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """The expected error of every depth, in the unit of the baseline, from the errors of disparities (Matched.sigma); +inf if
        unknown."""
    def millimetres(self, disparity: npt.ArrayLike) -> npt.NDArray[np.uint16]:
        """The depth of every pixel in whole millimetres: 0 if unknown or above 65535."""
    def registered(self, disparity: npt.ArrayLike, camera: ThirdCamera | _Path) -> npt.NDArray[np.float32]:
        """The depths seen by a third camera, along its axis and at its pixels; +inf where it sees something that the map does not."""
    def registered_millimetres(self, disparity: npt.ArrayLike, camera: ThirdCamera | _Path) -> npt.NDArray[np.uint16]:
        """Like `registered`, in whole millimetres: 0 if unknown or above 65535."""
    def points(self, matched: Matched, left: _Image) -> Points:
        """The points of measured, trusted pixels (validity 0), with the colours of the rectified left image."""
    def seen(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Where the left image shows points of the scene, as the `prior` of `match`: rows x, y and disparity in pixels, of shape (N, 3), NaN
        for points behind the cameras. `points` has shape (N, 3), in the frame and unit of Points.positions."""
    @property
    def cameras(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The matrices [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] of the left and the right camera, in pixels."""
    @property
    def doffs(self) -> float:
        """Distance of the principal points along the row, cx of the right camera minus cx of the left one, in pixels."""
    @property
    def baseline(self) -> float:
        """Distance between the cameras, in `unit`."""
    @property
    def unit(self) -> str:
        """The unit of the baseline, of depths and of points: "mm", "cm", "m", or "unknown"."""
    @property
    def size(self) -> tuple[int, int] | None:
        """(width, height) of the rectified images, in pixels; None if the calibration lacks it."""

@final
class Drift:
    """Measures how the right camera of a rig has turned since its calibration."""

    def __new__(cls, rectification: Rectification) -> Drift:
        """For a rig with this rectification, before any turn."""
    def follow(self, left: _Image, right: _Image, max_disparity: float, *, min_disparity: float | None = None) -> None:
        """Takes the rectified views of the next frame, and evaluates some of the frames."""
    @property
    def turn(self) -> _Turn | None:
        """The turn of the right camera up, right and clockwise since the calibration (`degrees`), its standard `errors`, the largest shift
        of `rows` (pixels), the number of `matches`, and whether it `counts`; None with too few matches."""
    def correct(self) -> Rectification | None:
        """The rectification for the next frames, if it differs from the last one; else None."""

@final
class Steady:
    """A filter for the maps of a sequence that steadies still surfaces by averaging with earlier frames."""

    def __new__(cls) -> Steady: ...
    def follow(self, matched: Matched, left: _Image) -> Matched:
        """Returns a copy of `matched` with smoothed disparities; left is the left image that was matched."""

@final
class ThirdCamera:
    """A camera besides the pair, such as a colour camera: its lens, image size and pose relative to the left camera."""

    def __new__(cls, file: _Path) -> ThirdCamera: ...
    @staticmethod
    def of_text(text: str) -> ThirdCamera:
        """Reads it from the text of such a file."""
    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of its images, in pixels."""
    @property
    def unit(self) -> str:
        """The unit of its distance to the left camera: "mm", "cm", "m", or "unknown", which means that of the pair."""

@final
class Points:
    """A point cloud."""

    def __new__(
        cls, positions: npt.ArrayLike, colours: npt.ArrayLike, confidence: npt.ArrayLike, unit: str = "unknown"
    ) -> Points: ...
    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """The positions, of shape (N, 3): x to the right, y down, z forward of the left camera, in the unit of the baseline."""
    @property
    def colours(self) -> npt.NDArray[np.uint8]:
        """The colours, of shape (N, 3): red, green and blue."""
    @property
    def confidence(self) -> npt.NDArray[np.uint8]:
        """The confidences, of shape (N,), in 1/8 nat."""
    @property
    def unit(self) -> str:
        """The unit of the positions: "mm", "cm", "m", or "unknown"."""
    def save(self, path: _Path) -> None:
        """Writes the points as .ply, .pcd, .las or .laz, as the program does; the confidence is `quality` or the intensity."""
    def __len__(self) -> int: ...

def match(
    left: _Image,
    right: _Image,
    max_disparity: float | None = None,
    *,
    min_disparity: float | None = None,
    mask: npt.ArrayLike | None = None,
    no_data: float | None = None,
    roi: Sequence[int] | None = None,
    prior: npt.ArrayLike | None = None,
    prior_sigma: npt.ArrayLike | None = None,
    prior_kind: Literal["points", "surface"] | None = None,
    method: _Path | None = None,
    options: Mapping[str, Any] | None = None,
    memory: str | None = None,
    warn: bool = True,
    device: str | int | None = None,
    threads: int | None = None,
) -> Matched:
    """Matches a single rectified pair, and returns its maps; help(mrfgs.Matcher) explains every argument."""

def match_many(
    pairs: Iterable[Sequence[_Image | _Path | Mapping[str, Any] | None]],
    max_disparity: float | None = None,
    *,
    matcher: Matcher | None = None,
    min_disparity: float | None = None,
    no_data: float | None = None,
    orient: bool = False,
    method: _Path | None = None,
    options: Mapping[str, Any] | None = None,
    memory: str | None = None,
    warn: bool = True,
) -> Iterator[Matched | Exception]:
    """Matches pairs of different scenes, of arrays or paths, and returns an iterator that yields a Matched for each, in order, or the
    exception of a pair that fails in its place. A pair is (left, right) or (left, right, prior). Unlike those of Matcher.match_all, each
    pair has its own range, warnings and corrections."""

def presets() -> dict[str, str]:
    """Lists the presets: a dict from each name to its purpose."""

def options() -> dict[str, dict[str, dict[str, Any]]]:
    """Describes the options: a dict from each group to a dict from each key to its meaning, values, source, and value in each preset."""

_Turn = TypedDict(
    "_Turn",
    {
        "degrees": tuple[float, float, float],
        "errors": tuple[float, float, float],
        "rows": float,
        "matches": int,
        "counts": bool,
    },
)
_Errors = TypedDict(
    "_Errors",
    {
        "pixels": int,
        "density": float,
        "avg": float | None,
        "rms": float | None,
        "psnr": float | None,
        "bad0.5": float,
        "bad1.0": float,
        "bad2.0": float,
        "bad4.0": float,
        "a50": float | None,
        "a90": float | None,
        "a95": float | None,
        "a99": float | None,
    },
)

class _Report(TypedDict):
    all: _Errors
    nonocc: _Errors | None

def read_disparity(path: _Path, /) -> npt.NDArray[np.float32]:
    """Reads a disparity map in pixels from a PFM, a float TIFF or a 16-bit PNG as in KITTI; +inf if unknown."""

def read_image(path: _Path, /, *, orient: bool = False) -> npt.NDArray[Any]:
    """Reads an image for `match` from PNG, JPEG, PNM, TIFF or PFM: uint8, uint16, float32 or float64, of shape (height, width) or (height,
    width, channels), RGB; a masked array if the file marks pixels as no data."""

def evaluate(disparity: npt.ArrayLike, truth: npt.ArrayLike, mask: npt.ArrayLike | None = None) -> _Report:
    """Compares a disparity map with the ground truth, as `mrfgs evaluate map` does: errors in pixels and shares in percent, over all pixels
    with known truth and over those seen by both views."""
