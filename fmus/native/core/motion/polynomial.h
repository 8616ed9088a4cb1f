/* Polynomials of an elapsed time, and where one first falls to zero. */
#ifndef VIBROIMPACT_POLYNOMIAL_H
#define VIBROIMPACT_POLYNOMIAL_H

#include <stdbool.h>

/* Order of the Taylor polynomials of a coupled motion. */
enum { VI_ORDER = 26 };

/* Value, and the first three derivatives, of c[0] + c[1] u + ... + c[VI_ORDER] u^VI_ORDER. */
void vi_polynomial_at(const double c[VI_ORDER + 1], double u, double value[4]);

/* Sum of the moduli of the terms at `length`: their rounding is 1e-16 of this. */
double vi_polynomial_size(const double c[VI_ORDER + 1], double length);

/* Is it certain, from the sizes of the terms alone, that the polynomial stays positive over 0 <= u <= length? Most do. */
bool vi_polynomial_clears(const double c[VI_ORDER + 1], double length);

typedef struct {
    bool found;
    double time;  /* s; not found: there is none up to here, the length or the end of a long search */
    double speed; /* at which it falls there, per s; 0 when it only touches zero and rises again */
} vi_fall;

/* Where a polynomial that is not negative at `from` first falls to zero up to `length`; certified, nothing is passed.
 * Values below `noise` count as zero where it falls. */
vi_fall vi_polynomial_fall(const double c[VI_ORDER + 1], double from, double length, double noise);

#endif
