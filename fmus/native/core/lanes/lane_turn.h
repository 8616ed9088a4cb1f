/* Functions of one number as the lanes have them: sums and products in a fixed order, where a C library has other last
 * bits on other processors. */
#ifndef VIBROIMPACT_LANE_TURN_H
#define VIBROIMPACT_LANE_TURN_H

/* Cosine and sine: to 1 ulp for 0 <= angle <= 8, to 1.4 up to 100; what is below 1e-7 there, to 1e-22. */
void vi_lane_turn(double angle, double *cosine, double *sine);

/* exp(-x), to 1 ulp, and what is lost, 1 - exp(-x), to 2: x >= 0. */
double vi_lane_decay(double x, double *lost);

#endif
