/* Many runs of one kind of body at once: points of a scene in lockstep, one in each lane of the vector registers.
 *
 * A body of few modes with rigid stops flies, hits, rebounds; all lanes do the same arithmetic under masks, made of
 * + - * / and square roots only, so that every instruction set, every number of lanes and every cut of the points gives
 * the same bits. What is rare (chatter, a rest, a start on a stop, a touch that rounding would decide, a parameter that a
 * body refuses) is not done here: such a point is left for the scalar engine, which runs it from its start.
 */
#ifndef VIBROIMPACT_LANES_H
#define VIBROIMPACT_LANES_H

#include <stddef.h>

#include "door/door.h"
#include "lanes/lane_points.h"

/* Why vi_door_lanes returns. */
enum {
    VI_LANES_DONE = 0,   /* all points have run */
    VI_LANES_LISTEN = 1, /* it has taken as long as it was to; call again to go on */
    VI_LANES_FULL = 2,   /* the rows need more room: take them, then call again */
    VI_LANES_LEFT = 3,   /* only points that are left, and those of their branches behind them, have not run */
    VI_LANES_REFUSED = 4 /* the plan is none: sizes, or an instruction set that this machine has not */
};

/* Least room for rows. */
enum { VI_LANES_LEAST_ROOM = 4096 };

/* Bytes of memory that runs of this plan need; 0 for a plan that is refused. */
VI_DOOR size_t vi_door_lanes_memory(const vi_lanes_plan *plan);

/* Run what is left of the points. `memory` holds what is under way between two calls: all 0 before the first; afterwards
 * it goes with these points, whose arrays may be elsewhere by the next call. Returns one of VI_LANES_DONE to
 * VI_LANES_REFUSED. */
VI_DOOR int vi_door_lanes(const vi_lanes_plan *plan, vi_lanes_points *points, void *memory);

/* The instruction set that runs where this one is wanted: itself, or the best; 0 where the machine has it not. */
VI_DOOR int vi_door_lanes_instructions(int wanted);

#endif
