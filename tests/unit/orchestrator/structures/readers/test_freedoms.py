"""Tables of degrees of freedom: by names or by nodes and directions, with or without coordinates."""

from __future__ import annotations

import numpy as np
import pytest

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers.freedoms import read_table


@pytest.mark.parametrize(
    "text",
    [
        "name,x,y,z\n12.z,1,2,3\ntip,4,5,6\n",
        "# made by hand\nName;note;X;Y;Z\r\n12.z;;1;2;3\r\n\r\ntip;;4;5;6",
        "x\ty\tz\tfreedom\n1\t2\t3\t12.z\n4\t5\t6\ttip\n",
        "dof  x y   z\n  12.z 1 2 3\ntip 4e0 5 6\n",
        '\ufeff"name","x","y","z"\n"12.z","1","2","3"\n"tip","4","5","6"\n',
    ],
)
def test_a_table_of_names_is_read(text: str) -> None:
    found = read_table(text.encode())
    assert found.freedoms == ("12.z", "tip")
    assert found.coordinates is not None
    assert found.coordinates.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]


@pytest.mark.parametrize(
    ("direction", "letter"),
    [("z", "z"), ("3", "z"), ("T3", "z"), ("UZ", "z"), ("4", "rx"), ("RX", "rx"), ("r1", "rx"), ("6", "rz")],
)
def test_a_node_and_its_direction_make_a_name(direction: str, letter: str) -> None:
    found = read_table(f"node,direction\n12,{direction}\n".encode())
    assert found.freedoms == (f"12.{letter}",)
    assert found.coordinates is None


def test_a_missing_axis_is_0_and_an_empty_cell_is_unknown() -> None:
    found = read_table(b"name,x\na,1\nb,\n")
    assert found.coordinates is not None
    np.testing.assert_array_equal(found.coordinates, [[1.0, 0.0, 0.0], [np.nan, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1: expected a line of the columns' names with name, or node and direction, got ''"),
        ("node,x\n1,2\n", "line 1: expected a line of the columns' names"),
        ("1,2,3\n4,5,6\n", "line 1: expected a line of the columns' names"),
        ("name\n", "expected a row for each degree of freedom, got none"),
        ("name,x\na,1\nb\n", "line 3: expected 2 columns, got 1"),
        ("name,x\na,1\n\nb,far\n", "line 4: expected a coordinate, got 'far'"),
        ("name,x\na,inf\n", "line 2: expected a coordinate, got 'inf'"),
        ("name\na b\n", "line 2: expected 1 columns, got 2"),
        ("name;x\na b;1\n", "line 2: expected a name of at most 40 letters"),
        (f"name\n{'a' * 41}\n", "line 2: expected a name of at most 40 letters"),
        ("name\n\u202ea\n", "line 2: expected a name of at most 40 letters"),
        ("node,direction\n1,w\n", "line 2: expected a direction (x, y, z, rx, ry, rz), got 'w'"),
        ('name,x\n"a\n', "line 2: expected 2 columns, got 1"),
        (f'name,x\n"{"a" * 200_000}', "line 2: expected cells of a table, got"),
    ],
)
def test_a_wrong_table_is_refused_with_the_line(text: str, said: str) -> None:
    with pytest.raises(UsageError) as refused:
        read_table(text.encode())
    assert said in str(refused.value)
    assert len(str(refused.value)) < 200
    assert "\n" not in str(refused.value)
