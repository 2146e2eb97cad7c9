"""Running and sliding extremes of (trajectories, steps) arrays, and the scans behind U and T.

`fold` is np.minimum or np.maximum throughout. All functions take time linear in the array's size, whatever
the width of a window.
"""

from typing import Any

import numpy as np

from tltlrl.logic.graph import Array

Fold = Any  # a np.ufunc, whose methods NumPy does not type
# Below this window, doubling (one fast pass per power of two) beats van Herk's two slow ones.
_NARROW = 4096
_DOUBLED = range(4096, 16_385)  # sizes for which doubling beats accumulate: few passes, in a core's cache


def padded(x: Array, steps: int, filler: float) -> Array:
    """`x`, lengthened to `steps` columns."""
    if x.shape[1] == steps:
        return x
    out: Array = np.empty((len(x), steps))
    out[:, : x.shape[1]] = x
    out[:, x.shape[1] :] = filler
    return out


def reduced(fold: Fold, x: Array) -> Array:
    """The fold over all columns, as one column."""
    column: Array = fold.reduce(x, axis=1, keepdims=True)
    return column


def second_smallest(x: Array) -> Array:
    """The second smallest number of each row, as one column; inf where there is only one."""
    rest = np.array(x)
    rest[np.arange(len(x)), x.argmin(axis=1)] = np.inf
    return reduced(np.minimum, rest)


def suffixes(fold: Fold, x: Array, out: Array | None = None, spare: Array | None = None) -> Array:
    """Column t of the result is the fold over columns t, t+1, ... of x; with a `spare` array like `out` sooner."""
    out = np.empty_like(x) if out is None else out
    if spare is not None and x.size in _DOUBLED:
        return _doubled(fold, x, out, spare, backwards=True)
    fold.accumulate(x[:, ::-1], axis=1, out=out[:, ::-1])
    return out


def prefixes(fold: Fold, x: Array, out: Array, spare: Array) -> Array:
    """Column t of the result is the fold over columns 0, 1, ... t of x; `out` and `spare` are like x."""
    if x.size in _DOUBLED:
        return _doubled(fold, x, out, spare, backwards=False)
    column: Array = fold.accumulate(x, axis=1, out=out)
    return column


def _doubled(fold: Fold, x: Array, out: Array, spare: Array, backwards: bool) -> Array:
    """`suffixes` or `prefixes` by passes over all samples at once, which are 1, 2, 4, ... steps apart.

    NumPy's accumulate needs one pass, but in it each sample waits for the one before.
    """
    passes = (x.shape[1] - 1).bit_length()
    targets = (out, spare) if passes % 2 else (spare, out)  # the last pass writes to `out`
    if not (x.flags.c_contiguous and passes):
        np.copyto(targets[1], x)
        x = targets[1]
    for k in range(passes):
        span, target = 1 << k, targets[k % 2]
        first, second, ends = slice(None, -span), slice(span, None), slice(-span, None)
        if not backwards:
            first, second, ends = second, first, slice(None, span)
        # On the flattened arrays, where the ends of rows meet their neighbours and are repaired.
        flat = x.reshape(-1)
        fold(flat[first], flat[second], out=target.reshape(-1)[first])
        target[:, ends] = x[:, ends]
        x = target
    return out


def _beside(fold: Fold, x: Array, other: Array, span: int) -> Array:
    """Column t of the result is fold(x_t, other_{t+span}); x_t in the last `span` columns, which have no
    partner.

    On the flattened arrays, where the ends of rows meet their neighbours and are repaired: many times
    faster than on slices of rows.
    """
    out = np.empty_like(x)
    fold(x.reshape(-1)[:-span], other.reshape(-1)[span:], out=out.reshape(-1)[:-span])
    out[:, -span:] = x[:, -span:]
    return out


def windows(fold: Fold, x: Array, size: int) -> Array:
    """Column t of the result is the fold over columns t .. t + size - 1 of x; size - 1 columns fewer."""
    width = x.shape[1] - size + 1
    if width == 1:
        return reduced(fold, x)
    x = np.array(x, order="C")
    if size <= _NARROW:
        # Two windows of length 2^k, one at each end, cover the whole.
        span = 1
        while 2 * span <= size:
            x = _beside(fold, x, x, span)
            span *= 2
        covered = x if size == span else _beside(fold, x, x, size - span)
        return covered[:, :width]
    # van Herk, Gil and Werman: cut into blocks of `size`; a window is the tail of one and the head of the
    # next.
    count, blocks = len(x), -(-x.shape[1] // size)
    x = padded(x, blocks * size, 0.0).reshape(count * blocks, size)
    heads = fold.accumulate(x, axis=1).reshape(count, blocks * size)
    tails = suffixes(fold, x).reshape(count, blocks * size)
    joined: Array = fold(tails[:, :width], heads[:, size - 1 : size - 1 + width])
    return joined


def pairs(p: Array, q: Array, low: int, high: int) -> Array:
    """Column t of the result is the largest min(p_i, q_k) with t <= i < k and t + low <= k <= t + high.

    Of two stretches of time, one after the other, the best pair is that of either, or the largest p of the first with
    the largest q of the second. So a stretch of any length is joined from those of lengths 1, 2, 4, ...

    Args:
      p: (N, T - 1).
      q: (N, T).
      low, high: whole numbers, 0 <= low <= high.

    Returns:
      (N, T).
    """
    count, steps = q.shape
    size = min(high, steps - 1) - low + 1
    out = np.full((count, steps), -np.inf)
    if size < 1:
        return out
    # From t + low on: stretches of `size` samples, padded with samples that no pair holds.
    width = steps + size
    ps, qs, best = padded(p, width, -np.inf), padded(q, width, -np.inf), np.full((count, width), -np.inf)
    whole: tuple[Array, Array, Array] | None = None

    def joined(a: tuple[Array, Array, Array], b: tuple[Array, Array, Array], span: int) -> tuple[Array, Array, Array]:
        """Stretches a, of `span` samples, each with the stretch b that follows it."""
        pair = np.maximum(a[2][:, :-span], b[2][:, span:])
        np.maximum(pair, np.minimum(a[0][:, :-span], b[1][:, span:]), out=pair)
        first = np.maximum(a[0][:, :-span], b[0][:, span:])
        second = np.maximum(a[1][:, :-span], b[1][:, span:])
        return tuple(padded(x, width, -np.inf) for x in (first, second, pair))  # type: ignore[return-value]

    power, span, done = (ps, qs, best), 1, 0
    while True:
        if size & span:
            whole = power if whole is None else joined(whole, power, done)
            done += span
        if done == size:
            break
        power, span = joined(power, power, span), 2 * span
    assert whole is not None
    _, later, inside = whole
    out[:, : steps - low] = inside[:, low:steps]
    if low > 0:  # or the first before t + low
        earlier = windows(np.maximum, padded(p, steps + low, -np.inf), low)[:, :steps]
        np.maximum(
            out[:, : steps - low], np.minimum(earlier[:, : steps - low], later[:, low:steps]), out=out[:, : steps - low]
        )
    return out


def until(p: Array, q: Array) -> Array:
    """p U q on every suffix, (N, T), from p without its last column and q.

    y_t = max(q_t, min(p_t, y_{t+1})), and w such steps at once are y_t = max(b_t, min(a_t, y_{t+w})). By
    doubling, a and b are made for a w of about sqrt(T), at most 256; with these the steps are taken w at a
    time from the end.
    """
    steps = q.shape[1]
    a, y, w = padded(p, steps, -np.inf), np.array(q), 1
    while w * w < steps and w < 256:
        reached = _beside(np.minimum, a, y, w)
        reached[:, -w:] = -np.inf
        y = np.maximum(y, reached)
        a = _beside(np.minimum, a, a, w)
        w *= 2
    for stop in range(steps - w, 0, -w):
        start = max(0, stop - w)
        now, beyond = y[:, start:stop], y[:, start + w : stop + w]
        np.maximum(now, np.minimum(a[:, start:stop], beyond), out=now)
    return y
