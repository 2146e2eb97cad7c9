"""Pictures that are not painted, for tests that only look at whether a picture is there, whole, and of what."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def sketch(figure: Figure, suffix: str, dpi: int, told: Mapping[str, str] | None = None) -> bytes:
    """In place of `plotting.picture`: as large as a small picture, and another one if what is drawn is another.

    Painting takes a second per figure; that it gives the same bytes is tested in tests/reports.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D
    from matplotlib.text import Text

    from tltlrl.reports.plotting import END

    drawn = hashlib.sha256(f"{suffix} {dpi} {figure.get_size_inches()}".encode())
    for artist in figure.findobj():
        drawn.update(type(artist).__name__.encode())
        if isinstance(artist, Text):
            drawn.update(artist.get_text().encode())
        elif isinstance(artist, Line2D):
            drawn.update(f"{artist.get_color()} {artist.get_linestyle()}".encode() + artist.get_xydata().tobytes())
        elif isinstance(artist, LineCollection):
            drawn.update(b"".join(segment.tobytes() for segment in artist.get_segments()))
    return "\n".join([drawn.hexdigest() * 800, *(told or {}).values(), ""]).encode() + END.get(suffix, b"")
