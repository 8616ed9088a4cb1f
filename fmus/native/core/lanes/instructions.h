/* The instruction sets that the lanes are compiled for, and which of them this machine has. */
#ifndef VIBROIMPACT_LANES_INSTRUCTIONS_H
#define VIBROIMPACT_LANES_INSTRUCTIONS_H

#include "lanes/lane_group.h"

/* The set that runs where this one is wanted: itself, or the best; 0 where the machine has it not. */
int vi_lanes_instructions(int wanted);

/* The rounds compiled for it; NULL where the machine has it not. */
vi_lanes_rounds vi_lanes_rounds_of(int wanted);

void vi_lanes_rounds_baseline(vi_lane_group *group, int modes, int contacts);
void vi_lanes_rounds_avx2(vi_lane_group *group, int modes, int contacts);
void vi_lanes_rounds_avx512(vi_lane_group *group, int modes, int contacts);

#endif
