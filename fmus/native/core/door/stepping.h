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
#include "measuring/magnet.h"

/* Why vi_door_hold returns. */
enum {
    VI_HOLD_DONE = 0,    /* all samples are there */
    VI_HOLD_REFUSED = 1, /* the body has failed in the step to sample `at` */
    VI_HOLD_LIMIT = 2,   /* the body has met its limit of impacts there */
    VI_HOLD_AGAIN = 3,   /* take the rows and listen, then call again to go on */
    VI_HOLD_TOUCHES = 4  /* the body touches its exciter where the step to sample `at` begins */
};

typedef struct {
    uint32_t force, force_rate; /* inputs of the body */
    vi_runs_variables outputs;  /* read at each sample */
    const vi_magnet *magnet;    /* makes forces of voltages; NULL: forces are given */
    uint32_t displacement;      /* of the body where the magnet acts */
    /* The body's record; row_capacity 0: it does not record. */
    uint32_t record_count, record_taken, record_rows;
    int32_t row_capacity;
} vi_hold_plan;

/* A block of samples, and how far it is. */
typedef struct {
    int64_t count;
    const double *ends;     /* [count] s, ascending: where each sample is read */
    const double *forces;   /* [count] N, held over the step to each sample; V of a magnet */
    const uint8_t *renewed; /* [count] the force is made anew where the step to a sample begins; NULL: of each */
    double *samples;        /* [count][outputs] */
    int64_t at;
    double time; /* the body has reached, s */
    int32_t begun; /* the force of the step to sample `at` is set */
    double *rows;  /* [rows_room][VI_RECORD_WIDTH]; rows_room >= row_capacity */
    int64_t rows_room, rows_used;
} vi_hold_block;

/* Take a block of samples, and the rows recorded meanwhile: at the end all of them are in the block, or have been. A body of
 * which no rows are taken must not record. Returns one of VI_HOLD_*. */
VI_DOOR int vi_door_hold(const vi_runs_fmu *fmu, const vi_hold_plan *plan, vi_hold_block *block);

#endif
