"""``gapwalk export --format wav``: the sound of a run-up or a settled motion."""

from __future__ import annotations

from pathlib import Path

from gapwalk.answers.run_up import RunUp
from gapwalk.attractors.settle import Settled
from gapwalk.attractors.spectrum import sound
from gapwalk.cli.output import DONE, show, show_files
from gapwalk.errors import ModelError
from gapwalk.studies.export import write_whole
from gapwalk.studies.result import Result


def save_sound(result: Result, output: Path, signal: str | None, full_scale: float | None) -> int:
    """Write a WAV file, and print its level."""
    record = None if result.finding is None else result.finding.record
    if isinstance(record, RunUp):
        heard = record.sound(signal or "")
    elif isinstance(record, Settled):
        asked = str(getattr(result.options, "signal", "") or record.system.coordinates[0]).rstrip("'")
        own = asked if asked in record.system.coordinates else record.system.coordinates[0]
        heard = sound(record, signal or f"{own}''")
    else:
        raise ModelError(
            f"a sound is that of one motion: of a run-up or a settled motion, not of a {result.options.kind}. Write a "
            'study of kind = "run-up" or "settle", or choose a point in `gapwalk explore` and press Listen'
        )
    scale = heard.full_scale if full_scale is None else full_scale
    write_whole(output, heard.wav(scale))
    unit = f" {heard.unit}" if heard.unit else ""
    show_files([output])
    show(
        [
            f"  {heard.signal}, {heard.duration:.4g} s at {heard.rate} Hz: peak {heard.peak:.4g}{unit}, root mean "
            f"square {heard.level:.4g}{unit}",
            f"  full scale is {scale:g}{unit}: give --full-scale {scale:g} to what it is compared with",
        ]
    )
    return DONE
