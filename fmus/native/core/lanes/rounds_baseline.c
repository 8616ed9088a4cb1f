/* The lockstep for the instructions of every machine: SSE2, or NEON. */
#define VI_WIDTH 2
#define VI_ROUNDS vi_lanes_rounds_baseline
#include "lanes/instructions.h"
#include "lanes/rounds_many.h"
