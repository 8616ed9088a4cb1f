/* FNV-1a hash of bytes: detects damage and difference, but no forgery. */
#ifndef VIBROIMPACT_HASH_H
#define VIBROIMPACT_HASH_H

#include <stddef.h>
#include <stdint.h>

#define VI_HASH_START 1469598103934665603u

/* Hash of `size` bytes behind those of `hash`. */
static inline uint64_t vi_hash(uint64_t hash, const void *data, size_t size)
{
    const unsigned char *bytes = data;
    for (size_t i = 0; i < size; ++i) {
        hash = (hash ^ bytes[i]) * 1099511628211u;
    }
    return hash;
}

#endif
