"""Keys of scenes keep their types, units, defaults, limits and words: `keys.txt` has them."""

from __future__ import annotations

from support.public_names import SCENE_KEYS
from support.scene_keys import scene_keys


def test_keys_are_those_of_the_list() -> None:
    assert scene_keys() == SCENE_KEYS.read_text(
        encoding="utf-8"
    ), "run python -P tests/support/public_names.py"
