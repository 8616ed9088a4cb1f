"""The check of a store's metadata before zarr sees them: names, sizes, types and codecs."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,199}(/[A-Za-z][A-Za-z0-9_]{0,199})?")
MOST_METADATA_BYTES = 1 << 26
MOST_ARRAYS = 4096
MOST_VALUES = 1 << 40
"""Largest announced number of values of an array."""
MOST_CHUNK_BYTES = 1 << 28
"""Largest size of a chunk in memory, bytes: a chunk is expanded as a whole."""
_BYTES = {"float64": 8, "int8": 1, "int16": 2, "int32": 4, "int64": 8, "uint64": 8, "string": 16}
_CODECS = frozenset({"bytes", "blosc", "zstd", "vlen-utf8", "crc32c", "sharding_indexed"})


def finished_nodes(head: Any) -> Mapping[str, Any] | None:
    """Return the metadata of the arrays and groups of a store; None where its writing has not ended.

    Parameters
    ----------
    head : object
        Contents of the `zarr.json` at the root.

    Raises
    ------
    ValueError
        A name, size, type or codec is none that this package writes.
    """
    if not isinstance(head, dict) or head.get("zarr_format") != 3 or head.get("node_type") != "group":
        raise ValueError("contents other than a group of Zarr format 3")
    consolidated = head.get("consolidated_metadata")
    if not consolidated:
        return None
    nodes = consolidated.get("metadata") if isinstance(consolidated, dict) else None
    if not isinstance(nodes, dict) or len(nodes) > MOST_ARRAYS:
        raise ValueError(f"consolidated metadata that are no table of at most {MOST_ARRAYS} arrays")
    for name, node in nodes.items():
        if not _NAME.fullmatch(name):
            raise ValueError(f"an array of the name {name[:60]!r}")
        if not isinstance(node, dict):
            raise ValueError(f"{name}: contents other than a node")
        if node.get("node_type") == "array":
            _check_array(name, node)
    return nodes


def _check_array(name: str, node: Mapping[str, Any]) -> None:
    """Raise ValueError unless an array has a known type, bounded sizes, and known codecs."""
    kind = node.get("data_type")
    shape, dims = _sizes(node.get("shape")), node.get("dimension_names") or []
    chunk = _sizes(_configuration(node.get("chunk_grid")).get("chunk_shape"))
    if not isinstance(kind, str) or kind not in _BYTES:
        raise ValueError(f"{name}: the type {str(kind)[:60]}")
    if (
        shape is None
        or chunk is None
        or not isinstance(dims, list)
        or not len(shape) == len(chunk) == len(dims)
    ):
        raise ValueError(f"{name}: shape, chunks and dimensions that do not fit together")
    if len(set(dims)) != len(dims) or not all(isinstance(d, str) and _NAME.fullmatch(d) for d in dims):
        raise ValueError(f"{name}: dimensions without a name each")
    if math.prod(shape) > MOST_VALUES or 0 in chunk:
        raise ValueError(f"{name}: the shape {shape} in chunks of {chunk}")
    inner = _checked_codecs(name, node.get("codecs"), chunk)
    if math.prod(inner) * _BYTES[kind] > MOST_CHUNK_BYTES:
        raise ValueError(f"{name}: chunks above {MOST_CHUNK_BYTES} bytes")


def _checked_codecs(name: str, codecs: Any, chunk: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape of what is expanded as a whole; an unknown codec raises ValueError."""
    if not isinstance(codecs, list) or not 1 <= len(codecs) <= 4:
        raise ValueError(f"{name}: no list of codecs")
    for codec in codecs:
        kind = codec.get("name") if isinstance(codec, dict) else None
        if kind not in _CODECS:
            raise ValueError(f"{name}: the codec {str(kind)[:60]}")
    if codecs[0].get("name") != "sharding_indexed":
        if any(codec.get("name") == "sharding_indexed" for codec in codecs):
            raise ValueError(f"{name}: shards within other codecs")
        return chunk
    settings = _configuration(codecs[0])
    inner = _sizes(settings.get("chunk_shape"))
    if len(codecs) > 1 or inner is None or len(inner) != len(chunk) or 0 in inner:
        raise ValueError(f"{name}: shards that are not made of chunks")
    parts = [size / part for size, part in zip(chunk, inner, strict=True)]
    if any(part != int(part) for part in parts) or math.prod(parts) * 16 > MOST_CHUNK_BYTES:
        raise ValueError(f"{name}: shards of {chunk} in chunks of {inner}")
    found = _checked_codecs(name, settings.get("codecs"), inner)
    if found != inner:
        raise ValueError(f"{name}: shards within shards")
    if {_name(codec) for codec in settings.get("index_codecs", [])} - {"bytes", "crc32c"}:
        raise ValueError(f"{name}: an index of shards in other codecs")
    return inner


def _name(codec: Any) -> Any:
    return codec.get("name") if isinstance(codec, dict) else None


def _configuration(part: Any) -> Mapping[str, Any]:
    found = part.get("configuration") if isinstance(part, dict) else None
    return found if isinstance(found, dict) else {}


def _sizes(value: Any) -> tuple[int, ...] | None:
    """Return sizes that are whole numbers from 0; None for anything else."""
    if not isinstance(value, list) or len(value) > 32:
        return None
    if not all(type(size) is int and 0 <= size <= MOST_VALUES for size in value):
        return None
    return tuple(value)
