"""What shows itself in a notebook: one base for all that users meet there."""

from __future__ import annotations


class Shown:
    """A value with a card: its name, a table of what there is to know first, and where it is cheap a picture.

    What stands on the card of a type is said in `gapwalk.plot.card`, not here: a value does not know how it is drawn.
    """

    __slots__ = ()

    def _repr_html_(self) -> str:
        """The card, as HTML; a notebook asks for it."""
        from gapwalk.plot.card import card_of

        return card_of(self)
