"""A result kept as one HTML file: the diagram and motions of the explorer's page, without its server."""

from gapwalk.explorer.saved.save_page import save_html

__all__ = ["save_html"]
