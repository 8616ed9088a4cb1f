/* Instruction sets for which the lanes are compiled, and the sets that this machine has. */
#ifndef VIBROIMPACT_LANES_INSTRUCTIONS_H
#define VIBROIMPACT_LANES_INSTRUCTIONS_H

#include "lanes/lane_group.h"

/* The instruction set that runs when `set` is asked for: itself, or the best; 0 where the machine lacks it. */
int vi_lanes_instructions(int set);

/* The rounds compiled for an instruction set; NULL where the machine lacks it. */
vi_lanes_rounds vi_lanes_rounds_of(int set);

void vi_lanes_rounds_baseline(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points);
void vi_lanes_rounds_avx2(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points);
void vi_lanes_rounds_avx512(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points);

#endif
