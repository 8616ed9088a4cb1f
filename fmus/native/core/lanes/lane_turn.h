/* Cosine and sine as the lanes have them, of one number: 0 <= angle <= 8, to 1 ulp. */
#ifndef VIBROIMPACT_LANE_TURN_H
#define VIBROIMPACT_LANE_TURN_H

void vi_lane_turn(double angle, double *cosine, double *sine);

#endif
