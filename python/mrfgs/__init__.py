"""Stereo disparity by a multi-resolution factor graph, with the same bits on every device.

Give `match` a rectified pair as arrays; it returns a `Matched`:

>>> matched = mrfgs.match(left, right, max_disparity=63)
>>> matched.disparity                      # float32, pixels; +inf where there is none

Left (x, y) with disparity d is seen at right (x - d, y). A `Matcher` keeps device, shaders and buffers from pair to pair;
help(mrfgs.Matcher) explains every argument, `options()` every option of the method. What is probably wrong with a pair is told as a `MatchWarning`.
"""

from ._mrfgs import Matched, Matcher, MatchWarning, __version__, match, options

__all__ = ["Matched", "Matcher", "MatchWarning", "__version__", "match", "options"]
