"""Stereo disparity by a multi-resolution factor graph, with the same bits on every device.

Give `match` a rectified pair as arrays; it gives back a `Matched`:

>>> matched = mrfgs.match(left, right, max_disparity=63)
>>> matched.disparity                      # float32, pixels; +inf where there is none

Left (x, y) with disparity d is seen at right (x - d, y). A `Matcher` keeps device, shaders and buffers from pair to pair.
"""

from ._mrfgs import Matched, Matcher, __version__

__all__ = ["Matched", "Matcher", "__version__", "match"]


def match(left, right, max_disparity=None, *, min_disparity=None, mask=None, preset="default", options=None,
          backend="auto", device=None, threads=None):
    """Matches one pair; see `Matcher` and `Matcher.match` for the arguments."""
    matcher = Matcher(backend=backend, device=device, threads=threads)
    return matcher.match(left, right, max_disparity, min_disparity=min_disparity, mask=mask, preset=preset,
                         options=options)
