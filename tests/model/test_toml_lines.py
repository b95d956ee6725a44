"""Lines of keys in TOML texts: a text with every trap, and texts written by a writer that knows where it writes."""

import json
import tomllib

from hypothesis import given, settings
from hypothesis import strategies as st

from gapwalk.model.model_source import key_lines
from tests.tiers import examples

TEXT = '''\
# comment = 1
title = "a # [no] comment = 2"
bare.dotted."quoted key" = 1979-05-27 07:32:00  # a date with a space
empty = []
text = """
fake = 1
[fake]
\\""" still inside""""
raw = \'\'\'
fake = 2\'\'\'\'
point = { x = 1, "y=" = { z = [1, 2] } }

list = [
  1, # one ] , "
  [2, 3],

  { a = 1 },
  "]",
]
[table]
key = 1
[table.inner]
key = 2
[[item]]
key = 3
[[item.part]]
key = 4
[[item.part]]
key = 5
[item.table]
key = 6
[[item]]
[[item.part]]
"key\\u0041" = 7
'''


def test_every_key_has_its_line() -> None:
    tomllib.loads(TEXT)
    assert key_lines(TEXT) == {
        ("title",): 2,
        ("bare",): 3, ("bare", "dotted"): 3, ("bare", "dotted", "quoted key"): 3,
        ("empty",): 4,
        ("text",): 5,
        ("raw",): 9,
        ("point",): 11, ("point", "x"): 11, ("point", "y="): 11, ("point", "y=", "z"): 11,
        ("point", "y=", "z", 0): 11, ("point", "y=", "z", 1): 11,
        ("list",): 13, ("list", 0): 14, ("list", 1): 15, ("list", 1, 0): 15, ("list", 1, 1): 15,
        ("list", 2): 17, ("list", 2, "a"): 17, ("list", 3): 18,
        ("table",): 20, ("table", "key"): 21, ("table", "inner"): 22, ("table", "inner", "key"): 23,
        ("item",): 24, ("item", 0): 24, ("item", 0, "key"): 25,
        ("item", 0, "part"): 26, ("item", 0, "part", 0): 26, ("item", 0, "part", 0, "key"): 27,
        ("item", 0, "part", 1): 28, ("item", 0, "part", 1, "key"): 29,
        ("item", 0, "table"): 30, ("item", 0, "table", "key"): 31,
        ("item", 1): 32, ("item", 1, "part"): 33, ("item", 1, "part", 0): 33,
        ("item", 1, "part", 0, "keyA"): 34,
    }  # fmt: skip


def test_windows_line_ends_count_once() -> None:
    assert key_lines("a = 1\r\n\r\n[b]\r\nc = 2\r\n") == {("a",): 1, ("b",): 3, ("b", "c"): 4}


def test_a_broken_text_gives_what_was_found() -> None:
    assert key_lines("a = 1\nb = [1,") == {("a",): 1, ("b",): 2, ("b", 0): 2}
    assert key_lines("a = " + "[" * 100_000)[("a",)] == 1
    assert key_lines("") == {}


class Writer:
    """Writes a document in styles that it is told, and notes the line of each path."""

    def __init__(self, choose) -> None:
        self.choose = choose
        self.text = ""
        self.lines: dict[tuple, int] = {}

    def document(self, data: dict) -> None:
        for key, value in data.items():
            self.blank()
            self.pair((), key, value)
            self.text += self.choose(["\n", "  # [x] = 'y'\n"])

    def pair(self, table: tuple, key: str, value: object) -> None:
        path = (*table, key)
        self.note(path)
        bare = key.isascii() and key.replace("_", "").replace("-", "").isalnum()
        self.text += key if bare and self.choose([True, False]) else json.dumps(key, ensure_ascii=True)
        self.text += self.choose(["=", " = "])
        self.value(path, value)

    def value(self, path: tuple, value: object) -> None:
        if isinstance(value, dict):
            self.text += "{ "
            for place, (key, inner) in enumerate(value.items()):
                self.text += ", " if place else ""
                self.pair(path, key, inner)
            self.text += " }"
        elif isinstance(value, list):
            self.text += "["
            for index, inner in enumerate(value):
                self.blank()
                self.note((*path, index))
                self.value((*path, index), inner)
                self.blank()
                self.text += "," if index + 1 < len(value) else self.choose(["", ","])
            self.blank()
            self.text += "]"
        elif isinstance(value, str):
            quote = self.choose(['"', '"""\n'])
            self.text += quote + json.dumps(value, ensure_ascii=True)[1:-1] + quote.strip()
        else:
            self.text += json.dumps(value)

    def blank(self) -> None:
        self.text += self.choose(["", "\n", " ", "# ] , \" '\n", "\n\n"])

    def note(self, path: tuple) -> None:
        self.lines[path] = self.text.count("\n") + 1


# No surrogates, which TOML cannot write, and no characters beyond the first plane, which JSON escapes as such.
TEXTS = st.text(st.characters(max_codepoint=0xD7FF, exclude_characters="\x7f"), max_size=8)
VALUES = st.recursive(
    st.integers(-9, 99) | st.booleans() | st.floats(0.1, 9.0) | TEXTS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=3),
    max_leaves=12,
)


@settings(deadline=None, max_examples=examples(30))
@given(st.dictionaries(TEXTS, VALUES, max_size=5), st.data())
def test_lines_of_any_document(data: dict, draw) -> None:
    writer = Writer(lambda choices: draw.draw(st.sampled_from(choices)))
    writer.document(data)
    assert tomllib.loads(writer.text) == data
    assert key_lines(writer.text) == writer.lines
