#include "lanes/lane_record.h"

#define VI_WIDTH 1
#include "lanes/waiting.h"

static const mask HERE = {-1};

void vi_lane_write_impact(const vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane)
{
    write_impacts(group, points, lane, plan->contacts, HERE);
}

void vi_lane_end_period(const vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane)
{
    end_periods(group, plan, points, lane, HERE);
}

void vi_lane_begin_period(vi_lane_group *group, int lane, double displacement, double velocity)
{
    begin_periods(group, lane, HERE, all(displacement), all(velocity));
}

void vi_lane_note_start(vi_lane_group *group, int lane)
{
    note_start(group, lane);
}

void vi_lane_note_flight(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane)
{
    note_and_record(group, plan, points, lane);
}

void vi_lane_record_waiting(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points, int lane)
{
    if (group->record.waits[lane] > 0.0) {
        record_waiting(group, plan, points, lane);
    }
}
