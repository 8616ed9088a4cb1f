/* A stationary Gaussian signal with a one-sided power spectral density: equations.md 8.10.
 *
 * White numbers of a counter are shaped in blocks by a filter of limited length. They are the coefficients of a cubic
 * B-spline in time. A block is a function of the seed and its number only, so any instant is found without those before
 * it. All of it has the same bits on every machine.
 */
#ifndef VIBROIMPACT_RANDOM_H
#define VIBROIMPACT_RANDOM_H

#include <stdbool.h>
#include <stdint.h>

#include "signals/piece.h"
#include "signals/table.h"
#include "signals/transform.h"

/* Smallest size of a block; the largest is that of a transform. */
enum { VI_RANDOM_LEAST = 4096 };

/* Coefficients of the spline that act in an interval. */
enum { VI_SPLINE_ORDER = 4 };

/* A density over angular frequency, linear between its places and 0 outside of the band. */
typedef struct {
    double low, high;  /* band, rad/s, 0 <= low < high */
    vi_table density;  /* places, rad/s, and values >= 0, unit^2 s/rad; count 0: variance 1, the same in all the band */
} vi_density;

/* The filter of one signal and its present block. */
typedef struct {
    int size;          /* of a block, 0: not shaped */
    bool known;        /* is `block` in memory? */
    int64_t block;
    double interval;   /* between two instants of the spline, s */
    double filter[VI_TRANSFORM_ROOM]; /* response at each place of a transform, over `size` */
    double first[VI_TRANSFORM_ROOM], second[VI_TRANSFORM_ROOM]; /* two stretches of coefficients and their margins */
} vi_random;

/* Narrowest band that the filter resolves, as a part of its upper end. */
#define VI_NARROWEST_BAND 0.00390625

/* The integral of the density over the band: the variance of the signal. */
double vi_density_variance(const vi_density *density);

/* Prepare the filter. The density must be valid. */
void vi_random_shape(vi_random *random, vi_transform *transform, const vi_density *density);

/* Does an interval of the spline start `since` >= 0 seconds after the start, within the resolution? *interval: its
 * number. */
bool vi_random_is_knot(const vi_random *random, vi_twofold since, double resolution, int64_t *interval);

/* Coefficients of the spline in up to `most` intervals from one on: those of interval i are coefficient[i] to
 * coefficient[i + VI_SPLINE_ORDER - 1]. Returns the number of intervals, 1 at least: they are in one block. */
int vi_random_coefficients(vi_random *random, const vi_transform *transform, uint64_t seed, int64_t interval, int most,
                           double coefficient[]);

/* The polynomial of an interval for its coefficients, in powers of the seconds since its start. */
void vi_random_polynomial(const vi_random *random, const double coefficient[VI_SPLINE_ORDER],
                          double power[VI_SPLINE_ORDER]);

/* The piece `since` >= 0 seconds after the start. resolution: as for tables. */
void vi_random_piece(vi_random *random, const vi_transform *transform, uint64_t seed, vi_twofold since,
                     double resolution, vi_piece *piece);

#endif
