/* The runs of one lane: how a point begins, what its events come to, how it ends. */
#ifndef VIBROIMPACT_LANE_RUN_H
#define VIBROIMPACT_LANE_RUN_H

#include <stdbool.h>

#include "lanes/lane_body.h"
#include "motion/clock.h"

/* The run in a lane, beside what the group holds of it. */
typedef struct {
    int64_t point;          /* -1: none */
    int64_t following;      /* the point after the one that ended here last */
    vi_clock clock;
    vi_instant begin, end;  /* of the recording */
    bool recording, goal_is_period;
    double unit[VI_LANES_CONTACTS];    /* m/s of the group's speeds: |shape| of one mode */
    double impulse[VI_LANES_CONTACTS]; /* N s that change the speed of a contact by 1 m/s */
    bool period_open;
    double period_start, strobe_displacement, strobe_velocity, impacts_before; /* of the period now open */
    double highest, lowest; /* displacement in it */
} vi_lane_run;

/* What a lane does with points, for the length of a call. */
typedef struct {
    const vi_lanes_plan *plan;
    const vi_lane_body *body;
    vi_lanes_points *points;
    vi_lane_group *group;
    vi_lane_run *run; /* [VI_LANES] */
    int64_t next;     /* no point before it can begin but one that follows another in its lane */
} vi_lanes_work;

/* Begin the next point that can begin in a lane that has none; false when there is none. It may have ended at once. */
bool vi_lane_take(vi_lanes_work *work, int lane);

/* After a round: what the lane's event asks for. */
void vi_lane_attend(vi_lanes_work *work, int lane);

/* Empty a lane: it moves nothing, and meets nothing. */
void vi_lane_idle(vi_lanes_work *work, int lane);

#endif
