/* The Taylor series of a real power of a series, coefficient by coefficient as those of its base become known.
 *
 * power = base ^ exponent has power' base = exponent power base'. Its coefficients are stored backwards, so that those of a
 * product are sums of products of two rows.
 */
#ifndef VIBROIMPACT_POWER_SERIES_H
#define VIBROIMPACT_POWER_SERIES_H

#include <math.h>
#include <string.h>

#include "motion/polynomial.h"
#include "motion/rows.h"

enum { VI_POWER_ROOM = VI_ORDER + 1 + VI_LANES };

typedef struct {
    double exponent;
    int order;                                        /* coefficients 0 to `order` of the power are known */
    double base[VI_POWER_ROOM], slope[VI_POWER_ROOM]; /* coefficient n of the base, and n times it; from 1 on */
    double behind[VI_POWER_ROOM];                     /* coefficient n of the power, at [VI_ORDER - n] */
    double first, power;                              /* coefficient 0 of the base, coefficient `order` of the power */
} vi_power_series;

/* Begin with coefficient 0 of the base, > 0. */
static inline void vi_power_series_begin(vi_power_series *p, double exponent, double first)
{
    memset(p, 0, sizeof *p);
    p->exponent = exponent;
    p->first = first;
    p->power = p->behind[VI_ORDER] = pow(first, exponent);
}

/* One order more, from the next coefficient of the base. Returns the coefficient of power base' that is known by now: the
 * one before the new order. */
static inline double vi_power_series_extend(vi_power_series *p, double next)
{
    const int n = ++p->order, width = VI_WHOLE_LANES(n + 1);
    const double order = (double)n;
    double product[VI_LANES] = {0.0}, rest[VI_LANES] = {0.0}, *behind = &p->behind[VI_ORDER - n];
    p->base[n] = next;
    p->slope[n] = order * next;
    for (int j = 0; j < width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            product[i] += p->slope[j + i] * behind[j + i];
            rest[i] += p->base[j + i] * behind[j + i];
        }
    }
    const double slope = product[0] + product[1];
    p->power = behind[0] = ((p->exponent + 1.0) * slope - order * (rest[0] + rest[1])) * (1.0 / (order * p->first));
    return slope;
}

#endif
