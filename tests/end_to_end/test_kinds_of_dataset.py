"""Files of each kind have the variables and attributes that users' programs rely on, as listed in `datasets.txt`."""

from __future__ import annotations

import pytest
from support.dataset_kinds import KINDS, SLOW, KindsOfDataset, kept
from support.public_names import DATASETS


@pytest.fixture(scope="module")
def kinds(tmp_path_factory: pytest.TempPathFactory) -> KindsOfDataset:
    return KindsOfDataset(tmp_path_factory.mktemp("kinds"))


@pytest.fixture(scope="module")
def texts() -> dict[str, str]:
    return kept(DATASETS.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=pytest.mark.long if kind in SLOW else ()) for kind in KINDS]
)
def test_a_kind_of_file_has_the_variables_and_attributes_of_the_list(
    kind: str, kinds: KindsOfDataset, texts: dict[str, str]
) -> None:
    assert kinds.described(kind) == texts[kind], "run python -P tests/support/public_names.py"


def test_the_list_has_every_kind(texts: dict[str, str]) -> None:
    assert list(texts) == list(KINDS)
