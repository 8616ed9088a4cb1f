/* Many runs of one kind of body at once: points of a scene in lockstep, one in each lane of the vector registers.
 *
 * A body of few modes with rigid stops flies, hits and rebounds. All lanes do the same arithmetic under masks, from + -
 * * / and square roots only. So every instruction set, every number of lanes and every cut of the points gives the same
 * bits.
 *
 * Rare cases are not done here: chatter, a rest, a start on a stop, a touch that rounding would decide, refused
 * parameters. Such a point is left to the scalar engine, which runs it from its start.
 */
#ifndef VIBROIMPACT_LANES_H
#define VIBROIMPACT_LANES_H

#include <stddef.h>

#include "door/door.h"
#include "lanes/lane_points.h"

/* Reasons why vi_door_lanes returns. */
enum {
    VI_LANES_DONE = 0,   /* all points have run */
    VI_LANES_LISTEN = 1, /* most_seconds are over; call again to go on */
    VI_LANES_FULL = 2,   /* the rows need more room: take them, then call again */
    VI_LANES_LEFT = 3,   /* all points have run, except points left and later points of their branches */
    VI_LANES_REFUSED = 4 /* invalid plan: sizes, or an instruction set that this machine lacks */
};

/* Least number of rows with room. */
enum { VI_LANES_LEAST_ROOM = 4096 };

/* Bytes of memory for runs of this plan; 0 for a refused plan. */
VI_DOOR size_t vi_door_lanes_memory(const vi_lanes_plan *plan);

/* Run the remaining points. `memory` keeps the state between two calls: all 0 before the first call, and only for these
 * points afterwards; their arrays may move between calls. Returns one of VI_LANES_DONE to VI_LANES_REFUSED. */
VI_DOOR int vi_door_lanes(const vi_lanes_plan *plan, vi_lanes_points *points, void *memory);

/* Put `count` impacts, as written in `rows` and `owner`, into columns[VI_IMPACT_WIDTH][total], point by point.
 * next[point]: place of the point's next impact, counted on here; -1: its impacts are left out. */
VI_DOOR void vi_door_lanes_impacts(const double *rows, const int64_t *owner, int64_t count, int64_t *next, int64_t total,
                                   double *columns);

/* The instruction set that runs when `set` is asked for: itself, or the best; 0 where the machine lacks it. */
VI_DOOR int vi_door_lanes_instructions(int set);

#endif
