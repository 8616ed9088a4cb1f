#include "lanes/lane_turn.h"

#define VI_WIDTH 1
#include "lanes/vector.h"

void vi_lane_turn(double angle, double *cosine, double *sine)
{
    vector c, s;
    turn(all(angle), &c, &s);
    *cosine = c[0];
    *sine = s[0];
}
