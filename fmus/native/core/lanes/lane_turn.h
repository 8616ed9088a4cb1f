/* Functions of one number with the bits of the lanes: sums and products in a fixed order. The last bits of a C library
 * differ between processors. */
#ifndef VIBROIMPACT_LANE_TURN_H
#define VIBROIMPACT_LANE_TURN_H

/* Cosine and sine: to 1 ulp for 0 <= angle <= 8, to 1.4 ulp up to 100. Below 1e-7 the error is 1e-22 there. */
void vi_lane_turn(double angle, double *cosine, double *sine);

/* exp(-x) to 1 ulp, and its loss 1 - exp(-x) to 2 ulp, for x >= 0. */
double vi_lane_decay(double x, double *lost);

#endif
