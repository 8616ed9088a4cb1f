/* Forces that only push: the linear complementarity problem of several contacts at once. */
#ifndef VIBROIMPACT_COMPLEMENTARITY_H
#define VIBROIMPACT_COMPLEMENTARITY_H

#include "sizes.h"

/* Find p >= 0 with g p - b >= 0 and p (g p - b) = 0 for the first n contacts. The order of the contacts does not
 * matter. A positive definite g has one answer; redundant contacts (the same point twice) share the load evenly. */
void vi_complementary(int n, double g[VI_PORTS][VI_PORTS], const double b[VI_PORTS], double p[VI_PORTS]);

/* Solve g p = b for the contacts that are active; the other p are 0. */
void vi_solve_active(int n, double g[VI_PORTS][VI_PORTS], const double b[VI_PORTS], const int active[VI_PORTS],
                     double p[VI_PORTS]);

#endif
