from typing import Any, Literal, Mapping, final

import numpy as np
import numpy.typing as npt

__version__: str

_Image = npt.NDArray[np.uint8] | npt.NDArray[np.uint16] | npt.NDArray[np.float32] | npt.NDArray[np.float64]
_Backend = Literal["auto", "cpu", "gpu"]

@final
class Matched:
    """What a match leaves behind; all maps have the shape (height, width) of the images."""

    @property
    def disparity(self) -> npt.NDArray[np.float32]:
        """Disparity in pixels, +inf where there is none."""
    @property
    def raw(self) -> npt.NDArray[np.float32]:
        """Disparity before post-processing in pixels, +inf where the left image is masked."""
    @property
    def confidence(self) -> npt.NDArray[np.uint8]:
        """How far the best rival is behind, in 1/8 nat; 0 where there is no measurement."""
    @property
    def validity(self) -> npt.NDArray[np.uint8]:
        """Why each pixel is what it is: the sum of 1 match outside the right image, 2 occluded, 4 in a small region, 8 low
        confidence, 16 filled, 32 masked; 0 is measured and trusted."""
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
    """Matches pair after pair, and keeps in between what is dear: the device, its compiled shaders, its buffers.

    `backend` is auto, cpu or gpu; `device` an adapter by index or part of its name, as `mrfgs devices` lists them; `threads` those
    of the CPU path, one a core where None.
    """

    def __new__(cls, *, backend: _Backend = "auto", device: str | None = None, threads: int | None = None) -> Matcher: ...
    def match(
        self,
        left: _Image,
        right: _Image,
        max_disparity: int | None = None,
        *,
        min_disparity: int | None = None,
        mask: npt.NDArray[np.bool_] | None = None,
        preset: str = "default",
        options: Mapping[str, Any] | None = None,
    ) -> Matched:
        """Matches a rectified pair.

        `left` and `right` have the shape (height, width) or (height, width, channels): grey, grey and alpha, RGB, or RGBA;
        uint8, uint16, float32 or float64, scaled as files are. Ignored are pixels of alpha 0, values that are not finite, and,
        in the left image, where `mask` is True. Disparities are searched from `min_disparity` to `max_disparity`, both
        included; sparse matches find what is not given. `options` replaces keys of the preset, as `mrfgs presets` lists them:
        {"fill": "none", "memory": 2048}. Other threads run meanwhile; Ctrl-C ends it.

        Raises ValueError for what makes no sense, TypeError for other arrays, RuntimeError where the wanted device fails,
        MemoryError where it does not fit.
        """

def match(
    left: _Image,
    right: _Image,
    max_disparity: int | None = None,
    *,
    min_disparity: int | None = None,
    mask: npt.NDArray[np.bool_] | None = None,
    preset: str = "default",
    options: Mapping[str, Any] | None = None,
    backend: _Backend = "auto",
    device: str | None = None,
    threads: int | None = None,
) -> Matched:
    """Matches one pair; see `Matcher` and `Matcher.match` for the arguments."""
