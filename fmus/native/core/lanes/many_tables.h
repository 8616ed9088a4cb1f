/* Tables of a body of several modes in a lane, and their rows for the present level. */
#ifndef VIBROIMPACT_MANY_TABLES_H
#define VIBROIMPACT_MANY_TABLES_H

#include <stdbool.h>

#include "lanes/lane_group.h"

/* Put the body of a point in the lane, as `take` of vi_lane_body. */
bool vi_lane_take_many(vi_lane_group *group, int lane, const vi_lanes_plan *plan, const vi_lanes_points *points,
                       int64_t point, const double q[], const double p[]);

/* Put the rows of the lane's level in place. */
void vi_lane_put_level(vi_lane_group *group, int lane, int modes, int contacts);

#endif
