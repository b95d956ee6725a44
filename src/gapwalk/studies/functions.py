"""The Python functions of studies, made from their declarations when they are first used.

`functions.pyi` holds their signatures for editors and type checkers; ``python -m tests.release.stubs`` writes it.
"""

from __future__ import annotations

import inspect
import re
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, fields, replace
from enum import Enum
from functools import reduce
from operator import or_
from textwrap import fill
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np

from gapwalk.errors import ModelError
from gapwalk.field_docs import field_words
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import check_system
from gapwalk.notebook import shows_progress
from gapwalk.studies.options import ParameterRange
from gapwalk.studies.runner import call
from gapwalk.studies.study_kind import INLINE, OPEN, StudyKind, kind_of
from gapwalk.studies.study_schema import default_of, marks_of

FUNCTIONS = {
    "bifurcation_map": "map",
    "campbell": "campbell",
    "diagram": "diagram",
    "basins": "basins",
    "regimes": "regimes",
    "design": "design",
    "family": "family",
    "rattle_bands": "rattle",
    "rattle_chance": "rattle-chance",
    "scan": "scan",
    "shares": "shares",
    "sweep": "sweep",
    "threshold": "threshold",
    "tolerance": "tolerance",
}
"""Names of the functions, and the kinds of study that they ask."""

SHARED = {
    "workers": ("Workers | int | None", "Processes, by default one for each core, or running workers."),
    "report": ("Report | None", "Called with each part that is stored."),
    "output": (
        "str | os.PathLike[str] | None",
        "Result file for `gapwalk.open_result`; a partial result in it is continued.",
    ),
}
"""Types and descriptions of the keywords that all functions have."""
_TO = "Range of the parameter, from the first value to the second."
_STOPPED = "Interrupted\n    After Ctrl-C; its `found` is the record so far."
_SECTION = re.compile(r"\n\n(?=\w[\w ]*\n-{3,}\n)")


class Keyword(NamedTuple):
    """A keyword of a function: a field of a study, or of options whose fields are keys of its table."""

    name: str
    type: Any
    default: Any
    words: str
    inside: str = ""  #: Field of the study that holds the options.


def __getattr__(name: str) -> Any:
    """Return the function of a study."""
    if name not in FUNCTIONS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name)
    globals()[name] = made = function_of(kind_of(FUNCTIONS[name]), name)
    return made


def record_of(kind: type[StudyKind]) -> type:
    """Return the type of what the function of a study returns."""
    if kind.answer is None:
        what = 'answer: ClassVar[Part | None] = Part("peaks", Peaks)'
        raise ModelError(f"{kind.__name__} does not say what its function returns; write, for example, {what}")
    return kind.answer.type


def keywords_of(kind: type[StudyKind]) -> Iterator[Keyword]:
    """Yield the keywords of the function of a study: its positional arguments first."""
    hints, words = get_type_hints(kind, include_extras=True), field_words(kind)
    named = {field.name: field for field in fields(kind) if field.init}
    for name in kind.arguments:
        if name == "to":
            yield Keyword("to", tuple[float, float], MISSING, _TO)
        elif name in kind.call_types:
            yield Keyword(name, *kind.call_types[name])
        else:
            yield Keyword(name, _bare(hints[name]), _default(named[name], hints[name]), words.get(name, ""))
    left_out = {*kind.arguments, *kind.not_asked}
    for name, field in named.items():
        hint = hints[name]
        if name in left_out or ("to" in left_out and name in ("begin", "end")):
            continue
        if name in kind.call_types:
            yield Keyword(name, *kind.call_types[name])
            continue
        if INLINE not in marks_of(hint):
            yield Keyword(name, _bare(hint), _default(field, hint), words.get(name, ""))
            continue
        inner, options = _bare(hint), _default(field, hint)
        inner_hints, inner_words = get_type_hints(inner, include_extras=True), field_words(inner)
        for each in fields(inner):
            value = getattr(options, each.name)
            yield Keyword(each.name, _bare(inner_hints[each.name]), value, inner_words.get(each.name, ""), name)


def function_of(kind: type[StudyKind], name: str) -> Callable[..., Any]:
    """Return the Python function of a kind of study: its keywords and its docstring are those of the fields.

    Parameters
    ----------
    kind
        The class of the study. The type of its `answer` is what the function returns.
    name
        Name of the function.

    Returns
    -------
    callable
        The function: a system, the `arguments` of the study, its other fields by keyword, and ``workers``, ``report``
        and ``output``.

    Raises
    ------
    ModelError
        If the kind has no `answer`.

    Examples
    --------
    >>> from gapwalk.studies.sweep_study import SweepStudy
    >>> sweep = gw.studies.function_of(SweepStudy, "sweep")
    >>> sweep(system, "frequency", (0.6, 1.0), steps=9, points=13).regimes[0, 0]
    np.str_('period 1')
    """
    keywords = {each.name: each for each in keywords_of(kind)}
    P = inspect.Parameter
    found = [P("system", P.POSITIONAL_OR_KEYWORD, annotation="System")]
    for each in (each for each in keywords.values() if each.name not in SHARED):
        place = P.POSITIONAL_OR_KEYWORD if each.name in kind.arguments else P.KEYWORD_ONLY
        default = P.empty if each.default is MISSING else each.default
        found.append(P(each.name, place, default=default, annotation=_allowed(each.type)))
    found += [P(each, P.KEYWORD_ONLY, default=None, annotation=hint) for each, (hint, _) in SHARED.items()]
    record = record_of(kind)
    signature = inspect.Signature(found, return_annotation=record.__name__)

    def ask(*arguments: Any, **given: Any) -> Any:
        if unknown := [each for each in given if each not in signature.parameters]:
            raise TypeError(
                f"{name}() has no keyword {unknown[0]!r}; {did_you_mean(unknown[0], list(signature.parameters))}"
            )
        try:
            values = signature.bind(*arguments, **given).arguments
        except TypeError as error:
            raise TypeError(f"{name}(): {error}") from None
        system, shared = values.pop("system"), {each: values.pop(each, None) for each in SHARED}
        check_system(system, name)
        asked = kind.of_call(_fields(kind, keywords, values), system)
        first = asked.system_of_call(system)
        return call(asked, asked.work(first), first, **shared).record

    ask.__name__ = ask.__qualname__ = name
    ask.__module__ = kind.__module__
    ask.__doc__ = _docstring(kind, keywords, record)
    ask.__annotations__ = {each.name: each.annotation for each in found} | {"return": record.__name__}
    made = shows_progress(kind.progress_words)(ask)
    made.__signature__ = signature  # type: ignore[attr-defined]
    return made


def _fields(kind: type[StudyKind], keywords: Mapping[str, Keyword], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a call by fields of the study; options are made of those of their fields."""
    found: dict[str, Any] = {}
    options: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        keyword = keywords[name]
        if value is None and keyword.default is not MISSING:
            continue  # as if it were not given
        if name == "to":
            found["begin"], found["end"] = _range(values.get("parameter", "the parameter"), value)
        elif keyword.inside:
            options.setdefault(keyword.inside, {})[name] = _converted(name, value, keyword.type)
        else:
            found[name] = _converted(name, value, keyword.type)
    defaults = {field.name: field for field in fields(kind)}
    return found | {name: replace(_default(defaults[name], None), **given) for name, given in options.items()}


def _range(parameter: str, value: Any) -> tuple[float, float]:
    try:
        begin, end = map(float, value)
    except (TypeError, ValueError):
        raise ModelError(f"the range of {parameter} is {value!r}; write two numbers, as in (1.1, 1.6)") from None
    if begin == end:
        raise ModelError(f"the range of {parameter} is from {begin:g} to {end:g}: it is empty; write another end")
    return begin, end


def _converted(name: str, value: Any, hint: Any) -> Any:
    """Return a value as its field has it: lists as tuples, one text as a list of one, words of an enumeration."""
    members = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    if isinstance(value, np.ndarray):
        value = value.tolist()
    lists = [each for each in members if get_origin(each) is tuple]
    if isinstance(value, str) and lists == [*members] and get_args(lists[0])[:1] == (str,):
        return (value,)
    if isinstance(value, Sequence) and not isinstance(value, str) and lists:
        return tuple(value)
    words = next((each for each in members if isinstance(each, type) and issubclass(each, Enum)), None)
    if words is not None and isinstance(value, str):
        try:
            return words(value)
        except ValueError:
            raise ModelError(f"{name} is {value!r}; {did_you_mean(value, [each.value for each in words])}") from None
    if ParameterRange in members and isinstance(value, Mapping):
        if len(value) != 1:
            raise ModelError(
                f'{name} is {value!r}; write one parameter with its range, as in {{"frequency": (0.9, 1.1)}}'
            )
        ((parameter, ends),) = value.items()
        return ParameterRange(parameter, *_range(parameter, ends))
    return value


def _allowed(hint: Any) -> Any:
    """Return the type of what a call may give for a field: `_converted` makes the field of it."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return reduce(or_, map(_allowed, arguments))
    if origin is tuple and arguments[1:] == (...,):
        many = Sequence[_allowed(arguments[0])]
        return str | many if arguments[0] is str else many
    if hint is ParameterRange:
        return Mapping[str, tuple[float, float]]
    return str if isinstance(hint, type) and issubclass(hint, Enum) else hint


def _docstring(kind: type[StudyKind], keywords: Mapping[str, Keyword], record: type) -> str:
    """Return the docstring of a function: that of its study, with its keywords and what it returns."""
    head, *sections = _SECTION.split(inspect.cleandoc(kind.__doc__ or ""))
    head = f"Compute {head[0].lower()}{head[1:]}"  # a study is named by a noun
    by_name = {text.partition("\n")[0]: text.partition("\n")[2].partition("\n")[2] for text in sections}
    words = {"system": "The system.", **{each.name: each.words for each in keywords.values()}}
    words |= {name: text for name, (_, text) in SHARED.items()}
    parameters = "\n".join(f"{name}\n{_indented(text)}" for name, text in words.items())
    returned = f"{record.__name__}\n    {inspect.cleandoc(record.__doc__ or '').partition(chr(10) * 2)[0]}"
    raised = "\n".join(filter(None, (by_name.pop("Raises", ""), _STOPPED)))
    by_name = {"Parameters": parameters, "Returns": returned, "Raises": raised, **by_name}
    return "\n\n".join([head, *(f"{title}\n{'-' * len(title)}\n{text}" for title, text in by_name.items())]) + "\n"


def _indented(text: str) -> str:
    return fill(text, 120, initial_indent="    ", subsequent_indent="    ")


def _default(field: Field[Any], hint: Any) -> Any:
    default = default_of(field)
    return None if default is MISSING and OPEN in marks_of(hint) else default


def _bare(hint: Any) -> Any:
    """Return a type without what annotates it."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _bare(arguments[0])
    if origin in (Union, types.UnionType):
        return reduce(or_, map(_bare, arguments))
    if arguments and not isinstance(arguments[0], list) and origin is not None:
        return origin[tuple(each if each is ... else _bare(each) for each in arguments)]
    return hint
