/* The further sines of one lane, with the bits of the lockstep. */
#ifndef VIBROIMPACT_LANE_SINES_H
#define VIBROIMPACT_LANE_SINES_H

#include <stdbool.h>

#include "lanes/lane_group.h"
#include "motion/clock.h"

/* Set the phases of a point's further sines by its clock. False where they are invalid, or the `last` period is beyond
 * VI_MOST_TURNS. */
bool vi_lane_take_sines(vi_lane_group *group, int lane, const vi_lanes_points *points, int64_t point,
                        const vi_clock *clock, int64_t last);

/* Cosines and sines of the phases of the further sines of a lane. */
typedef struct {
    double of[VI_FURTHER_SINES][VI_SINE_PARTS];
} vi_lane_phases;

/* The phases at an instant. */
vi_lane_phases vi_lane_phases_at(const vi_lane_group *group, int lane, double periods, double rest);

/* Set the modes of the further sines, after the `own` modes of a body, by the lane's clock. */
void vi_lane_set_sines(vi_lane_group *group, int lane, int own);

/* The value of a table's row with the shares of `further` sines. */
static inline double vi_lane_add_sines(double value, const vi_lane_array row[][VI_SINE_PARTS], int lane, int further,
                                       const vi_lane_phases *phases)
{
    for (int k = 0; k < further; ++k) {
        value += row[k][VI_OF_ITS_COSINE][lane] * phases->of[k][VI_OF_ITS_COSINE]
                 + row[k][VI_OF_ITS_SINE][lane] * phases->of[k][VI_OF_ITS_SINE];
    }
    return value;
}

#endif
