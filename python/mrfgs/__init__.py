"""Stereo disparity by a multi-resolution factor graph, with the same bits on every device.

Give `match` a rectified pair as arrays, of which `read_image` makes some of files; it returns a `Matched`:

>>> left, right = mrfgs.read_image("left.png"), mrfgs.read_image("right.png")
>>> matched = mrfgs.match(left, right, max_disparity=63)
>>> matched.disparity                      # float32, pixels; +inf where there is none

Left (x, y) with disparity d is seen at right (x - d, y). A `Matcher` keeps device, shaders and buffers from pair to pair;
help(mrfgs.Matcher) explains every argument, `presets()` lists the presets, `options()` every option of the method. What is probably wrong with a pair is told as a
`MatchWarning`.

Images as the cameras took them are rectified by a calibration of OpenCV, ROS, Kalibr or Middlebury, which also gives depth and points:

>>> rectification = mrfgs.Rectification("stereo.yml", size=(640, 480))
>>> left, right = rectification.apply(raw_left, raw_right)
>>> matched = mrfgs.match(left, right, max_disparity=63)
>>> rectification.rig.depth(matched.disparity)              # float32, in the unit of the baseline
>>> rectification.rig.points(matched, left).save("scene.ply")

`Rig` does the same for a pair that is rectified already, `Matcher.match_all` matches pair after pair, and `evaluate` compares a map with
the truth, which `read_disparity` reads.
"""

from ._mrfgs import (
    Calibration,
    Drift,
    Matched,
    MatchedSequence,
    Matcher,
    MatchWarning,
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
