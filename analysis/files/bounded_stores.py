"""Objects and chunks of Zarr stores within bounds: classes of zarr that refuse more than an array announces.

Imported with the package zarr only, through `stores`.
"""

from __future__ import annotations

import asyncio
import hashlib
import math
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from zarr.abc.store import RangeByteRequest
from zarr.codecs import BloscCodec, ZstdCodec
from zarr.codecs import VLenUTF8Codec as ZarrTexts
from zarr.registry import register_codec
from zarr.storage import LocalStore, WrapperStore

from vibroimpact.analysis.files.store_metadata import MOST_METADATA_BYTES

MOST_OBJECT_BYTES = 1 << 30
"""Largest object of a store that is read, bytes: a shard has 64 MiB of numbers."""
MOST_TEXT_BYTES = 1 << 28
"""Largest size of the texts of one chunk, bytes."""
_BLOSC_HEAD, _ZSTD_HEAD = 16, 18


class BoundedStore(WrapperStore[Any]):
    """A store that gives no object above its bound; a finished one has an object for each shard that is read."""

    def __init__(self, store: Any) -> None:
        super().__init__(store)
        self._replaced: dict[str, str] = {}

    @contextmanager
    def replaced(self, keys: Sequence[str]) -> Iterator[dict[str, str]]:
        """Take older objects for absent while the block writes new ones; yield the SHA-256 of each that is written."""
        self._replaced.update(dict.fromkeys(keys, ""))
        found: dict[str, str] = {}
        try:
            yield found
            found.update({key: self._replaced[key] for key in keys})
        finally:
            for key in keys:
                del self._replaced[key]

    async def set(self, key: str, value: Any) -> None:
        """Write an object."""
        await super().set(key, value)
        if key in self._replaced:
            digest = await asyncio.to_thread(hashlib.sha256, value.as_numpy_array())
            self._replaced[key] = digest.hexdigest()

    async def get(self, key: str, prototype: Any, byte_range: Any = None) -> Any:
        """Return an object, or a part of it; one above its bound raises ValueError."""
        if key in self._replaced:
            return None
        most = MOST_METADATA_BYTES if key.endswith("zarr.json") else MOST_OBJECT_BYTES
        if isinstance(byte_range, RangeByteRequest) and byte_range.end - byte_range.start > most:
            raise ValueError(f"a part of {key} above {most} bytes")
        if byte_range is None and not isinstance(self._store, LocalStore):
            byte_range = RangeByteRequest(0, most + 1)  # one request, where the size would be another
        elif byte_range is None and await self._size(key) > most:
            raise ValueError(f"an object {key} above {most} bytes")
        found = await super().get(key, prototype, byte_range)
        if found is None and self.read_only and not key.endswith("zarr.json"):
            raise ValueError(f"no object {key}")
        if found is not None and not len(found):
            raise ValueError(f"an empty object {key}")
        if found is not None and len(found) > most:
            raise ValueError(f"an object {key} above {most} bytes")
        return found

    async def _size(self, key: str) -> int:
        try:
            return int(await self._store.getsize(key))
        except FileNotFoundError:
            return 0


class BoundedBlosc(BloscCodec):
    """Blosc, whose chunks must hold the values that their array announces."""

    async def _decode_single(self, chunk_bytes: Any, chunk_spec: Any) -> Any:
        head = bytes(chunk_bytes.as_numpy_array()[:_BLOSC_HEAD])
        expected = math.prod(chunk_spec.shape) * int(chunk_spec.dtype.to_native_dtype().itemsize)
        if len(head) < _BLOSC_HEAD or struct.unpack_from("<I", head, 4)[0] != expected:
            raise ValueError(f"a compressed chunk that does not hold {expected} bytes")
        return await super()._decode_single(chunk_bytes, chunk_spec)


class BoundedZstd(ZstdCodec):
    """Zstandard, for texts: a chunk must announce its size, and stay below a bound."""

    async def _decode_single(self, chunk_bytes: Any, chunk_spec: Any) -> Any:
        size = _zstd_content(bytes(chunk_bytes.as_numpy_array()[:_ZSTD_HEAD]))
        if size is None or size > MOST_TEXT_BYTES:
            raise ValueError(f"a compressed chunk of texts that holds more than {MOST_TEXT_BYTES} bytes")
        return await super()._decode_single(chunk_bytes, chunk_spec)


class VLenUTF8Codec(ZarrTexts):
    """Texts of a chunk, as many as their array announces; zarr accepts a codec of texts by this name only."""

    async def _decode_single(self, chunk_bytes: Any, chunk_spec: Any) -> Any:
        head = bytes(chunk_bytes.as_numpy_array()[:4])
        expected = math.prod(chunk_spec.shape)
        if len(head) < 4 or struct.unpack("<I", head)[0] != expected:
            raise ValueError(f"a chunk that does not hold {expected} texts")
        return await super()._decode_single(chunk_bytes, chunk_spec)


def _zstd_content(head: bytes) -> int | None:
    """Return the announced size of a Zstandard frame (RFC 8878, 3.1.1.1); None where the frame has none."""
    if len(head) < 6 or head[:4] != b"\x28\xb5\x2f\xfd":
        return None
    kind, is_single = head[4] >> 6, bool(head[4] & 0x20)
    width = (1 if is_single else 0, 2, 4, 8)[kind]
    start = 5 + (0 if is_single else 1) + (0, 1, 2, 4)[head[4] & 3]
    if not width or len(head) < start + width:
        return None
    return int.from_bytes(head[start : start + width], "little") + (256 if width == 2 else 0)


_BOUNDED = {"blosc": BoundedBlosc, "zstd": BoundedZstd, "vlen-utf8": VLenUTF8Codec}
SETTINGS: dict[str, Any] = {
    # a missing object is then damage, and no shard of missing values
    "array.write_empty_chunks": True,
    **{f"codecs.{name}": f"{__name__}.{codec.__name__}" for name, codec in _BOUNDED.items()},
}
"""Settings of zarr with which arrays are made and opened."""
for _name, _codec in _BOUNDED.items():
    register_codec(_name, _codec)
