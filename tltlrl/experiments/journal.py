"""The journal of a search, in Optuna's format. It lists the candidates; their values come from their sealed runs."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tltlrl.errors import UserError
from tltlrl.store.files import write_bytes

if TYPE_CHECKING:
    import optuna
    from optuna.trial import FrozenTrial


def open_journal(journal: Path) -> optuna.Study:
    """Opens Optuna's study in a journal file, which is made if there is none.

    A killed process may have left a lock and half a line at the end, which records nothing; both are removed. The
    caller holds the folder's own lock, so nobody else is writing.

    Raises:
      UserError: if the journal cannot be read.
    """
    import optuna
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    journal.with_name(f"{journal.name}.lock").unlink(missing_ok=True)
    if journal.exists() and not (content := journal.read_bytes()).endswith(b"\n"):
        write_bytes(journal, content[: content.rfind(b"\n") + 1])
    try:
        storage = JournalStorage(JournalFileBackend(str(journal)))
        return optuna.create_study(storage=storage, study_name="search", direction="maximize", load_if_exists=True)
    except (ValueError, KeyError, TypeError, AssertionError) as error:
        raise UserError(
            f"{journal} is damaged ({error}); put back a copy of it, or set another name=... or overwrite=true"
        ) from error


def proven(candidates: Sequence[FrozenTrial], values: Mapping[int, float]) -> list[FrozenTrial]:
    """The candidates with the values from their runs; complete candidates without a value count as failed.

    Args:
      candidates: candidates in the journal.
      values: number => objective, for every candidate whose runs are whole.
    """
    from optuna.trial import TrialState

    found = [copy.copy(candidate) for candidate in candidates]
    for candidate in found:
        if candidate.state != TrialState.COMPLETE:
            continue
        if candidate.number in values:
            candidate.value = values[candidate.number]
        else:
            candidate.value, candidate.state = None, TrialState.FAIL
    return found
