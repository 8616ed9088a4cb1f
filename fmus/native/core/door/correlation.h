/* Correlation sums of a sequence of numbers (thesis 5.4.2; Grassberger and Procaccia 1983, with the max norm). A sum is
 * the number of pairs of delay vectors within a radius; all radii and embeddings are counted at once.
 *
 * Along a diagonal (all pairs i, i + lag) the distance in m dimensions is a running maximum of |x_i - x_{i+lag}|. So
 * one pass serves every m. The low bits of a radius are zero, so the leading bits of a distance give the radii on both
 * sides. This needs no comparison with each radius and no rounding.
 */
#ifndef VIBROIMPACT_CORRELATION_H
#define VIBROIMPACT_CORRELATION_H

#include <stddef.h>
#include <stdint.h>

/* Radii per octave: 1, 9/8, ... 15/8 times a power of two. */
#define VI_RADII_PER_OCTAVE 8
/* Largest number of radii, and largest number of numbers in a delay vector (even). */
#define VI_MOST_RADII 126
#define VI_MOST_EMBEDDING 16
#define VI_CORRELATION_TABLES 4
/* Pairs worked on together; as many numbers beyond the last one are read too. */
#define VI_CORRELATION_BLOCK 512
#define VI_CORRELATION_PADDING (VI_CORRELATION_BLOCK + VI_MOST_EMBEDDING)

/* Ladder of radii: the lowest radius, > 0 and of the form above, and the number of radii, 2 to VI_MOST_RADII. */
typedef struct {
    double lowest;
    int count;
} vi_radius_ladder;

/* Add the pairs of the lags first, first + step, ... <= last to `joint`.
 *
 * value[count + VI_CORRELATION_PADDING]: NaN where a number is not to be compared, and everywhere beyond `count`.
 * joint[VI_CORRELATION_TABLES][(embedding + 1) / 2][radii + 1][radii + 1]: pairs by the class of their distance in m +
 * 1 dimensions, then in m, for m = 1, 3, 5, ... The caller sums the tables. Class k: not smaller than k radii.
 */
void vi_correlation_add(const double value[], size_t count, size_t first, size_t last, size_t step, int embedding,
                        const vi_radius_ladder *ladder, uint64_t joint[]);

#endif
