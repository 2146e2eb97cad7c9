"""The definition of TLTL robustness, as slow and as obvious as it can be written: the judge of the fast
evaluator.

`robustness(f, trace, t, e)` is the value of f on the slice [t, e) of one trajectory, trace[name][t] being a
float. Only what the random formulas of strategies.py hold is read: numbers, names of scalar signals, every
formula operator.
"""

import math
from math import inf

from tltlrl.logic import syntax as s

FUNCTIONS = {
    "min": min,
    "sqrt": math.sqrt,
    "exp": math.exp,
    "log": math.log,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan2": math.atan2,
    "floor": math.floor,
    "mod": lambda a, b: a - b * math.floor(a / b),
    "sign": lambda a: float(a > 0) - float(a < 0),
    "clip": lambda a, low, high: max(low, min(a, high)),
    "wrap": lambda a: math.pi - (math.pi - a) % (2 * math.pi),
}


def number(f, trace, t):
    match f:
        case s.Number(value):
            return value
        case s.Name(name):
            return trace[name][t]
        case s.Negative(a):
            return -number(a, trace, t)
        case s.Arithmetic("+", a, b):
            return number(a, trace, t) + number(b, trace, t)
        case s.Arithmetic("-", a, b):
            return number(a, trace, t) - number(b, trace, t)
        case s.Arithmetic("*", a, b):
            return number(a, trace, t) * number(b, trace, t)
        case s.Call("abs", (a,)):
            return abs(number(a, trace, t))
        case s.Call("max", operands):
            return max(number(a, trace, t) for a in operands)
        case s.Call(name, operands) if name in FUNCTIONS:
            return FUNCTIONS[name](*(number(a, trace, t) for a in operands))
        case s.Call("norm", (s.Vector(items),)):
            return math.sqrt(sum(number(a, trace, t) ** 2 for a in items))
        case s.Call("distance", (s.Vector(p), s.Vector(q))):
            return math.sqrt(sum((number(a, trace, t) - number(b, trace, t)) ** 2 for a, b in zip(p, q, strict=True)))
        case s.Call("dot", (s.Vector(p), s.Vector(q))):
            return sum(number(a, trace, t) * number(b, trace, t) for a, b in zip(p, q, strict=True))
        case s.Call("previous", (a,)):
            return number(a, trace, max(t - 1, 0))
    raise TypeError(f)


def robustness(f, trace, t, e):
    def rho(g, t, e):
        return robustness(g, trace, t, e)

    def window(interval):
        """The times t + [a, b], cut at the end of the slice."""
        a = 0 if interval is None else int(interval.lower.value)
        b = e if interval is None or isinstance(interval.upper, s.Infinity) else int(interval.upper.value)
        return range(min(t + a, e), min(t + b + 1, e))

    def is_cut(interval):
        """Whether the window reaches beyond the end of the slice."""
        return t + int(interval.upper.value) >= e

    def before(interval):
        """The times t - [a, b], cut at the first sample of the trajectory."""
        a = 0 if interval is None else int(interval.lower.value)
        b = t if interval is None or isinstance(interval.upper, s.Infinity) else int(interval.upper.value)
        return range(max(0, t - b), max(0, t - a + 1))

    def sign(value):
        return 0.0 if value == 0 else inf if value > 0 else -inf

    match f:
        case s.Comparison(operands, operators):
            margins = []
            for a, b, operator in zip(operands, operands[1:], operators, strict=False):
                difference = number(b, trace, t) - number(a, trace, t)
                margins.append(difference if operator in ("<", "<=") else -difference)
            return min(margins)
        case s.Not(p):
            return -rho(p, t, e)
        case s.And(operands):
            return min(rho(p, t, e) for p in operands)
        case s.Or(operands):
            return max(rho(p, t, e) for p in operands)
        case s.Implies(p, q):
            return max(-rho(p, t, e), rho(q, t, e))
        case s.Iff(p, q):
            return min(max(-rho(p, t, e), rho(q, t, e)), max(-rho(q, t, e), rho(p, t, e)))
        case s.Xor(p, q):
            return max(min(rho(p, t, e), -rho(q, t, e)), min(rho(q, t, e), -rho(p, t, e)))
        case s.Boolean(value):
            return inf if value else -inf
        case s.Name(name):
            return inf if trace[name][t] else -inf
        case s.Call("ball", (p, q, radius)):
            return number(radius, trace, t) - number(s.Call("distance", (p, q)), trace, t)
        case s.Call("box", (s.Vector(p), s.Vector(low), s.Vector(high))):
            return min(
                min(number(x, trace, t) - number(a, trace, t), number(b, trace, t) - number(x, trace, t))
                for x, a, b in zip(p, low, high, strict=True)
            )
        case s.Call("holds", (p,)):
            return sign(rho(p, t, e))
        case s.Call("previous", (p,)):
            return rho(p, t - 1, e) if t > 0 else inf
        case s.Call("rise", (p,)):
            return min(rho(p, t, e), -rho(p, t - 1, e) if t > 0 else inf)
        case s.Call("fall", (p,)):
            return min(-rho(p, t, e), rho(p, t - 1, e) if t > 0 else inf)
        case s.Previous(p):
            return rho(p, t - 1, e) if t > 0 else -inf
        case s.Once(p, interval):
            return max((rho(p, k, e) for k in before(interval)), default=-inf)
        case s.Historically(p, interval):
            return min((rho(p, k, e) for k in before(interval)), default=inf)
        case s.Since(p, q, interval):
            return max(
                (
                    min(rho(q, k, e), min((rho(p, j, e) for j in range(k + 1, t + 1)), default=inf))
                    for k in before(interval)
                ),
                default=-inf,
            )
        case s.Always(p, s.Interval(a, b, "!") as w):
            return -inf if is_cut(w) else rho(s.Always(p, s.Interval(a, b)), t, e)
        case s.Eventually(p, s.Interval(a, b, "?") as w):
            return inf if is_cut(w) else rho(s.Eventually(p, s.Interval(a, b)), t, e)
        case s.Until(p, q, s.Interval(a, b, "?") as w):
            until = rho(s.Until(p, q, s.Interval(a, b)), t, e)
            return max(until, rho(s.Always(p), t, e)) if is_cut(w) else until
        case s.Release(p, q, s.Interval(a, b, "!") as w):
            release = rho(s.Release(p, q, s.Interval(a, b)), t, e)
            return min(release, rho(s.Eventually(p), t, e)) if is_cut(w) else release
        case s.Next(p, strong):
            return rho(p, t + 1, e) if t + 1 < e else (-inf if strong else inf)
        case s.Always(p, interval):
            return min((rho(p, k, e) for k in window(interval)), default=inf)
        case s.Eventually(p, interval):
            return max((rho(p, k, e) for k in window(interval)), default=-inf)
        case s.Until(p, q, interval):
            return max(
                (min(rho(q, k, e), min((rho(p, j, k) for j in range(t, k)), default=inf)) for k in window(interval)),
                default=-inf,
            )
        case s.Release(p, q, interval):
            return min(
                (max(rho(q, k, e), max((rho(p, j, k) for j in range(t, k)), default=-inf)) for k in window(interval)),
                default=inf,
            )
        case s.WeakUntil(p, q, interval):
            held = None if interval is None else s.Interval(s.Number(0.0), interval.upper)
            return max(rho(s.Until(p, q, interval), t, e), rho(s.Always(p, held), t, e))
        case s.Then(p, q, interval):
            return max(
                (min(rho(q, k, e), max((rho(p, j, k) for j in range(t, k)), default=-inf)) for k in window(interval)),
                default=-inf,
            )
        case s.ForEach("all", _, labels, p):
            return min(rho(p, t, e) for _ in labels)
        case s.ForEach("any", _, labels, p):
            return max(rho(p, t, e) for _ in labels)
    raise TypeError(f)
