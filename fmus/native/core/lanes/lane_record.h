/* Rows of one lane, with the bits of the lockstep. */
#ifndef VIBROIMPACT_LANE_RECORD_H
#define VIBROIMPACT_LANE_RECORD_H

#include "lanes/lane_group.h"

/* Write the impact at which the lane is. */
void vi_lane_write_impact(const vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane);

/* Write the open period of the lane, which ends. */
void vi_lane_end_period(const vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane);

/* Begin a period in the lane, in this state of the observed point. */
void vi_lane_begin_period(vi_lane_group *group, int lane, double displacement, double velocity);

/* Keep the instant at which a flight in the lane's present cell begins; then keep the flight, which has ended. */
void vi_lane_note_start(vi_lane_group *group, int lane);
void vi_lane_note_flight(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane);

/* Record the waiting flights of the lane, if it has some. */
void vi_lane_record_waiting(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane);

#endif
