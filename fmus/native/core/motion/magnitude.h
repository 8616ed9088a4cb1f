/* Length of a vector of two numbers, and the nearest power of two: replacements of hypot and exp2(rint(log2(x))). A
 * compiler that links the newest version of those two functions makes a library that needs a newer C library. */
#ifndef VIBROIMPACT_MAGNITUDE_H
#define VIBROIMPACT_MAGNITUDE_H

/* sqrt(x^2 + y^2), to half a unit in the last place except for rare ties, without overflow or underflow on the way. */
double vi_magnitude(double x, double y);

/* The power of two whose logarithm is nearest to that of x > 0. */
double vi_nearest_power_of_two(double x);

#endif
