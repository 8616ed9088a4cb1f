/* Legendre series over a step, and the Gauss nodes at which a function is sampled for them.
 *
 * A series a[0] P_0(x) + a[1] P_1(x) + ... has its variable x from -1, the start of the step, to 1, its end. A function
 * given at the Gauss nodes has the series of the polynomial through these values.
 */
#ifndef VIBROIMPACT_LEGENDRE_H
#define VIBROIMPACT_LEGENDRE_H

enum { VI_NODES = 16 }; /* nodes of a step, and coefficients of a series */

typedef struct {
    double node[VI_NODES];                /* from 0 to 1, ascending */
    double series[VI_NODES][VI_NODES];    /* series[i]: of the function that is 1 at node i, 0 at the others */
    double part[VI_NODES][VI_NODES][VI_NODES]; /* part[i][n]: series of P_n over the way from the start to node i */
} vi_legendre;

void vi_legendre_prepare(vi_legendre *basis);

/* Series of the polynomial through these values at the nodes. */
void vi_legendre_series(const vi_legendre *basis, const double value[VI_NODES], double series[VI_NODES]);

/* Value and derivative over x of a series at x. */
void vi_legendre_at(const double series[VI_NODES], double x, double value[2]);

/* Bound of the distance of a series from its mean. */
double vi_legendre_spread(const double series[VI_NODES]);

/* The larger of `so_far` and the largest value over the step of sign times a series, with these values at the nodes. */
double vi_legendre_largest(const vi_legendre *basis, const double series[VI_NODES], const double value[VI_NODES],
                           double sign, double so_far);

#endif
