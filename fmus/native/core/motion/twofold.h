/* Numbers of 32 digits as sums of two doubles that do not overlap, by Dekker's and Knuth's exact sums and products. */
#ifndef VIBROIMPACT_TWOFOLD_H
#define VIBROIMPACT_TWOFOLD_H

#include <math.h>

typedef struct {
    double high, low; /* |low| <= half a unit in the last place of high */
} vi_twofold;

/* high + low of any two numbers, without rounding. */
static inline vi_twofold vi_twofold_of(double a, double b)
{
    const double sum = a + b, part = sum - a;
    return (vi_twofold){sum, (a - (sum - part)) + (b - part)};
}

static inline vi_twofold vi_twofold_sum(vi_twofold a, vi_twofold b)
{
    const vi_twofold high = vi_twofold_of(a.high, b.high), low = vi_twofold_of(a.low, b.low);
    const vi_twofold sum = vi_twofold_of(high.high, high.low + low.high);
    return vi_twofold_of(sum.high, sum.low + low.low);
}

static inline vi_twofold vi_twofold_difference(vi_twofold a, vi_twofold b)
{
    return vi_twofold_sum(a, (vi_twofold){-b.high, -b.low});
}

static inline vi_twofold vi_twofold_product(vi_twofold a, vi_twofold b)
{
    const double product = a.high * b.high;
    return vi_twofold_of(product, fma(a.high, b.high, -product) + (a.high * b.low + a.low * b.high));
}

static inline vi_twofold vi_twofold_quotient(vi_twofold a, vi_twofold b)
{
    const double first = a.high / b.high;
    const vi_twofold left = vi_twofold_difference(a, vi_twofold_product((vi_twofold){first, 0.0}, b));
    return vi_twofold_of(first, left.high / b.high);
}

#endif
