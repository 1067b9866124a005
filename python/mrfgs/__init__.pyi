# Tools that run this file need what comes first.
from __future__ import annotations

import os
from typing import Any, Iterable, Iterator, Mapping, Sequence, TypedDict, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "Calibration",
    "Drift",
    "Matched",
    "MatchedSequence",
    "Matcher",
    "MatchWarning",
    "Points",
    "Rectification",
    "Rig",
    "Steady",
    "ThirdCamera",
    "__version__",
    "evaluate",
    "match",
    "options",
    "presets",
    "read_disparity",
    "read_image",
]

__version__: str

# Whatever numpy makes an array of, or what has __dlpack__: uint8, uint16, float16, float32, float64, or other whole numbers with the values of the first two; of shape
# (height, width) or (height, width, channels).
_Image = npt.ArrayLike

# The path of a file.
_Path = str | os.PathLike[str]

class MatchWarning(UserWarning):
    """What is probably wrong with a pair, or with the range of disparities that was searched, and what to do about it."""

@final
class Matched:
    """The maps of a pair, and what made them. All maps have the shape (height, width) of the images."""

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
        """Disparity in pixels, +inf where there is none."""
    @property
    def raw(self) -> npt.NDArray[np.float32]:
        """Disparity before post-processing in pixels, +inf where the left image is masked."""
    @property
    def confidence(self) -> npt.NDArray[np.uint8]:
        """How far the best runner-up is behind, in 1/8 nat, as a mean over the pixels around; those with another disparity count 0. It
        is 0 where there is no measurement."""
    @property
    def sigma(self) -> npt.NDArray[np.float32]:
        """The error to expect of every measured disparity in pixels, from its confidence: about two thirds are nearer to the truth.
        +inf where nothing was measured."""
    @property
    def validity(self) -> npt.NDArray[np.uint8]:
        """Why each pixel is what it is: the sum of 1 match outside the right image, 2 occluded, 4 in a small region, 8 low
        confidence, 16 filled, 32 masked, 64 a tie of two disparities, 128 outvoted by the pixels around it; 0 is measured
        and trusted."""
    @property
    def right(self) -> npt.NDArray[np.float32] | None:
        """Disparity of the right view in pixels, +inf where there is none: right (x, y) with disparity d is seen at left
        (x + d, y). None unless the option "right-map" asks for it."""
    @property
    def min_disparity(self) -> int:
        """Smallest disparity that was searched, in pixels."""
    @property
    def max_disparity(self) -> int:
        """Largest disparity that was searched, in pixels."""
    @property
    def iterations(self) -> int:
        """Iterations done, of all phases together."""
    @property
    def tiles(self) -> int:
        """Tiles that the image was matched in."""
    @property
    def ran_on(self) -> str:
        """What ran it."""
    @property
    def note(self) -> str | None:
        """Why that is not the device that was hoped for, where that is so."""

@final
class Matcher:
    """Matches pair after pair, and keeps the device, its compiled shaders and its buffers in between."""

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
        method: _Path | None = None,
        options: Mapping[str, Any] | None = None,
        memory: str | None = None,
        warn: bool = True,
    ) -> Matched:
        """Matches a rectified pair, and returns its maps; help(mrfgs.Matcher) explains every argument."""
    def match_all(
        self,
        pairs: Iterable[Sequence[_Image]],
        max_disparity: float | None = None,
        *,
        min_disparity: float | None = None,
        no_data: float | None = None,
        method: _Path | None = None,
        options: Mapping[str, Any] | None = None,
        memory: str | None = None,
        warn: bool = True,
    ) -> MatchedSequence:
        """Matches pair after pair, and returns an iterator over their results, in order. At most three pairs are taken ahead of the
        results; an exception of `pairs` comes after the results of the pairs before it."""

@final
class MatchedSequence(Iterator[Matched]):
    """The results of Matcher.match_all, in the order of the pairs."""

    def __next__(self) -> Matched: ...
    def close(self) -> None:
        """Ends the sequence: stops the match that runs, takes no more pairs, and gives the matcher back."""

@final
class Calibration:
    """What is known of a pair of cameras, read from the files of OpenCV, ROS, Kalibr or Middlebury."""

    def __new__(
        cls, *files: _Path, unit: str | None = None, crop: tuple[int, int, int, int] | None = None
    ) -> Calibration: ...
    @staticmethod
    def of_texts(
        *texts: str, unit: str | None = None, crop: tuple[int, int, int, int] | None = None
    ) -> Calibration:
        """The same of the texts of such files: one, or two that belong together."""
    @property
    def size(self) -> tuple[int, int] | None:
        """(width, height) of the images as the cameras took them; None where the files do not say it."""
    @property
    def unit(self) -> str:
        """The unit of the baseline: "mm", "cm", "m", or "unknown"."""
    @property
    def max_disparity(self) -> int | None:
        """The largest disparity of the pair, in pixels, from the line ndisp of a calib.txt; else None."""

# A calibration, the path of its file, or those of two files that belong together.
_Cameras = Calibration | _Path | Iterable[_Path]

@final
class Rectification:
    """How images as the cameras took them become a rectified pair. It is found once, and applied to any number of pairs."""

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
        """The rectification of a pair by matches of its own, without a calibration: of two photographs of one camera that was moved to
        the side by hand. `trust` says how far it can be trusted; `rig` raises ValueError, because there is no scale."""
    def apply(
        self,
        left: _Image,
        right: _Image,
        *,
        mask: npt.ArrayLike | None = None,
        no_data: float | None = None,
    ) -> tuple[np.ma.MaskedArray[Any, Any], np.ma.MaskedArray[Any, Any]]:
        """Rectifies a pair, and returns both views as masked arrays, masked where there is no source: uint8 of two uint8 images, else
        uint16; of shape (height, width) or (height, width, 3)."""
    def maps(
        self,
    ) -> tuple[
        tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]],
        tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]],
    ]:
        """Where each pixel of the rectified views is in the images: ((left_x, left_y), (right_x, right_y)), in pixels; +inf where it is
        nowhere."""
    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the rectified views, in pixels."""
    @property
    def raw_size(self) -> tuple[int, int]:
        """(width, height) of the images that it rectifies, in pixels."""
    @property
    def rotations(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The rotations from the frame of each camera to that of its rectified view: R1 and R2 of OpenCV, of shape (3, 3)."""
    @property
    def rig(self) -> Rig:
        """The cameras of the rectified pair: for depth and points. Raises ValueError of a rectification by matches alone."""
    @property
    def trust(self) -> dict[str, float] | None:
        """How far a rectification by matches alone can be trusted: `matches`, `agreeing`, `median` and `percentile95` of the distance of
        rows (pixels), `coverage` and `off_one_plane` (0 to 1). None of one by a calibration."""
    def calib_txt(self) -> str:
        """The calibration of the rectified pair in Middlebury's form, in millimetres where the unit is known."""
    def cameras_yml(self) -> str:
        """The calibration of the rectified pair for OpenCV, in the unit of the calibration."""

@final
class Rig:
    """The cameras of a rectified pair: from disparities to depths and points, in the unit of the baseline."""

    def __new__(cls, calibration: _Cameras, *, size: Sequence[int] | None = None) -> Rig:
        """By the calibration of a rectified pair; size is that of the images, where the calibration is for several."""
    def of_part(self, x: int, y: int) -> Rig:
        """That of a part of the images, whose first pixel is (x, y), such as the roi of match."""
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
        """That of a rectified pair by its focal length in pixels and its baseline; the principal point is the centre of images of
        `size` unless it is given."""
    def depth(self, disparity: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """The depth of every pixel along the optical axis, in the unit of the baseline, +inf where there is none."""
    def depth_sigma(self, disparity: npt.ArrayLike, sigma: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """The error to expect of every depth, in the unit of the baseline, of disparities with these errors (Matched.sigma); +inf where
        there is none."""
    def millimetres(self, disparity: npt.ArrayLike) -> npt.NDArray[np.uint16]:
        """The depth of every pixel in whole millimetres: 0 where there is none, and where it is above 65535."""
    def registered(self, disparity: npt.ArrayLike, camera: ThirdCamera | _Path) -> npt.NDArray[np.float32]:
        """The depths as a third camera sees them, along its axis and at its pixels; +inf where it sees what the map does not."""
    def registered_millimetres(self, disparity: npt.ArrayLike, camera: ThirdCamera | _Path) -> npt.NDArray[np.uint16]:
        """The same in whole millimetres: 0 where there is none, and where it is above 65535."""
    def points(self, matched: Matched, left: _Image) -> Points:
        """The points that were measured and are trusted (validity 0), with the colours of the rectified left image."""
    @property
    def cameras(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The matrices [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] of the left and the right camera, in pixels."""
    @property
    def doffs(self) -> float:
        """Distance of the principal points along the row, cx of the right camera less cx of the left one, in pixels."""
    @property
    def baseline(self) -> float:
        """Distance of the cameras, in `unit`."""
    @property
    def unit(self) -> str:
        """The unit of the baseline, of depths and of points: "mm", "cm", "m", or "unknown"."""
    @property
    def size(self) -> tuple[int, int] | None:
        """(width, height) of the rectified images, in pixels; None where the calibration does not say it."""

@final
class Drift:
    """What the frames of a rig show of how its right camera has turned since it was calibrated."""

    def __new__(cls, rectification: Rectification) -> Drift:
        """Of a rig with this rectification, from which nothing has turned yet."""
    def follow(self, left: _Image, right: _Image, max_disparity: float, *, min_disparity: float | None = None) -> None:
        """Takes the rectified views of the next frame, and looks at them if it is their turn."""
    @property
    def turn(self) -> _Turn | None:
        """How far the right camera looks up, to the right and clockwise of where it was calibrated: `degrees`, their standard `errors`,
        how far that moves `rows` apart (pixels), how many `matches` show it, and whether it `counts`; None where they are too few."""
    def correct(self) -> Rectification | None:
        """What rectifies the next frames, where that is no longer what rectified the last ones."""

@final
class Steady:
    """A filter for the maps of a sequence: where the left image does not change, the disparity follows that of the frames before."""

    def __new__(cls) -> Steady: ...
    def follow(self, matched: Matched, left: _Image) -> Matched:
        """The same Matched with disparities that follow those of the frames before; left is the left image that was matched."""

@final
class ThirdCamera:
    """A camera beside the pair, such as the colour camera of a rig: its lens, its size and how it stands to the left camera."""

    def __new__(cls, file: _Path) -> ThirdCamera: ...
    @staticmethod
    def of_text(text: str) -> ThirdCamera:
        """The same of the text of such a file."""
    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of its images, in pixels."""
    @property
    def unit(self) -> str:
        """The unit of its distance from the left camera: "mm", "cm", "m", or "unknown", which is taken for that of the pair."""

@final
class Points:
    """A cloud of points."""

    def __new__(
        cls, positions: npt.ArrayLike, colours: npt.ArrayLike, confidence: npt.ArrayLike, unit: str = "unknown"
    ) -> Points: ...
    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Where the points are, of shape (N, 3): x to the right, y down, z forward of the left camera, in the unit of the baseline."""
    @property
    def colours(self) -> npt.NDArray[np.uint8]:
        """Their colours, of shape (N, 3): red, green and blue."""
    @property
    def confidence(self) -> npt.NDArray[np.uint8]:
        """Their confidence, of shape (N,), in 1/8 nat."""
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
    method: _Path | None = None,
    options: Mapping[str, Any] | None = None,
    memory: str | None = None,
    warn: bool = True,
    device: str | int | None = None,
    threads: int | None = None,
) -> Matched:
    """Matches one rectified pair, and returns its maps; help(mrfgs.Matcher) explains every argument."""

def presets() -> dict[str, str]:
    """Lists the presets: a dict from the name of each to what it is for."""

def options() -> dict[str, dict[str, dict[str, Any]]]:
    """Describes the options: a dict from each group to a dict from each of its keys to what it does, which values it takes, where
    it comes from, and its value in each preset."""

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
    """Reads a disparity map in pixels from a PFM, a float TIFF or a 16-bit PNG as KITTI has it; +inf where there is none."""

def read_image(path: _Path, /, *, orient: bool = False) -> npt.NDArray[Any]:
    """Reads an image as `match` takes it, from PNG, JPEG, PNM, TIFF or PFM: uint8, uint16, float32 or float64, of shape (height, width) or
    (height, width, channels), RGB; a masked array where the file says that pixels hold no data."""

def evaluate(disparity: npt.ArrayLike, truth: npt.ArrayLike, mask: npt.ArrayLike | None = None) -> _Report:
    """Compares a disparity map with the truth, as `mrfgs evaluate map` does: errors in pixels and shares in percent, over all pixels
    with known truth and over those of them that both views see."""
