/* A step of coupled components on trial: one step, and two of half its size from the saved start (equations.md 6.19).
 *
 * The calls, their order and their sums are those of the importer's own trial, so that a run is the same bit for bit.
 */
#ifndef VIBROIMPACT_CHOSEN_STEP_H
#define VIBROIMPACT_CHOSEN_STEP_H

#include "door/coupling.h"

/* Compared variables, in the memory of the importer: `count` of them, with `units` different units. */
typedef struct {
    vi_coupling_component *trial;        /* the components, with other slots for the states of half steps */
    vi_coupling_calls moves, read;       /* all outputs to inputs; read the compared variables */
    vi_coupling_calls save_end, restore_end; /* the states at the end of the step */
    int32_t *at_event;                   /* [components] of a half step */
    double *kept_times;                  /* [components][2] */
    int32_t *kept_flags;                 /* [components] */
    int64_t count, units;
    const int64_t *unit;                 /* [count] */
    double *known, *since, *rounding;    /* [count] largest value, start of its motion (s), rounding */
    double *all_known;                   /* time from which all variables have a scale, s */
    double *largest;                     /* [units] */
    double *whole, *before, *halves;     /* [count] values at the end, the start and the end by halves */
    double window;                       /* s, in which a motion from 0 has no scale */
    double tolerance, share;             /* of a step; part of the error that the halves leave out */
    double rounding_part, steady, smallest;
    double shortest; /* s; up to this size an event in the first half counts as that of the step */
    double first_size;                   /* s; values that begin to move do not lengthen or shorten steps up to it */
    int64_t worst;                       /* variable with the largest error */
    double error; /* largest error over the tolerance, infinite where a half step met an event */
} vi_chosen_step;

/* Make a step from `start` to `target` of the run and estimate its error. Returns one of:
 * VI_COUPLING_REACHED: states are saved at its start, and the scales have the values of an accepted step;
 * VI_COUPLING_LISTEN: all are at its start again, and the importer must make the step;
 * VI_COUPLING_STEPPED or VI_COUPLING_FAILED: after a bad status. */
VI_DOOR int vi_door_chosen_step(const vi_coupling_plan *plan, vi_chosen_step *chosen, vi_coupling_progress *progress,
                                vi_coupling_run *run);

#endif
