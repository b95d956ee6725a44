"""The manual page of the commands, in the language of man, from the same declarations as their help."""

from __future__ import annotations

from inspect import cleandoc

from cyclopts import App


def man_page(app: App, version: str, ending: str) -> str:
    """Return the source of the manual page of an app: its commands, each with its options, and the last lines."""
    names = sorted((name for name in app if not name.startswith("-")), key=lambda name: app[name].sort_key or 0.0)
    lines = [f'.TH {app.name[0].upper()} 1 "" "{app.name[0]} {version}"', ".SH NAME"]
    lines += [f"{app.name[0]} \\- {_plain(app.help)}", ".SH COMMANDS"]
    for name in names:
        sub = app[name]
        title, *more = cleandoc(sub.help or "").split("\n\nParameters\n")[0].split("\n\n")
        lines += [f".SS {app.name[0]} {name}", _plain(title), *(f".PP\n{_plain(part)}" for part in more)]
        for each in sub.assemble_argument_collection(parse_docstring=True):
            if each.show:
                choices = f" ({', '.join(each.get_choices() or ())})" if each.get_choices() else ""
                lines += [".TP", f".B {_plain(', '.join(each.names) or each.field_info.name)}"]
                lines.append(f"{_plain(each.parameter.help)}{_plain(choices)}")
        examples = (sub.help_epilogue or "").partition("\n\nExit codes")[0].splitlines()
        lines += [".PP", ".nf", *map(_verbatim, examples), ".fi"]
    return "\n".join([*lines, ".SH EXIT STATUS", _plain(ending)])


def _verbatim(text: str) -> str:
    escaped = text.replace("\\", "\\e").replace("-", "\\-")
    return f"\\&{escaped}" if escaped[:1] in (".", "'") else escaped


def _plain(text: str | None) -> str:
    return _verbatim(" ".join((text or "").split()))
