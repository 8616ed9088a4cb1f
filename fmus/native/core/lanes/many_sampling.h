/* Time series of bodies of several modes, lane by lane: see many_samples.h. */
#ifndef VIBROIMPACT_MANY_SAMPLING_H
#define VIBROIMPACT_MANY_SAMPLING_H

#include "lanes/lane_group.h"

/* `sample_from` and `take_samples` of a body of several modes, see lane_body.h. */
void vi_lane_sample_many_from(vi_lane_group *group, int lane, int modes);
void vi_lane_take_samples_of_many(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane);

#endif
