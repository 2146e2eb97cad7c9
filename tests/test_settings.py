"""Settings check themselves wherever they are made."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from tltlrl.errors import UserError
from tltlrl.settings import check, setting


@dataclass(frozen=True)
class Own:
    """Settings of every kind that asks for whole numbers."""

    steps: int = setting("samples", 3, least=2)
    most: int | None = setting("samples at most", None, least=2)
    places: list[int] = setting("samples at which it is", [0, 4], least=0)
    share: float = setting("a share", 0.5)

    def __post_init__(self) -> None:
        check(self, "own")


@pytest.mark.parametrize(
    "values", [{}, {"steps": np.int64(50)}, {"most": 7}, {"places": []}, {"share": 1}, {"share": np.float64(0.2)}]
)
def test_what_is_right_is_taken(values: dict[str, Any]) -> None:
    Own(**values)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"steps": 2.5}, "own.steps: expected a whole number, not 2.5"),
        ({"steps": True}, "own.steps: expected a whole number, not True"),
        ({"steps": None}, "own.steps: expected a whole number, not None"),
        ({"steps": 1}, "own.steps: 1 is too small; it must be at least 2"),
        ({"most": 2.5}, "own.most: expected a whole number, not 2.5"),
        ({"most": 1}, "own.most: 1 is too small; it must be at least 2"),
        ({"places": [0, 40.5]}, r"own.places: expected a whole number, not \[0, 40.5\]"),
    ],
)
def test_what_is_wrong_is_told(values: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=f"^{message}$"):
        Own(**values)
