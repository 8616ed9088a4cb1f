/* One body stepped from sample to sample under a force that is held in between: the loop over a block of samples.
 *
 * The steps are those of an instance of the body's FMU, by the very calls that an importer makes for one of them, so that
 * the samples are the same bit for bit.
 */
#ifndef VIBROIMPACT_STEPPING_H
#define VIBROIMPACT_STEPPING_H

#include <stdint.h>

#include "door/door.h"
#include "door/runs.h"

/* Why vi_door_hold returns. */
enum {
    VI_HOLD_DONE = 0,    /* all samples are there */
    VI_HOLD_REFUSED = 1, /* the body has failed in the step to sample `at` */
    VI_HOLD_LIMIT = 2    /* the body has met its limit of impacts there */
};

typedef struct {
    uint32_t force, force_rate; /* inputs of the body */
    vi_runs_variables outputs;  /* read at each sample */
} vi_hold_plan;

/* A block of samples, and how far it is. */
typedef struct {
    int64_t count;
    const double *ends;   /* [count] s, ascending: where each sample is read */
    const double *forces; /* [count] N, held over the step to each sample */
    double *samples;      /* [count][outputs] */
    int64_t at;
    double time; /* the body has reached, s */
} vi_hold_block;

/* Take a block of samples. The body must not record: nobody takes rows away. Returns one of VI_HOLD_*. */
VI_DOOR int vi_door_hold(const vi_runs_fmu *fmu, const vi_hold_plan *plan, vi_hold_block *block);

#endif
