"""Where work is done: pieces on local cores or on a cluster, and how far it has come.

Functions: `batch_flow_of`, `local_workers`, `on_cluster`, `on_cores`, `show_progress`.

Classes: `BatchFlow`, `BatchOptions`, `BatchRun`, `BatchSurvey`, `Pace`, `Workers`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
