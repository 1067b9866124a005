"""Turns two photos of a scene into a disparity or depth map, the same on every GPU and CPU.

`match` takes a rectified pair as arrays, which `read_image` reads from files, and returns a `Matched`:

>>> left, right = mrfgs.read_image("left.png"), mrfgs.read_image("right.png")
>>> matched = mrfgs.match(left, right, max_disparity=63)
>>> matched.disparity                      # float32, pixels; +inf if unknown

Left (x, y) with disparity d appears at right (x - d, y). A `Matcher` keeps device, shaders and buffers between pairs; help(mrfgs.Matcher)
explains every argument, `presets()` lists the presets and `options()` all options of the method. Probable faults of a pair are reported as
a `MatchWarning`.

Raw images are rectified by a calibration of OpenCV, ROS, Kalibr or Middlebury, which also gives depth and points:

>>> rectification = mrfgs.Rectification("stereo.yml", size=(640, 480))
>>> left, right = rectification.apply(raw_left, raw_right)
>>> matched = mrfgs.match(left, right, max_disparity=63)
>>> rectification.rig.depth(matched.disparity)              # float32, in the unit of the baseline
>>> rectification.rig.points(matched, left).save("scene.ply")

`Rig` does the same for a pair that is already rectified, `Matcher.match_all` matches the frames of a video, `match_many` pairs of
different scenes, `Blocks` a pair that is larger than memory, and `evaluate` compares a map with the ground truth, read by `read_disparity`.
"""

from ._many import match_many
from ._mrfgs import (
    Blocks,
    Calibration,
    Drift,
    Matched,
    MatchedSequence,
    Matcher,
    MatchWarning,
    PairWindows,
    Points,
    Rectification,
    Rig,
    Steady,
    ThirdCamera,
    __version__,
    evaluate,
    match,
    options,
    presets,
    read_disparity,
    read_image,
)

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
