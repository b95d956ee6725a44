"""The base class of values that show a card in a notebook."""

from __future__ import annotations


class Shown:
    """A value with a card: its name, a table of its main figures, and a picture if that is cheap.

    The contents of the card of each type are defined in `gapwalk.plot.card`: a value does not know how it is drawn.
    """

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return the card as HTML; the notebook calls this."""
        from gapwalk.plot.card import card_of

        return card_of(self)
