/* Complex numbers without <complex.h>, which some compilers lack. */
#ifndef VIBROIMPACT_COMPLEX_H
#define VIBROIMPACT_COMPLEX_H

#include <math.h>

typedef struct {
    double re, im;
} vi_complex;

static inline vi_complex vi_complex_add(vi_complex a, vi_complex b)
{
    return (vi_complex){a.re + b.re, a.im + b.im};
}

static inline vi_complex vi_complex_subtract(vi_complex a, vi_complex b)
{
    return (vi_complex){a.re - b.re, a.im - b.im};
}

static inline vi_complex vi_complex_multiply(vi_complex a, vi_complex b)
{
    return (vi_complex){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

static inline vi_complex vi_complex_scale(double factor, vi_complex a)
{
    return (vi_complex){factor * a.re, factor * a.im};
}

static inline vi_complex vi_complex_conjugate(vi_complex a)
{
    return (vi_complex){a.re, -a.im};
}

static inline double vi_complex_square(vi_complex a)
{
    return a.re * a.re + a.im * a.im;
}

static inline double vi_complex_size(vi_complex a)
{
    return sqrt(vi_complex_square(a));
}

static inline vi_complex vi_complex_invert(vi_complex a)
{
    const double share = 1.0 / vi_complex_square(a);
    return (vi_complex){share * a.re, -share * a.im};
}

static inline vi_complex vi_complex_divide(vi_complex a, vi_complex b)
{
    return vi_complex_multiply(a, vi_complex_invert(b));
}

#endif
