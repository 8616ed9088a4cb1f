#include "sparse.h"

#include <stdint.h>
#include <string.h>

enum { BLOCK = 64 };

static bool is_zero(const unsigned char *block)
{
    uint64_t w[BLOCK / 8];
    memcpy(w, block, BLOCK);
    return ((w[0] | w[1] | w[2] | w[3]) | (w[4] | w[5] | w[6] | w[7])) == 0;
}

/* Number of bytes of the bits of `size` bytes. */
static size_t map_size(size_t size)
{
    return (size / BLOCK + 7) / 8;
}

static bool is_kept(const unsigned char *map, size_t block)
{
    return (map[block / 8] >> block % 8 & 1) != 0;
}

size_t vi_sparse_pack(const unsigned char *bytes, size_t size, unsigned char *packed, size_t room)
{
    const size_t blocks = size / BLOCK, rest = size % BLOCK;
    size_t end = map_size(size);
    if (end > 0 && end <= room) {
        memset(packed, 0, end);
    }
    for (size_t i = 0; i < blocks; ++i) {
        if (is_zero(bytes + i * BLOCK)) {
            continue;
        }
        if (end + BLOCK <= room) {
            packed[i / 8] = (unsigned char)(packed[i / 8] | 1u << i % 8);
            memcpy(packed + end, bytes + i * BLOCK, BLOCK);
        }
        end += BLOCK;
    }
    if (rest > 0 && end + rest <= room) {
        memcpy(packed + end, bytes + blocks * BLOCK, rest);
    }
    return end + rest;
}

bool vi_sparse_fits(const unsigned char *packed, size_t packed_size, size_t size)
{
    size_t kept = 0;
    if (packed_size < map_size(size)) {
        return false;
    }
    for (size_t i = 0; i < size / BLOCK; ++i) {
        kept += is_kept(packed, i);
    }
    return packed_size == map_size(size) + kept * BLOCK + size % BLOCK;
}

void vi_sparse_unpack(const unsigned char *packed, unsigned char *bytes, size_t size)
{
    const size_t blocks = size / BLOCK;
    const unsigned char *next = packed + map_size(size);
    for (size_t i = 0; i < blocks; ++i) {
        if (is_kept(packed, i)) {
            memcpy(bytes + i * BLOCK, next, BLOCK);
            next += BLOCK;
        } else {
            memset(bytes + i * BLOCK, 0, BLOCK);
        }
    }
    memcpy(bytes + blocks * BLOCK, next, size % BLOCK);
}
