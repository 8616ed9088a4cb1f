/* Polynomials of an elapsed time, and their first fall to zero. */
#ifndef VIBROIMPACT_POLYNOMIAL_H
#define VIBROIMPACT_POLYNOMIAL_H

#include <stdbool.h>

/* Order of the Taylor polynomials of a coupled motion. */
enum { VI_ORDER = 26 };

/* Value and first three derivatives of c[0] + c[1] u + ... + c[VI_ORDER] u^VI_ORDER. */
void vi_polynomial_at(const double c[VI_ORDER + 1], double u, double value[4]);

/* Sum of the moduli of the terms at `length`; the polynomial's rounding is 1e-16 of this sum. */
double vi_polynomial_size(const double c[VI_ORDER + 1], double length);

/* Do the sizes of the terms alone prove that the polynomial stays positive over 0 <= u <= length? They do for most. */
bool vi_polynomial_clears(const double c[VI_ORDER + 1], double length);

typedef struct {
    bool found;
    double time;  /* of the fall, s; if not found: no fall before this time, the length or the end of a long search */
    double speed; /* speed of the fall, per s; 0 when the value only touches zero and rises again */
} vi_fall;

/* First fall to zero, up to `length`, of a polynomial that is not negative at `from`; certified: no zero is passed. A
 * value below `noise` counts as zero where it falls. */
vi_fall vi_polynomial_fall(const double c[VI_ORDER + 1], double from, double length, double noise);

#endif
