/* Correlation sums of a sequence of numbers: how many pairs of its delay vectors are near, at every radius and in every
 * embedding at once (thesis 5.4.2; Grassberger and Procaccia 1983, with the max norm).
 *
 * Along a diagonal (all pairs i, i + lag) the distance in m dimensions is a running maximum of |x_i - x_{i+lag}|, so one
 * pass serves every m. A radius is a number whose low bits are zero, so the leading bits of a distance name the radii
 * it lies between: no comparison with each of them, and no rounding. */
#ifndef VIBROIMPACT_CORRELATION_H
#define VIBROIMPACT_CORRELATION_H

#include <stddef.h>
#include <stdint.h>

/* Radii per octave: 1, 9/8, ... 15/8 times a power of two. */
#define VI_RADII_PER_OCTAVE 8
/* Most radii, most numbers in a delay vector (even). */
#define VI_MOST_RADII 126
#define VI_MOST_EMBEDDING 16
#define VI_CORRELATION_TABLES 4
/* Pairs worked on together; so many numbers beyond the last are read too. */
#define VI_CORRELATION_BLOCK 512
#define VI_CORRELATION_PADDING (VI_CORRELATION_BLOCK + VI_MOST_EMBEDDING)

/* The ladder of radii: the lowest, > 0, one of those above, and how many, 2 to VI_MOST_RADII. */
typedef struct {
    double lowest;
    int count;
} vi_radius_ladder;

/* Adds the pairs of the lags first, first + step, ... <= last to `joint`.
 *
 * value[count + VI_CORRELATION_PADDING]: what is not to be compared is a NaN, and all beyond `count` are NaN.
 * joint[VI_CORRELATION_TABLES][(embedding + 1) / 2][radii + 1][radii + 1], the tables to be summed by the caller: pairs
 * by the class of their distance in m + 1 dimensions, then of that in m, for m = 1, 3, 5, ...; class k: not smaller
 * than k radii. */
void vi_correlation_add(const double value[], size_t count, size_t first, size_t last, size_t step, int embedding,
                        const vi_radius_ladder *ladder, uint64_t joint[]);

#endif
