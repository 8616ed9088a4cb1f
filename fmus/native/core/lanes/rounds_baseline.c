/* The lockstep for what every machine of its kind has: SSE2, or NEON. */
#define VI_WIDTH 2
#define VI_ROUNDS vi_lanes_rounds_baseline
#include "lanes/instructions.h"
#include "lanes/rounds_many.h"
