"""`Spec`: a formula with its signals and constants, ready to be evaluated on batches of trajectories."""

import copy
import math
from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from numbers import Real
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from tltlrl.errors import nearest
from tltlrl.logic.declarations import Value
from tltlrl.logic.errors import Source, Span, SpecError, TraceError
from tltlrl.logic.explain import Explanation, explain
from tltlrl.logic.graph import BEGUN, Array
from tltlrl.logic.meaning import Meaning, Region
from tltlrl.logic.normalise import divided, predicates, spreads
from tltlrl.logic.online.memory import Memory, NotFiniteError
from tltlrl.logic.online.monitor import Monitor
from tltlrl.logic.online.pursuit import Compiled, compiled
from tltlrl.logic.online.sheet import Sheet
from tltlrl.logic.online.witness import Witnessed
from tltlrl.logic.parser import parse
from tltlrl.logic.parts import Parts, Reading, conjuncts_of, parts, reading, wanted
from tltlrl.logic.reach import beyond
from tltlrl.logic.resolve import resolve
from tltlrl.logic.semantics import Plan, Signals, plan
from tltlrl.logic.traps import Trap, traps

# Numbers in one block of trajectories: so few that the arrays of a formula stay in a core's cache.
BLOCK = 16_384


def parse_spec(
    text: str, constants: Mapping[str, object] | None = None, name: str = "<spec>", period: float | None = None
) -> "Spec":
    """Parses a spec from its text.

    Args:
      text: declarations and the formula; docs/spec-language.md describes the language.
      constants: values in place of the text's own.
      name: name of the text in messages.
      period: time between two samples, s; needed if bounds are in seconds and the text does not say it.

    Raises:
      SpecError: if the spec has a mistake.
    """
    return Spec(text, constants, name, period=period)


def is_signal_name(name: str) -> bool:
    """Whether a signal can have this name in a spec: one word that means nothing else in the language."""
    if not name.isidentifier():
        return False
    try:
        parse_spec(f"signal {name}\nspec: F {name} > 0")
    except SpecError:
        return False
    return True


def load_spec(path: str | Path, constants: Mapping[str, object] | None = None, period: float | None = None) -> "Spec":
    """Parses a spec from a UTF-8 file.

    Args:
      path: path of the file.
      constants: values in place of the file's own.
      period: time between two samples, s, as for `parse_spec`.

    Raises:
      SpecError: if the spec has a mistake.
      OSError: if the file cannot be read.
    """
    data = Path(path).read_bytes()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as mistake:
        line = data.count(b"\n", 0, mistake.start) + 1
        raise SpecError(
            Source(str(path), data.decode("utf-8", errors="replace")),
            Span(line, 1, line, 2),
            "the file is not UTF-8 text; expected a spec; save it as UTF-8",
        ) from None
    return Spec(text, constants, str(path), Path(path), period)


class Spec:
    """A TLTL formula over named signals. Immutable; equal if formula, declarations and constants are equal.

    Signals are passed as a mapping from name to an array of N trajectories with T samples: (N, T) for a scalar signal,
    (N, T, d) for a vector of dimension d. Other entries of the mapping are ignored. `lengths`, (N,) whole numbers from
    1 to T, says how many leading samples of each trajectory count; later samples are never read.

    Every evaluation raises TraceError if a signal is missing, has a wrong shape, is not finite or is empty, or if an
    expression of the spec has no finite value (division by zero, root of a negative number, overflow).
    """

    def __init__(
        self,
        text: str,
        constants: Mapping[str, object] | None,
        name: str,
        path: Path | None = None,
        period: float | None = None,
    ) -> None:
        if not isinstance(text, str):
            raise TypeError(f"a spec's text is a str, not {type(text).__name__}; load_spec reads one from a file")
        self.text, self.path = text, path
        self._source = Source(name, _with_plain_line_ends(text))
        self._meaning: Meaning = resolve(self._source, parse(self._source), constants, period)
        self._plan = lru_cache(maxsize=16)(self._make_plan)

    def __reduce__(self) -> tuple[object, ...]:
        return Spec, (self.text, self._meaning.constants, self._source.name, self.path, self.period)

    def __str__(self) -> str:
        """The text of the spec with its effective constants; it parses back to an equal spec."""
        return str(self._meaning.document)

    def __repr__(self) -> str:
        return f"<Spec {self._source.name}: {self.formula}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Spec) and self._meaning.document == other._meaning.document

    def __hash__(self) -> int:
        return hash(self._meaning.document)

    @property
    def formula(self) -> str:
        """The formula as it was read, without the declarations."""
        return str(self._meaning.document.formula)

    @property
    def signals(self) -> Mapping[str, int | None]:
        """The signals that the spec needs: name => dimension of a vector, None for a scalar."""
        return MappingProxyType(self._meaning.signals)

    @property
    def booleans(self) -> frozenset[str]:
        """The signals that are true or false: their arrays hold True and False, or 1 and 0."""
        return self._meaning.booleans

    @property
    def constants(self) -> Mapping[str, Value | dict[str, Value]]:
        """Name => effective value: a float, a tuple of floats for a vector, a dict label => value for a family."""
        return MappingProxyType(self._meaning.constants)

    @property
    def durations(self) -> frozenset[str]:
        """The names of the constants that are in seconds."""
        return self._meaning.durations

    @property
    def period(self) -> float | None:
        """The time between two samples, s; None if neither the text nor the caller says it."""
        return self._meaning.period

    @property
    def counts_seconds(self) -> bool:
        """Whether the spec has a period or a bound in seconds; then it fits trajectories of one period only."""
        return self._meaning.timed is not None or self.period is not None

    def sampled(self, period: float) -> "Spec":
        """The same spec for trajectories with `period` seconds between samples; itself if it counts no seconds.

        Raises:
          SpecError: if the text says another period, or a bound in seconds is not a whole number of samples.
        """
        if not self.counts_seconds:
            return self
        return Spec(self.text, self._meaning.constants, self._source.name, self.path, period)

    @property
    def definitions(self) -> Mapping[str, str]:
        """Name => formula, for the named sub-formulas in the order of the text; each member of a family is one."""
        return MappingProxyType({name: text for name, (_, text) in self._meaning.definitions.items()})

    @property
    def traps(self) -> tuple[Trap, ...]:
        """The traps in the formula: what it says about the ends of trajectories that is easily missed."""
        return traps(self._meaning.document)

    @property
    def regions(self) -> tuple[Region, ...]:
        """The balls and boxes of constant place and size in the formula."""
        return self._meaning.regions

    @property
    def horizon(self) -> int | None:
        """How many steps after the first sample the value can depend on; None if on the whole trajectory.

        Raises:
          SpecError: if it depends on a sampling period that is not known.
        """
        self._check_period()
        return self._meaning.graph.horizon(self._meaning.root)

    @property
    def memory(self) -> int | None:
        """How many earlier samples the value at a sample can depend on; None if on all, 0 without past operators.

        Raises:
          SpecError: if it depends on a sampling period that is not known.
        """
        self._check_period()
        return self._meaning.graph.memory(self._meaning.root)

    def _check_period(self) -> None:
        if self.period is None and self.counts_seconds:
            raise self._without_period(SpecError)

    def _without_period(self, kind: type[SpecError] | type[TraceError]) -> SpecError | TraceError:
        assert self._meaning.timed is not None
        return kind(
            self._source,
            self._meaning.timed,
            "the bound is in seconds, and how far apart samples are is not known; expected the sampling period; write "
            "for instance 'period 0.05 s' into the spec, or pass period=0.05",
        )

    def _batch(self, signals: Mapping[str, ArrayLike], lengths: ArrayLike | None) -> "_Batch":
        if self.period is None and self.counts_seconds:
            raise self._without_period(TraceError)
        return _Batch(self._meaning, self._source, signals, lengths)

    def robustness(self, signals: Mapping[str, ArrayLike], lengths: ArrayLike | None = None) -> Array:
        """The robustness of each whole trajectory, (N,), in the predicates' unit: > 0 satisfied, < 0 violated."""
        batch = self._batch(signals, lengths)
        node = self._meaning.start if batch.offset is None else self._meaning.root
        return self._at_start(batch, (node,))[node]

    def robustness_over_time(self, signals: Mapping[str, ArrayLike], lengths: ArrayLike | None = None) -> Array:
        """The robustness of each suffix, (N, T): column t is the value on the samples from t on.

        NaN from a trajectory's length on.
        """
        batch = self._batch(signals, lengths)
        return self._over_time(batch, (self._meaning.root,))[self._meaning.root]

    def definitions_over_time(
        self, signals: Mapping[str, ArrayLike], lengths: ArrayLike | None = None
    ) -> dict[str, Array]:
        """The robustness of each named sub-formula on each suffix: name => (N, T), as in `robustness_over_time`."""
        batch = self._batch(signals, lengths)
        nodes = {name: truth.node for name, (truth, _) in self._meaning.definitions.items()}
        values = self._over_time(batch, tuple(dict.fromkeys(nodes.values())))
        return {name: values[node] for name, node in nodes.items()}

    def normalised(self, signals: Mapping[str, ArrayLike], lengths: ArrayLike | None = None) -> "Spec":
        """The same spec with every predicate divided by its spread over these trajectories (tltlrl.logic.normalise).

        Verdicts stay the same; values have no unit. Use its `robustness` and `conjuncts` for learning.
        """
        places = predicates(self._meaning.formula)
        margins = self._over_time(self._batch(signals, lengths), tuple(places))
        result = copy.copy(self)
        result._meaning = divided(self._meaning, spreads(places, margins))
        result._plan = lru_cache(maxsize=16)(result._make_plan)
        for cached in ("_compiled", "_conjuncts", "_reading"):
            result.__dict__.pop(cached, None)
        return result

    def predicates_over_time(
        self, signals: Mapping[str, ArrayLike], lengths: ArrayLike | None = None
    ) -> dict[str, Array]:
        """The margin of each predicate of the formula at each sample: text => (N, T), as in `robustness_over_time`."""
        batch = self._batch(signals, lengths)
        nodes = self._meaning.predicates
        values = self._over_time(batch, tuple(dict.fromkeys(nodes.values())))
        return {text: values[node] for text, node in nodes.items()}

    def explain(self, signals: Mapping[str, ArrayLike], lengths: ArrayLike | None = None) -> tuple[Explanation, ...]:
        """Explains each trajectory's robustness: which predicate decides it, and at which step."""
        batch = self._batch(signals, lengths)
        named = (truth.node for truth, _ in self._meaning.definitions.values())
        self._over_time(batch, tuple({self._meaning.root, *named}))  # finds expressions without a finite value
        return tuple(explain(self._meaning, self._source.name, batch.single(row)) for row in range(batch.count))

    def monitor(self, count: int = 1, period: float | None = None) -> Monitor:
        """A monitor, which gives the robustness while trajectories run, sample by sample (docs/online.md).

        Args:
          count: number of trajectories that run side by side.
          period: time between two samples, s; needed if bounds are in seconds and the spec does not say it.

        Raises:
          SpecError: if the period is not known, or an operator cannot be monitored.
          ValueError: if count is not positive.
        """
        if count < 1:
            raise ValueError(f"count is {count}; expected 1 or more trajectories")
        if period is not None and period != self.period:
            return self.sampled(period).monitor(count)
        if self.period is None and self.counts_seconds:
            raise self._without_period(SpecError)
        ready = self._compiled
        return Monitor(ready, count, self._sample)

    def monitors(self) -> dict[str, Monitor]:
        """A monitor of one trajectory for every top-level clause: text => monitor, in the order of `clauses`.

        Raises:
          SpecError: as in `monitor`.
        """
        if self.period is None and self.counts_seconds:
            raise self._without_period(SpecError)
        ready = {text: self._compile(clause.node) for text, clause in self._reading.clauses.items()}
        return {text: Monitor(own, 1, self._sample) for text, own in ready.items()}

    def watch(self, period: float | None = None) -> Witnessed:
        """A monitor of one trajectory that also says what decides, as `explain` does.

        Args:
          period: between two samples, s.

        Raises:
          SpecError: as `monitor`.
        """
        spec = self if period is None else self.sampled(period)
        return Witnessed(spec.monitor(), spec._meaning, spec._source.name)

    @cached_property
    def _looks_back(self) -> bool:
        return self._meaning.looks_back

    @cached_property
    def _conjuncts(self) -> tuple[int, ...]:
        return conjuncts_of(self._meaning)

    @cached_property
    def _reading(self) -> Reading:
        return reading(self._meaning)

    @cached_property
    def _compiled(self) -> Compiled:
        return self._compile(self._meaning.root)

    def _compile(self, node: int) -> Compiled:
        try:
            return compiled(self._meaning.graph, node)
        except RecursionError:
            raise SpecError(
                self._source,
                self._meaning.document.formula.span,
                "the formula nests too deep to be monitored; expected fewer operators inside each other; "
                "evaluate whole recordings instead, as tltl check does",
            ) from None

    def _sample(
        self, sheet: Sheet, memory: Memory, signals: Mapping[str, ArrayLike], step: int
    ) -> tuple[Signals, Array]:
        """One sample of a monitor's trajectories: its signals, (N, 1), and the values of what is read of it."""
        count = memory.count
        block = self._plain_sample(signals, count) if isinstance(signals, Mapping) else None
        if block is None:
            block = self._checked_sample(signals, count, step).whole()
        try:
            return block, memory.values(sheet.read(block))
        except FloatingPointError:
            raise self._checked_sample(signals, count, step).failure(
                memory.layout.plan, slice(0, count), block
            ) from None
        except NotFiniteError as error:
            raise self._checked_sample(signals, count, step).not_finite(error.node, 0, error.row) from None

    def _checked_sample(self, signals: Mapping[str, ArrayLike], count: int, step: int) -> "_Batch":
        return _Batch(self._meaning, self._source, self._one_sample(signals, count), None, step)

    def _plain_sample(self, signals: Mapping[str, ArrayLike], count: int) -> Signals | None:
        """What `_checked_sample` makes of floats with which all is well, sooner; None for all else."""
        block: dict[tuple[str, int | None], Array] = {}
        if self._looks_back:
            block[BEGUN] = np.full((count, 1), np.inf)
        for name, dimension in self._meaning.signals.items():
            value = signals.get(name)
            # Of the class itself: a masked array has more to say than its numbers.
            if type(value) is not np.ndarray or value.dtype != np.float64:
                return None
            if value.shape != ((count,) if dimension is None else (count, dimension)):
                return None
            if not math.isfinite(np.vdot(value, value)):  # as soon as one is not, and in one call
                return None
            if name in self._meaning.booleans and not ((value == 0) | (value == 1)).all():
                return None
            if dimension is None:
                block[name, None] = value[:, None]
            else:
                for part in range(dimension):
                    block[name, part] = value[:, part, None]
        return block

    def _one_sample(self, signals: Mapping[str, ArrayLike], count: int) -> Mapping[str, ArrayLike]:
        """The signals of one sample as trajectories of one sample."""
        arrays: dict[str, ArrayLike] = dict(signals)
        for name, dimension in self._meaning.signals.items():
            if name not in signals:
                continue  # the batch says so
            value = np.asanyarray(signals[name])  # a masked array stays one, and is refused
            own = () if dimension is None else (dimension,)
            if value.shape == own and count == 1:
                value = value[None]
            if value.shape != (count, *own):
                raise TraceError(
                    self._source,
                    self._meaning.signal_spans[name],
                    f"signal '{name}' has shape {value.shape}; expected {(count, *own)}, a sample of each trajectory; "
                    "reshape it, or ask for a monitor of another count",
                )
            arrays[name] = value[:, None]
        return arrays

    def check_length(self, signals: Mapping[str, ArrayLike]) -> None:
        """Checks that trajectories of this length can satisfy and can violate every part of the formula.

        Args:
          signals: signals of any trajectory of that length, arrays (1, T) or (1, T, d).

        Raises:
          SpecError: at the innermost part whose windows lie beyond the end.
        """
        batch = self._batch(signals, None)
        if (found := beyond(self._meaning, batch.single(0))) is None:
            return
        part, value = found
        assert part.span is not None
        raise SpecError(
            self._source,
            part.span,
            f"{'every' if value > 0 else 'no'} trajectory of {batch.steps} samples satisfies this, whatever it does; "
            f"expected windows that begin by the last sample, step {batch.steps - 1}; lower the bounds, or make the "
            "episode longer",
        )

    def clauses(self, signals: Mapping[str, ArrayLike], lengths: ArrayLike | None = None) -> dict[str, Array]:
        """The robustness of each top-level clause on each whole trajectory: text => (N,), in the order of the text.

        Clauses are the operands of the conjunction at the top of the formula, or the formula itself. The smallest of
        their values is the robustness.
        """
        own, batch = self._reading.clauses, self._batch(signals, lengths)
        values = self._at_start(batch, tuple(dict.fromkeys(clause.node for clause in own.values())))
        return {text: values[clause.node] for text, clause in own.items()}

    def conjuncts(self, signals: Mapping[str, ArrayLike], lengths: ArrayLike | None = None) -> Array:
        """The robustness of each conjunct on each whole trajectory, shape (N, C); the smallest is the robustness.

        Conjuncts are the clauses, and where one is an `all`, a conjunction, or G of one, what that consists of.
        """
        values = self._at_start(self._batch(signals, lengths), self._conjuncts)
        return np.stack([values[node] for node in self._conjuncts], axis=1)

    def parts(self, signals: Mapping[str, ArrayLike], lengths: ArrayLike | None = None) -> Parts:
        """The values of the clauses and named sub-formulas on each trajectory, and which of them decide.

        If the left operand of a U or T holds temporal operators, the search for what decides ends at that operator.
        """
        meaning, batch = self._meaning, self._batch(signals, lengths)
        read = self._reading
        values = self._over_time(batch, read.over_time, read.at_start)
        samples = np.full(batch.count, batch.steps)
        return parts(meaning, read, values, samples if batch.offset is None else samples - batch.offset)

    @property
    def asks_for(self) -> Mapping[str, tuple[str, ...]]:
        """Clause => the named sub-formulas in it that it asks to hold (and not to fail)."""
        return MappingProxyType(wanted(self._meaning))

    def _make_plan(self, over_time: tuple[int, ...], at_start: tuple[int, ...], end: int) -> Plan:
        return plan(self._meaning.graph, dict.fromkeys(at_start, (0, 1)) | dict.fromkeys(over_time, (0, end)), end)

    def _run(
        self, batch: "_Batch", rows: slice, block: Signals, over_time: tuple[int, ...], at_start: tuple[int, ...]
    ) -> dict[int, Array]:
        try:
            return self._plan(over_time, at_start, batch.steps).run(block)
        except FloatingPointError:
            root, start = self._meaning.root, self._meaning.start
            if at_start == (start,) != (root,):  # a shortcut's operations stand nowhere in the spec
                return {start: self._run(batch, rows, block, (), (root,))[root]}
            raise batch.failure(self._plan(over_time, at_start, batch.steps), rows, block) from None

    def _at_start(self, batch: "_Batch", roots: tuple[int, ...]) -> dict[int, Array]:
        """The values of nodes on whole trajectories: node => (N,)."""
        out = {root: np.empty(batch.count) for root in roots}
        for rows, block in batch.blocks():
            if batch.offset is None:
                for root, values in self._run(batch, rows, block, (), roots).items():
                    out[root][rows] = values[:, 0]
            else:
                offset = batch.offset[rows]
                for root, values in self._run(batch, rows, block, roots, ()).items():
                    out[root][rows] = values[np.arange(len(offset)), offset]
        return out

    def _over_time(self, batch: "_Batch", roots: tuple[int, ...], at_start: tuple[int, ...] = ()) -> dict[int, Array]:
        """The values of nodes on all suffixes: node => (N, T).

        Those of `at_start` are read at the first sample alone, and may have fewer columns.
        """
        if batch.offset is None and batch.steps == batch.width and batch.in_one_block:
            return self._run(batch, slice(0, batch.count), batch.whole(), roots, at_start)
        out = {root: np.full((batch.count, batch.width), np.nan) for root in roots + at_start}
        for rows, block in batch.blocks():
            for root, values in self._run(batch, rows, block, roots + at_start, ()).items():
                if batch.offset is None:
                    out[root][rows, : batch.steps] = values
                else:
                    for row, whole in enumerate(values, start=rows.start):
                        own = whole[batch.offset[row] :]
                        out[root][row, : len(own)] = own
        return out


def _with_plain_line_ends(text: str) -> str:
    """Lines of other systems may end in CR or CR LF; a comment ends with its line."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _floats(given: ArrayLike) -> Array:
    """An array of numbers as float64.

    Raises:
      TypeError, ValueError, OverflowError: for anything that is not: texts, dates and complex numbers, which NumPy
        would turn into floats.
    """
    array = np.asarray(given)
    numbers = array.dtype.kind in "biuf" or (array.dtype.kind == "O" and all(isinstance(v, Real) for v in array.flat))
    if not numbers:
        raise TypeError
    return array.astype(np.float64, copy=False)


class _Batch:
    """Checked signals, cut into blocks.

    Trajectories of different length are aligned at their ends, with their first samples repeated in front. The padding
    changes no value: most operators look forward, and operators of the past know where a trajectory begins (BEGUN).
    """

    def __init__(
        self,
        meaning: Meaning,
        source: Source,
        signals: Mapping[str, ArrayLike],
        lengths: ArrayLike | None,
        origin: int = 0,
    ) -> None:
        self.meaning, self.source = meaning, source
        self.origin = origin  # the number of the first sample, in messages
        if not isinstance(signals, Mapping):
            raise self.error(
                next(iter(meaning.signals)),
                f"the signals are a {type(signals).__name__}; expected a mapping from name to array; "
                "pass for instance {'x': array}",
            )
        self.arrays = {name: self._array(name, signals) for name in meaning.signals}
        shapes = {name: array.shape[:2] for name, array in self.arrays.items()}
        self.count, self.width = next(iter(shapes.values()))
        for name, shape in shapes.items():
            if shape != (self.count, self.width):
                first = next(iter(shapes))
                raise self.error(
                    name,
                    f"signal '{name}' holds {shape[0]} trajectories of {shape[1]} samples; expected "
                    f"{self.count} of {self.width}, as signal '{first}'; record all signals together",
                )
            if self.width == 0:
                raise self.error(
                    name,
                    f"signal '{name}' has no samples; expected at least one; leave empty trajectories out",
                )
        self.steps = self.width
        self.offset: np.ndarray[tuple[int], np.dtype[np.intp]] | None = None
        if lengths is not None:
            self._set_lengths(lengths)
        for name, array in self.arrays.items():
            self._check_finite(name, array)
        for name in meaning.booleans & self.arrays.keys():
            self._check_boolean(name)

    def error(self, name: str, problem: str) -> TraceError:
        return TraceError(self.source, self.meaning.signal_spans[name], problem)

    def _array(self, name: str, signals: Mapping[str, ArrayLike]) -> Array:
        if name not in signals:
            raise self.error(
                name,
                f"the trajectories have no signal '{name}'; expected one{nearest(name, signals) or '; there are none'}",
            )
        dimension = self.meaning.signals[name]
        expected = "(N, T)" if dimension is None else f"(N, T, {dimension})"
        given = signals[name]
        rows = given if isinstance(given, list | tuple) else [given]
        if any(map(np.ma.is_masked, rows)):  # NumPy would lose the mask
            raise self.error(
                name,
                f"signal '{name}' holds masked numbers; expected numbers alone; cut the recording with lengths or "
                "fill them",
            )
        try:
            array = _floats(given)
        except (TypeError, ValueError, OverflowError):
            raise self.error(
                name, f"signal '{name}' is no array of numbers; expected shape {expected}; pass floats"
            ) from None
        if array.ndim != (2 if dimension is None else 3) or (dimension is not None and array.shape[2] != dimension):
            raise self.error(
                name,
                f"signal '{name}' has shape {array.shape}; expected {expected}: trajectories, samples"
                f"{'' if dimension is None else ', components'}; reshape it (one trajectory is a batch: "
                f"x[None])",
            )
        return array

    def _set_lengths(self, lengths: ArrayLike) -> None:
        name = next(iter(self.arrays))
        expected = f"expected ({self.count},) whole numbers, one per trajectory; correct it"
        try:
            given = np.asarray(lengths)
        except ValueError:
            raise self.error(name, f"lengths is no array; {expected}") from None
        if given.shape != (self.count,) or (self.count and not np.issubdtype(given.dtype, np.integer)):
            raise self.error(name, f"lengths has shape {given.shape} and type {given.dtype}; {expected}")
        if not self.count:
            return
        wrong = np.flatnonzero((given < 1) | (given > self.width))
        if len(wrong):
            raise self.error(
                name,
                f"the length of trajectory {wrong[0]} is {given[wrong[0]]}; expected 1 to {self.width}; "
                "leave empty trajectories out",
            )
        self.steps = int(given.max())
        if given.min() < self.steps:
            self.offset = self.steps - given.astype(np.intp)

    def _check_finite(self, name: str, array: Array) -> None:
        with np.errstate(over="ignore", invalid="ignore"):
            if np.isfinite(np.add.reduce(array, axis=None)):  # faster than asking each, and never wrong
                return
        finite = np.asarray(np.isfinite(array.reshape(self.count, self.width, -1)).all(axis=2))
        if self.offset is None:
            finite[:, self.steps :] = True
        else:
            finite |= np.arange(self.width) >= (self.steps - self.offset)[:, None]
        bad = np.argwhere(~finite)
        if len(bad):
            row, step = map(int, bad[0])
            raise self.error(
                name,
                f"signal '{name}' is {array[row, step]} at trajectory {row}, step {step + self.origin}; expected "
                f"finite numbers; "
                "repair the recording or cut it with lengths",
            )

    def _check_boolean(self, name: str) -> None:
        array = self.arrays[name][:, : self.steps]
        first = self.steps if self.offset is None else (self.steps - self.offset)[:, None]
        bad = np.argwhere((array != 0) & (array != 1) & (np.arange(self.steps) < first))
        if len(bad):
            row, step = map(int, bad[0])
            raise self.error(
                name,
                f"signal '{name}' is {array[row, step]:g} at trajectory {row}, step {step}; expected true or false, 1 "
                "or 0, as it is declared; repair the recording, or declare it without ': bool' and compare it",
            )

    def blocks(self) -> Iterator[tuple[slice, dict[tuple[str, int | None], Array]]]:
        """Slices of trajectories and their signals, one (trajectories, steps) array per component."""
        for start in range(0, self.count, self._size):
            rows = slice(start, min(start + self._size, self.count))
            yield rows, self._block(rows)

    @property
    def in_one_block(self) -> bool:
        """Whether there is a single block of trajectories."""
        return 0 < self.count <= self._size

    @property
    def _size(self) -> int:
        return max(1, BLOCK // self.steps)

    def _block(self, rows: slice) -> dict[tuple[str, int | None], Array]:
        parts: dict[tuple[str, int | None], Array] = {BEGUN: self._begun(rows)} if self.meaning.looks_back else {}
        for name, whole in self.arrays.items():
            array = whole[rows, : self.steps]
            if self.offset is not None:
                index = np.maximum(np.arange(self.steps) - self.offset[rows, None], 0)
                array = np.take_along_axis(array, index if array.ndim == 2 else index[:, :, None], axis=1)
            if array.ndim == 2:
                parts[name, None] = array
            else:
                parts.update({(name, i): array[:, :, i] for i in range(array.shape[2])})
        return parts

    def whole(self) -> dict[tuple[str, int | None], Array]:
        """The signals of all trajectories."""
        return self._block(slice(0, self.count))

    def _begun(self, rows: slice) -> Array:
        count = len(range(*rows.indices(self.count)))
        if self.offset is None:
            return np.broadcast_to(np.inf, (count, self.steps))
        return np.where(np.arange(self.steps) >= self.offset[rows, None], np.inf, -np.inf)

    def single(self, row: int) -> dict[tuple[str, int | None], Array]:
        """One trajectory's signals, cut to its length."""
        steps = self.steps - (0 if self.offset is None else int(self.offset[row]))
        return {BEGUN: np.broadcast_to(np.inf, (1, steps))} | {
            (name, i): array[row : row + 1, :steps] if i is None else array[row : row + 1, :steps, i]
            for name, array in self.arrays.items()
            for i in ((None,) if array.ndim == 2 else range(array.shape[2]))
        }

    def failure(self, ready: Plan, rows: slice, block: Signals) -> TraceError:
        """Which expression has no finite value, and where."""
        node, step, row = ready.failure(block)
        row += rows.start
        if self.offset is not None:
            step = max(0, step - int(self.offset[row]))
        return self.not_finite(node, step, row)

    def not_finite(self, node: int, step: int, row: int) -> TraceError:
        """What is wrong with an expression at a step of a trajectory."""
        place = self.meaning.places[node]
        problem = {
            "divide": "division by zero or overflow",
            "sqrt": "the square root of a negative number",
            "log": "the logarithm of a number that is not above 0",
            "asin": "the arc sine of a number beyond -1 and 1",
            "acos": "the arc cosine of a number beyond -1 and 1",
            "mod": "division by zero",
            "power": "a power without a finite value",
        }.get(self.meaning.graph.ops[node].name, "a number too large for a float")
        return TraceError(
            self.source,
            place.span,
            f"'{place.text}' has no finite value at trajectory {row}, step {step + self.origin}: {problem}; "
            "expected a finite number; guard the expression or repair the recording",
        )
