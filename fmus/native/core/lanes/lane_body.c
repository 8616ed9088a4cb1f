#include "lanes/lane_body.h"

#include <math.h>

bool vi_lane_is_contact(const vi_lanes_points *p, int64_t i)
{
    return fabs(p->direction[i]) == 1.0 && isfinite(p->position[i]) && p->restitution[i] >= 0.0
           && p->restitution[i] <= 1.0 && p->yield_velocity[i] >= 0.0 && isfinite(p->yield_velocity[i]);
}
