/* Time series of bodies of one mode: samples between two instants of a lane, from the tables of its cells. */
#ifndef VIBROIMPACT_LANE_SAMPLING_H
#define VIBROIMPACT_LANE_SAMPLING_H

#include <stdbool.h>

#include "lanes/lane_group.h"

/* Begin the samples of the lane's point, whose recording begins now; false if they have too little room. */
bool vi_lane_begin_samples(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane);

/* Keep the lane's state: the next samples are taken from here on. */
void vi_lane_sample_from(vi_lane_group *group, int lane);

/* Take the samples up to the lane's instant, in the phase in which the motion since `vi_lane_sample_from` began. */
void vi_lane_take_samples(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane);

#endif
