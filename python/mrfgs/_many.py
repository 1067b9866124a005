"""Pairs of different scenes, one after the other."""

import os

from ._mrfgs import Matcher, read_image


def match_many(
    pairs,
    max_disparity=None,
    *,
    matcher=None,
    min_disparity=None,
    no_data=None,
    orient=False,
    method=None,
    options=None,
    memory=None,
    warn=True,
):
    """Matches pairs of different scenes, and returns an iterator that yields a Matched for each, in order, or the exception of a pair that
    fails in its place, so that one damaged file does not end the run.

    pairs: an iterable of pairs (left, right); each view is an array as for `Matcher.match`, or the path of an image as for `read_image`. A
        third item is the prior of the pair: an array as for `Matcher.match`, None, or a dict with its arguments `prior`, `prior_sigma` and
        `prior_kind`.
    matcher: the Matcher to use, by default a new one. Between its matches, others may use it.
    orient: whether to rotate images from files upright according to their EXIF or TIFF orientation tag.

    The other arguments are those of `Matcher.match`, for all pairs. Each pair is treated as by that: it has its own range and warnings, and
    what is corrected is measured in it. `Matcher.match_all` is for frames of one pair of cameras instead: it is faster, takes these from
    the first frame, and raises the first exception. Here only invalid arguments, Ctrl-C and exceptions of the iterable are raised. One pair
    is in memory at a time.
    """
    arguments = {"min_disparity": min_disparity, "no_data": no_data, "method": method, "options": options, "memory": memory, "warn": warn}
    if matcher is None:
        matcher = Matcher()
    elif not isinstance(matcher, Matcher):
        raise TypeError(f"matcher: give a mrfgs.Matcher, not {type(matcher).__name__}")
    # Refuses invalid arguments now, instead of for every pair.
    matcher.match_all((), max_disparity, **arguments).close()
    try:
        pairs = iter(pairs)
    except TypeError:
        raise TypeError("pairs: give an iterable of pairs of arrays or paths, such as zip(lefts, rights)") from None
    return _results(pairs, matcher, orient, {"max_disparity": max_disparity, **arguments})


def _results(pairs, matcher, orient, arguments):
    for pair in pairs:
        try:
            result = _result(pair, matcher, orient, arguments)
        except Exception as error:
            # The traceback would keep the views in memory.
            result = error.with_traceback(None)
        del pair
        yield result
        del result


def _result(pair, matcher, orient, arguments):
    try:
        count = len(pair)
    except TypeError:
        count = 0
    if count not in (2, 3) or isinstance(pair, (str, bytes)):
        raise TypeError("give two arrays or paths, left and right, or these and a prior")
    left, right = (read_image(view, orient=orient) if isinstance(view, (str, os.PathLike)) else view for view in (pair[0], pair[1]))
    prior = pair[2] if count == 3 else None
    if not isinstance(prior, dict):
        prior = {"prior": prior}
    unknown = sorted(map(str, set(prior) - {"prior", "prior_sigma", "prior_kind"}))
    if unknown:
        raise TypeError(f"prior: {unknown[0]!r} is none of prior, prior_sigma, prior_kind")
    return matcher.match(left, right, **prior, **arguments)
