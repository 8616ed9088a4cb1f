/* A signal about one instant: a polynomial of the time since then, valid up to a kink or as far as it is exact. */
#ifndef VIBROIMPACT_PIECE_H
#define VIBROIMPACT_PIECE_H

#include <float.h>
#include <math.h>

#include "motion/twofold.h"

/* Highest degree of a piece. A Taylor series of a sine is exact to 1e-13 of the amplitude over 1.23 rad. */
enum { VI_PIECE_DEGREE = 16 };

typedef struct {
    int degree;
    double length;                           /* s, > 0; HUGE_VAL: for ever */
    double coefficient[VI_PIECE_DEGREE + 1]; /* of powers of the seconds since the instant */
} vi_piece;

/* Seconds before a kink at which a signal is past it: 2 units in the last place of the time. */
static inline double vi_piece_resolution(vi_twofold time)
{
    return 2.0 * DBL_EPSILON * fabs(time.high);
}

static inline void vi_piece_zero(vi_piece *piece, double length)
{
    *piece = (vi_piece){.length = length};
}

/* Count a piece of degree 3 or less from `u` seconds later: a Taylor shift. The length stays. */
static inline void vi_piece_shift(vi_piece *piece, double u)
{
    double *c = piece->coefficient;
    for (int last = 0; last < piece->degree; ++last) {
        for (int n = piece->degree - 1; n >= last; --n) {
            c[n] += u * c[n + 1];
        }
    }
}

#endif
