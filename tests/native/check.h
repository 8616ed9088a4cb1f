/* Shared by the C tests: a check that stays in release builds, and random numbers that are the same everywhere. */
#ifndef VIBROIMPACT_TEST_CHECK_H
#define VIBROIMPACT_TEST_CHECK_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define CHECK(condition, ...)                                                                                       \
    do {                                                                                                             \
        if (!(condition)) {                                                                                          \
            fprintf(stderr, "%s:%d: expected %s: ", __FILE__, __LINE__, #condition);                                 \
            fprintf(stderr, __VA_ARGS__);                                                                            \
            fputc('\n', stderr);                                                                                     \
            exit(1);                                                                                                 \
        }                                                                                                            \
    } while (0)

/* splitmix64 */
static inline uint64_t next_random(uint64_t *seed)
{
    uint64_t z = (*seed += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

/* Uniform in [low, high). */
static inline double uniform(uint64_t *seed, double low, double high)
{
    return low + (high - low) * ((double)(next_random(seed) >> 11) * 0x1p-53);
}

/* One of `count` choices. */
static inline unsigned choice(uint64_t *seed, unsigned count)
{
    return (unsigned)(next_random(seed) % count);
}

#endif
