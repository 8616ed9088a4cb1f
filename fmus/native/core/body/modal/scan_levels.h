/* Lengths of a scan's steps, each twice the one before, with the propagators of modes and sines over them.
 *
 * Propagators are made when a length is first used, and kept until the modes or the sines change.
 */
#ifndef VIBROIMPACT_SCAN_LEVELS_H
#define VIBROIMPACT_SCAN_LEVELS_H

#include "body/modal/state.h"

enum { VI_SCAN_SAMPLES = 8, VI_SCAN_LEVELS = 16 }; /* samples of a block; lengths of steps */

/* Propagators over 1 to VI_SCAN_SAMPLES steps of one length. */
typedef struct {
    double step;                                             /* s; 0: the propagators are not made yet */
    double cosine[VI_SCAN_SAMPLES], sine[VI_SCAN_SAMPLES];   /* of the turn of the clock's phase */
    double further_cosine[VI_SINES_ROOM][VI_SCAN_SAMPLES], further_sine[VI_SINES_ROOM][VI_SCAN_SAMPLES];
    double x_of_x[VI_MODES][VI_SCAN_SAMPLES], x_of_v[VI_MODES][VI_SCAN_SAMPLES];
    double v_of_x[VI_MODES][VI_SCAN_SAMPLES], v_of_v[VI_MODES][VI_SCAN_SAMPLES];
} vi_scan_level;

/* Cache, no part of a body's state: its contents follow from the modes. */
struct vi_scan {
    int32_t modes;
    double angular_frequency, stiffness[VI_MODES], decay[VI_MODES]; /* of the modes for which it was made */
    int32_t sines;                                                  /* further sines, and their frequencies */
    double further[VI_SINES_ROOM];
    double shortest;                                                /* step of the level 0, s */
    int32_t finer; /* levels by which sines that are faster than the modes shorten the shortest step */
    vi_scan_level level[VI_SCAN_LEVELS];                            /* each with twice the step of the level before */
};

/* Forget the propagators of other modes or sines. */
void vi_scan_renew(vi_scan *scan, const vi_structure_model *model);

/* The level l, with its propagators. */
const vi_scan_level *vi_scan_level_of(vi_scan *scan, const vi_structure_model *model, int l);

/* Step of the level l, s. The shortest has at most 0.05 radians of the fastest rate. */
static inline double vi_scan_step(const vi_scan *scan, int l)
{
    return scan->shortest * (double)(1 << l);
}

#endif
