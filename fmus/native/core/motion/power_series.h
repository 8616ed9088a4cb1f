/* Taylor series of a real power of a series, one coefficient at a time as the coefficients of the base become known.
 *
 * power = base ^ exponent has power' base = exponent power base'. The coefficients of the power are stored backwards,
 * so that the coefficients of a product are sums of products of two rows.
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
    double base[VI_POWER_ROOM], slope[VI_POWER_ROOM]; /* from 1 on: coefficient n of the base, and n times it */
    double behind[VI_POWER_ROOM];                     /* coefficient n of the power, at [VI_ORDER - n]; all but the last */
    double base_first, first, power; /* coefficient 0 of the base and of the power, coefficient `order` of the power */
} vi_power_series;

/* Begin with coefficient 0 of the base, > 0. */
static inline void vi_power_series_begin(vi_power_series *p, double exponent, double first)
{
    memset(p, 0, sizeof *p);
    p->exponent = exponent;
    p->base_first = first;
    p->first = p->power = pow(first, exponent);
}

/* Extend the series by one order, from the next coefficient of the base. Returns the newest known coefficient of power
 * base': the one before the new order. The newest numbers are added last and stored afterwards: no sum waits. */
static inline double vi_power_series_extend(vi_power_series *p, double next)
{
    const int n = ++p->order, width = VI_WHOLE_LANES(n);
    const double order = (double)n, slope = order * next, last = n > 1 ? p->power : 0.0;
    double product[VI_LANES] = {0.0}, rest[VI_LANES] = {0.0}, *behind = &p->behind[VI_ORDER - n];
    for (int j = 0; j < width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            product[i] += p->slope[j + i] * behind[j + i];
            rest[i] += p->base[j + i] * behind[j + i];
        }
    }
    const double along = (product[0] + product[1]) + p->slope[1] * last + slope * p->first;
    const double across = (rest[0] + rest[1]) + p->base[1] * last + next * p->first;
    behind[1] = p->power;
    p->base[n] = next;
    p->slope[n] = slope;
    p->power = ((p->exponent + 1.0) * along - order * across) * (1.0 / (order * p->base_first));
    return along;
}

#endif
