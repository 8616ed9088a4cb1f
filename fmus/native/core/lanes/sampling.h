/* Time series: samples between two instants of a lane. Bodies of one mode take them from the tables of their cells. */
#ifndef VIBROIMPACT_LANE_SAMPLING_H
#define VIBROIMPACT_LANE_SAMPLING_H

#include <stdbool.h>

#include "lanes/lane_group.h"

/* Relative rounding of a time: a sample so close after an event is taken before it. */
#define VI_ROUNDING_OF_TIME (4.0 * 2.220446049250313e-16)

/* Set the sampled points in the order of their samples: contacts from 0, then VI_LANES_CONTACTS, the observed point.
 * Returns their number. */
int vi_lane_sampled(const vi_lanes_plan *plan, int sampled[VI_POINTS]);

/* Begin the samples of the lane's point, whose recording begins now; false if they have too little room. */
bool vi_lane_begin_samples(vi_lane_group *group, const vi_lanes_plan *plan, const vi_lanes_points *points, int lane);

/* Write the next sample of the lane: displacements and velocities of its sampled points. */
void vi_lane_write_sample(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane,
                          const double displacement[], const double velocity[]);

/* `sample_from` and `take_samples` of a body of one mode, see lane_body.h. */
void vi_lane_sample_from(vi_lane_group *group, int lane, int modes);
void vi_lane_take_samples(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane);

#endif
