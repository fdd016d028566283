"""What reads TOML stays within bounds of memory."""

import tracemalloc

import pytest

from clothsim import _toml

LIMIT = _toml._MOST_PARTS
# Bytes that reading a refused text of 160 kB may take: some copies of it. The reader alone takes 7 GB.
BOUND = 4 * 2**20


@pytest.mark.parametrize("part", ["a", '"a"', "'a'", '"a,b = [\\"x\\"]"', "a\t"])
@pytest.mark.parametrize("frame", ["{} = 1", "[{}]", "x = {{ {} = 1 }}", "[[{}]]"])
def test_a_key_of_too_many_parts_is_refused_before_it_costs_memory(frame: str, part: str) -> None:
    text = "y = 1\n" + frame.format(".".join([part] * 40_000))
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=rf"at most {LIMIT} parts \(at line 2\)"):
            _toml.loads(text)
        assert tracemalloc.get_traced_memory()[1] < len(text) + BOUND
    finally:
        tracemalloc.stop()


def test_the_bound_is_of_parts() -> None:
    key = ".".join("a" * LIMIT)
    assert _toml._parts(f"{key} = 1") == LIMIT
    assert _toml._parts(f"a.{key} = 1") == LIMIT + 1


@pytest.mark.parametrize(
    "text",
    [
        "v = [" + ", ".join(["0.25"] * 5000) + "]",
        'v = """\n' + "It falls. It drapes. " * 3000 + '\n"""',
        'v = "' + "." * 5000 + '"',
        "v = [" + ", ".join(["{ a.b = 1.5 }"] * 2000) + "]",
    ],
    ids=["numbers", "prose", "dots", "tables"],
)
def test_many_dots_that_are_no_key_are_read(text: str) -> None:
    assert list(_toml.loads(text)) == ["v"]
