"""Public names of `gapwalk.parallel`; see `gapwalk.lazy_names`."""

from ..ensemble import BatchOptions as BatchOptions
from ..ensemble import batch_flow_of as batch_flow_of
from ..notebook import show_progress as show_progress
from .workers import Workers as Workers
from .workers import local_workers as local_workers
from .workers import on_cluster as on_cluster
from .workers import on_cores as on_cores
