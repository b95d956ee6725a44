import tracemalloc

import pytest

from gapwalk.model.model_source import MAX_ENTRIES, MAX_NESTS, MAX_PARTS, parse_source
from gapwalk.model.problems import ModelFileError
from gapwalk.studies.study_file import check_studies
from tests.work import counted_calls

LONG = ".".join(["a"] * 50_000)
BASE = 'coordinates = ["x"]\nstiffness = [1.0]\nfrequency = 1.0\n'
STUDY = '[study]\nkind = "response"\nparameter = "frequency"\nto = 2.0\n'


def refusal(text: str) -> str:
    """What a text is refused with, with little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(ModelFileError) as error:
            check_studies(parse_source(text, "m.toml"))
        assert tracemalloc.get_traced_memory()[1] < 200e6
    finally:
        tracemalloc.stop()
    return str(error.value)


@pytest.mark.parametrize(
    "text",
    [
        f"{LONG} = 1",
        f"[{LONG}]\nx = 1",
        f"[[{LONG}]]",
        f"x = {{ {LONG} = 1 }}",
        f"x = 1 # {LONG}\n{LONG} = 1",
        f'"a"{LONG[1:]} = 1',
        LONG.replace("a.", "'a' . ") + " = 1",
    ],
)
def test_a_key_of_very_many_parts_is_not_parsed(text) -> None:
    assert "a key has 50,000 parts; it may have 20" in refusal(text)


@pytest.mark.parametrize("table", ["[t{}.a.b]\n", "t{}.a.b = 1\n", "t{} = [ [ {{ }} ] ]\n", "[[t{}.x.y]]\n"])
def test_very_many_tables_are_not_parsed(table) -> None:
    text = "".join(table.format(number) for number in range(MAX_NESTS // 2 + 1))
    assert f"more than {MAX_NESTS:,} tables and lists" in refusal(text)


def test_texts_and_comments_count_for_nothing() -> None:
    shown = f'# {LONG} = [[[\ntitle = "{LONG}] = [{{"\nx = """\n{LONG} =\n{"[" * 200_000}"""\n'
    source = parse_source(shown + ".".join(["k"] * MAX_PARTS) + " = 1\n")
    assert source.data["title"].startswith("a.a.")


def test_a_list_or_a_table_is_not_longer_than_any_that_makes_sense() -> None:
    for text in ("mass = [" + "1," * 20_001 + "]", "mass = [[" + '"",' * 20_001 + "]]"):
        assert f"has 20,001 entries; a table or a list may have {MAX_ENTRIES:,}" in refusal(BASE + text)
    assert "the file has 20,002 entries" in refusal("".join(f"k{i} = 1\n" for i in range(20_002)))


def test_of_a_matrix_of_nonsense_one_row_is_told() -> None:
    row = "[" + ", ".join(['""'] * 500) + "]"
    told = refusal(BASE + f"mass = [{', '.join([row] * 8)}]\n" + STUDY)
    assert 'mass[0][0] is ""; it must be a number' in told
    assert "mass[1]" not in told


def test_very_many_unknown_keys_are_told_with_work_that_grows_as_they_do() -> None:
    def work(keys: int) -> int:
        with counted_calls() as calls:
            assert "k1 is not a key here" in refusal(BASE + STUDY + "".join(f"k{i} = 1\n" for i in range(keys)))
        return calls()

    work(2)  # what is done once
    assert work(160) < 2.2 * work(80)


def test_very_many_studies_are_not_looked_at() -> None:
    studies = "".join(f'[{STUDY.replace("[study]", "[study]]")}name = "s{i}"\n' for i in range(1_000))
    assert "study is a list of 1,000 tables; a file may have 200 studies" in refusal(BASE + studies)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("period = 1000000000", "study.period is 1000000000; it must be <= 10000"),
        ("shooting = { segments = 1000000000 }", "segments is 1000000000; it must be <= 1000"),
    ],
)
def test_counts_are_bounded(line, words) -> None:
    assert words in refusal(f"{BASE}{STUDY}{line}\n")


@pytest.mark.parametrize("kind", ["basins", "regimes"])
def test_a_map_of_very_many_cells_is_refused(kind) -> None:
    plane = {
        "basins": 'plane = { x = [-1, 1], "x\'" = [-1, 1] }',
        "regimes": 'parameter = "frequency"\nto = 2.0\nsecond = { parameter = "mean.x", from = 0.1, to = 0.5 }',
    }
    told = refusal(f'{BASE}[study]\nkind = "{kind}"\n{plane[kind]}\nresolution = 1000000\n')
    assert "resolution is 1,000,000 x 1,000,000 cells; there may be 10,000,000, as 4000 x 2500" in told


def test_a_sweep_of_very_many_states_is_refused() -> None:
    sweep = '[study]\nkind = "sweep"\nparameter = "frequency"\nto = 2.0\nsteps = 1000000000\n'
    assert "steps is 1,000,000,000, with 100 points from 1 starts" in refusal(BASE + sweep)


def test_a_search_at_very_many_values_is_refused() -> None:
    diagram = '[study]\nkind = "diagram"\nparameter = "frequency"\nto = 2.0\nsearch = { values = 1000000000 }\n'
    assert "values is 1000000000; it must be <= 100000" in refusal(BASE + diagram)
