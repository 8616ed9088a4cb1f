"""Operations that need packages of an extra: without these packages they are refused."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any, ClassVar

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.operations import Operation


class ServiceOperation(Operation):
    """An operation that needs packages of the extra `service`.

    Attributes
    ----------
    needs : tuple of str
        Modules of these packages; by default those of the client.
    """

    needs: ClassVar[tuple[str, ...]] = ("httpx",)

    def carry_out(self, **how: Any) -> None:
        """Call the function that the operation names; first raise UsageError if a package is missing."""
        missing = [module for module in self.needs if find_spec(module) is None]
        if missing:
            raise UsageError(
                f"expected the packages of the service, got none of {', '.join(missing)}. "
                "Install them: pip install 'vibroimpact[service]'."
            )
        super().carry_out(**how)
