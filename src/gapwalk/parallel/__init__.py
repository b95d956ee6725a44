"""Where work is done: pieces on local cores or on a cluster, and how far it has come."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
