"""The batch integrator: many motions at once, one per lane of a compiled kernel, checked against the exact flow."""

from gapwalk.ensemble.batch_flow import BatchFlow, BatchOptions, BatchRun, BatchSurvey, batch_flow_of

__all__ = ["BatchFlow", "BatchOptions", "BatchRun", "BatchSurvey", "batch_flow_of"]
