/* Derivatives over time of a body between events, for output derivatives in co-simulation. equations.md 6.16 */
#ifndef VIBROIMPACT_BODY_RATES_H
#define VIBROIMPACT_BODY_RATES_H

#include <stdint.h>

#include "body/modal/variation.h"

/* Set a zeroed change to the derivatives of this order, 1 or 2, before it is carried; `first` is the carried change of
 * order 1. Returns NULL, or what has no such derivative. */
const char *vi_body_rate(void *self, int order, const vi_variation *first, vi_variation *change);

/* The second derivative of an energy along the motion; 0 for other outputs. */
double vi_body_bend(void *self, uint32_t value_reference);

#endif
