#include "motion/magnitude.h"

#include <math.h>

double vi_magnitude(double x, double y)
{
    const double large = fmax(fabs(x), fabs(y)), small = fmin(fabs(x), fabs(y));
    if (!(large > 0.0) || !isfinite(x) || !isfinite(y)) {
        return isinf(x) || isinf(y) ? INFINITY : large + small + 0.0 * (x + y);
    }
    int exponent;
    (void)frexp(large, &exponent);
    const double a = ldexp(large, -exponent), b = ldexp(small, -exponent);
    /* both squares with their roundings, then a Newton step on the square root of the sum */
    const double square = a * a, other = b * b, sum = square + other;
    const double rounding = ((square - sum) + other) + (fma(a, a, -square) + fma(b, b, -other));
    const double root = sqrt(sum);
    return ldexp(root + (fma(-root, root, sum) + rounding) / (2.0 * root), exponent);
}

double vi_nearest_power_of_two(double x)
{
    static const double ROOT_HALF = 0.70710678118654752440;
    int exponent;
    if (!isfinite(x)) {
        return x;
    }
    const double fraction = frexp(x, &exponent); /* 0.5 to 1 */
    return ldexp(1.0, fraction < ROOT_HALF ? exponent - 1 : exponent);
}
