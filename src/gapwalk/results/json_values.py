"""Records as plain JSON values, for other programs; what gapwalk reads back is written by its codec."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from gapwalk.model.laws import Law
from gapwalk.model.laws.law import data_of
from gapwalk.model.loads import Load
from gapwalk.model.system import System
from gapwalk.results.codec import parameters_of


def plain(value: Any) -> Any:
    """Return a record, or anything in one, as plain JSON values.

    Records become tables, named by the `kind` or `name` of their class if it has one. Complex numbers become pairs, and
    what is not finite becomes null. Force laws and loads are written by name; systems within records are left out.
    """
    match value:
        case System():
            return _plain_system(value)
        case Law():
            return {"name": value.name, **data_of(value)} if is_dataclass(value) else value.name
        case type() if issubclass(value, Load):
            return value.key
        case Enum():
            return value.value
        case np.ndarray() if np.iscomplexobj(value):
            return plain(np.stack((value.real, value.imag), axis=-1))
        case np.ndarray():
            return plain(value.tolist())
        case Mapping():
            return {str(plain(key)): plain(item) for key, item in value.items()}
        case list() | tuple():
            return [plain(item) for item in value]
        case np.generic():
            return plain(value.item())
        case complex():
            return [value.real, value.imag] if cmath.isfinite(value) else None
        case float():
            return value if math.isfinite(value) else None
        case _ if is_dataclass(value):
            return _plain_record(value)
    return value


def _plain_record(record: Any) -> dict[str, Any]:
    labels = {label: getattr(type(record), label, None) for label in ("kind", "name")}
    document = {label: text for label, text in labels.items() if isinstance(text, str)}
    for field in fields(record):
        value = getattr(record, field.name)
        if field.metadata.get("stored", True) and not isinstance(value, System):
            document[field.name] = plain(value)
    return document


def _plain_system(system: System) -> dict[str, Any]:
    """Return the parts of a system, and its parameters by name."""
    structure = system.structure
    parts = {name: plain(getattr(structure, name)) for name in ("coordinates", "contacts", "harmonics")}
    train = {} if structure.assembly is None else {"train": plain(structure.assembly)}
    return parts | train | {"parameters": parameters_of(system)}
