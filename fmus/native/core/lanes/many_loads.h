/* The real modes of a body of several modes in a lane, with their responses to the loads. */
#ifndef VIBROIMPACT_LANE_MANY_LOADS_H
#define VIBROIMPACT_LANE_MANY_LOADS_H

#include <stdbool.h>

#include "lanes/lane_group.h"
#include "motion/segment.h"

/* Set the real modes of a point in their start state, less the responses; false where lockstep cannot follow them. */
bool vi_lane_take_modes(vi_lane_group *group, int lane, const vi_lanes_plan *plan, const vi_lanes_points *points,
                        int64_t point, const double q[], const double p[], vi_mode mode[]);

#endif
