/* A body of one mode with stops that yield, and the rows of its contacts. */
#ifndef VIBROIMPACT_LANE_YIELDING_H
#define VIBROIMPACT_LANE_YIELDING_H

#include "lanes/lane_body.h"

extern const vi_lane_body vi_lane_yielding;

/* Write the contact that has ended at the lane's instant. */
void vi_yielding_write(vi_lane_group *group, vi_lanes_points *points, int lane);

/* Write the contact that is open at the end of the lane's run, if it is to be recorded. */
void vi_yielding_write_open(vi_lane_group *group, vi_lanes_points *points, int lane);

/* Note or write the contact that has just begun or ended in a careful search. Returns the lane's event. */
int vi_yielding_record(vi_lane_group *group, vi_lanes_points *points, int lane);

#endif
