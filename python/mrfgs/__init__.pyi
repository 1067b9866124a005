from typing import Any, Mapping, TypedDict, final

import numpy as np
import numpy.typing as npt

__version__: str

# Whatever numpy makes an array of: uint8, uint16, float32 or float64, (height, width) or (height, width, channels).
_Image = npt.ArrayLike

class MatchWarning(UserWarning):
    """What is probably wrong with a pair, or with the range of disparities that was searched, and what to do about it."""

@final
class Matched:
    """The maps of a pair, and what made them. All maps have the shape (height, width) of the images."""

    @property
    def disparity(self) -> npt.NDArray[np.float32]:
        """Disparity in pixels, +inf where there is none."""
    @property
    def raw(self) -> npt.NDArray[np.float32]:
        """Disparity before post-processing in pixels, +inf where the left image is masked."""
    @property
    def confidence(self) -> npt.NDArray[np.uint8]:
        """How far the best runner-up is behind, in 1/8 nat; 0 where there is no measurement."""
    @property
    def validity(self) -> npt.NDArray[np.uint8]:
        """Why each pixel is what it is: the sum of 1 match outside the right image, 2 occluded, 4 in a small region, 8 low
        confidence, 16 filled, 32 masked; 0 is measured and trusted."""
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

    def __new__(cls, *, device: str = "auto", threads: int | None = None) -> Matcher: ...
    def match(
        self,
        left: _Image,
        right: _Image,
        max_disparity: int | None = None,
        *,
        min_disparity: int | None = None,
        mask: npt.ArrayLike | None = None,
        no_data: float | None = None,
        preset: str = "default",
        options: Mapping[str, Any] | None = None,
        warn: bool = True,
    ) -> Matched:
        """Matches a rectified pair, and returns its maps; help(mrfgs.Matcher) explains every argument."""

def match(
    left: _Image,
    right: _Image,
    max_disparity: int | None = None,
    *,
    min_disparity: int | None = None,
    mask: npt.ArrayLike | None = None,
    no_data: float | None = None,
    preset: str = "default",
    options: Mapping[str, Any] | None = None,
    warn: bool = True,
    device: str = "auto",
    threads: int | None = None,
) -> Matched:
    """Matches one rectified pair, and returns its maps; help(mrfgs.Matcher) explains every argument."""

class _Option(TypedDict):
    meaning: str
    takes: str
    words: dict[str, str]
    source: str
    default: bool | int | float | str
    paper: bool | int | float | str
    fgs: bool | int | float | str

def options() -> dict[str, dict[str, _Option]]:
    """Describes the options: a dict from each group to a dict from each of its keys to what it does, which values it takes, where
    it comes from, and its value in each preset."""
