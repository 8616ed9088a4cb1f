"""Write the table of `vibroimpact hard-cases` into the page: `python docs/site/case_table.py docs/hard_cases.md`."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from vibroimpact.orchestrator.hard_cases import CASES

_TABLE = re.compile(r"(<!-- cases -->\n).*?(<!-- end of cases -->)", re.DOTALL)


def with_case_table(page: str) -> str:
    """Return the page with the table of all cases."""
    rows = ["| case | what is hard | claim | against | figure | bound |", "|---|---|---|---|---|---|"]
    for case in CASES:
        bound = f"{case.bound:.2g}"
        words = [f"`{case.name}`", case.title, case.claim, case.reference, case.of, bound]
        rows.append(f"| {' | '.join(words)} |")
    table = "\n".join(rows)
    return _TABLE.sub(lambda match: f"{match[1]}{table}\n{match[2]}", page)


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(with_case_table(path.read_text(encoding="utf-8")), encoding="utf-8")
