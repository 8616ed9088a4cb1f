/* The runs of one lane: start of a point, reactions to events, end of the run. */
#ifndef VIBROIMPACT_LANE_RUN_H
#define VIBROIMPACT_LANE_RUN_H

#include <stdbool.h>

#include "lanes/lane_body.h"
#include "motion/clock.h"

/* The run in a lane, apart from its state in the group. */
typedef struct {
    int64_t point;          /* -1: none */
    int64_t following;      /* the point after the last one that ended here */
    vi_clock clock;
    vi_instant begin, end;  /* of the recording */
    bool recording, goal_is_period;
} vi_lane_run;

/* Everything that a lane needs to run points, for the length of a call. */
typedef struct {
    const vi_lanes_plan *plan;
    const vi_lane_body *body;
    vi_lanes_points *points;
    vi_lane_group *group;
    vi_lane_run *run; /* [VI_LANES] */
    int64_t next;     /* earlier points can begin only in the lane of their branch */
} vi_lanes_work;

/* Begin the next possible point in an empty lane; false when there is none. The point may end at once. */
bool vi_lane_take(vi_lanes_work *work, int lane);

/* Act on the lane's event after a round. */
void vi_lane_attend(vi_lanes_work *work, int lane);

/* Empty a lane: it moves nothing, and meets nothing. */
void vi_lane_idle(vi_lanes_work *work, int lane);

#endif
