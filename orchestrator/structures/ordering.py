"""Order of elimination in which the factors of a sparse symmetric matrix have few entries, and their number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.structures.matrices import Sparse

Order = NDArray[np.int64]


def elimination_order(matrix: Sparse, names: Sequence[str]) -> tuple[Order, int]:
    """Return an order of the degrees of freedom, and the number of entries that both factors have in this order.

    The order is that of minimum degree, or of Cuthill and McKee (long bodies), whichever leaves fewer entries.

    Parameters
    ----------
    matrix : sparse array, shape (freedom, freedom)
        Symmetric.
    names : sequence of str
        Names of the degrees of freedom; those of one node, such as `"12.x"` and `"12.z"`, are eliminated together.
    """
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    node, members = _nodes(names)
    pattern = _filled((members.T @ _ones(matrix) @ members).tocsc())
    weight = np.bincount(node)
    narrow = reverse_cuthill_mckee(pattern.tocsr(), symmetric_mode=True)
    envelope = _envelope(_in_order(pattern, narrow), weight[narrow])
    fewest = _minimum_degree(_filled((members @ pattern @ members.T).tocsc()), node)
    entries = entries_of_factors(_in_order(pattern, fewest), weight[fewest], envelope)
    best = narrow if entries > envelope else fewest
    place = np.empty(len(best), dtype=np.int64)
    place[best] = np.arange(len(best))
    return np.argsort(place[node], kind="stable"), min(entries, envelope)


def _in_order(pattern: Sparse, order: Order) -> Sparse:
    found = pattern[order][:, order].tocsc()
    found.sort_indices()
    return found


def _envelope(pattern: Sparse, weight: Order) -> int:
    """Return the number of entries of both factors where each row is full from its first entry on."""
    before = np.concatenate([[0], np.cumsum(weight)])
    first = before[pattern.indices[pattern.indptr[:-1]]]
    return int((weight * (2 * (before[:-1] - first) + weight)).sum())


def _nodes(names: Sequence[str]) -> tuple[Order, Sparse]:
    """Return the number of the node of each degree of freedom, and the matrix of these memberships."""
    from scipy.sparse import csc_array

    owners = [name.rpartition(".")[0] or name for name in names]
    _, node = np.unique(owners, return_inverse=True)
    count = len(names)
    return node, csc_array((np.ones(count), (np.arange(count), node)), (count, int(node.max()) + 1))


def _ones(matrix: Sparse) -> Sparse:
    from scipy.sparse import csc_array

    return csc_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), matrix.shape)


def _filled(pattern: Sparse) -> Sparse:
    """Return a pattern with its diagonal, which dominates, and sorted rows."""
    from scipy.sparse import diags_array

    found = _ones(pattern)
    found = (found + diags_array(1.0 + np.asarray(found.sum(axis=0)).ravel(), format="csc")).tocsc()
    found.sort_indices()
    return found


def _minimum_degree(pattern: Sparse, node: Order) -> Order:
    """Return the nodes in the order of multiple minimum degree of their degrees of freedom."""
    from scipy.sparse.linalg import spilu

    place = spilu(  # an incomplete factor without entries: only the order is used
        pattern,
        drop_tol=0.9,
        fill_factor=1.0,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    ).perm_c
    first = np.full(int(node.max()) + 1, len(place))
    np.minimum.at(first, node, place)
    return np.argsort(first)


def entries_of_factors(pattern: Sparse, weight: Order, most: int) -> int:
    """Return the number of entries of both factors of a pattern whose nodes have weights; it stops above a number.

    Node i is eliminated before node i + 1. Each of its later neighbours becomes a neighbour of all others.

    Examples
    --------
    >>> from scipy.sparse import csc_array
    >>> entries_of_factors(csc_array(np.ones((3, 3))), np.array([1, 1, 1]), 100)
    9
    """
    waiting: list[list[Order]] = [[] for _ in weight]
    found = 0
    for node, own in enumerate(weight.tolist()):
        column = pattern.indices[pattern.indptr[node] : pattern.indptr[node + 1]]
        later = column[np.searchsorted(column, node, side="right") :]
        if waiting[node]:
            later = np.sort(np.concatenate([later, *waiting[node]]))
            later = later[np.append(True, later[1:] != later[:-1])[: len(later)]]
            waiting[node] = []
        found += own * own + 2 * own * int(weight[later].sum())
        if found > most:
            break
        if len(later):
            waiting[int(later[0])].append(later[1:])
    return found
