/* Bodies whose damping couples their modes: real modes, whose sum is the motion of the body. equations.md 2.6 */
#ifndef VIBROIMPACT_MANY_COUPLING_H
#define VIBROIMPACT_MANY_COUPLING_H

#include <stdbool.h>
#include <stddef.h>

#include "lanes/lane_group.h"

/* The rate z' = rate z + load of a complex mode. Its real and imaginary part are the real modes `first` and `first + 1`;
 * of a real rate only the first exists. */
typedef struct {
    double re, im; /* 1/s */
    int first;
} vi_lane_rate;

/* Bytes of the workspace `coupling` of a group. */
size_t vi_lane_coupling_size(void);

/* Find the real modes of a point's body. Those of modes that no damping couples come first, then those of the complex
 * modes. False where lockstep cannot follow them: nearly critical damping, or a coupled mode without a spring. */
bool vi_lane_couple(struct vi_lane_coupling *coupling, int modes, const vi_lanes_points *points, int64_t point);

/* Number of the mode that is real mode j by itself; -1: none is. */
int vi_lane_own_mode(const struct vi_lane_coupling *coupling, int j);

/* Set the complex modes, one rate each; returns their number. */
int vi_lane_rates(const struct vi_lane_coupling *coupling, vi_lane_rate rate[]);

/* Split displacements and velocities of the modes into those of all VI_REAL_MODES real modes, 0 for those unused. */
void vi_lane_split(const struct vi_lane_coupling *coupling, const double q[], const double p[], double real_q[],
                   double real_p[]);

/* Set the displacements of a mode for unit displacements of all VI_REAL_MODES real modes. */
void vi_lane_displacements(const struct vi_lane_coupling *coupling, int mode, double of[]);

#endif
