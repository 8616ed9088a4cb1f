/* One body stepped from sample to sample under an input that is held, or linear: the loop over a block of samples.
 *
 * The steps use an instance of the body's FMU with the calls of an importer, so the samples are the same bit for bit.
 */
#ifndef VIBROIMPACT_STEPPING_H
#define VIBROIMPACT_STEPPING_H

#include <stdint.h>

#include "door/door.h"
#include "door/runs.h"
#include "measuring/magnet.h"

/* Reasons why vi_door_hold returns. */
enum {
    VI_HOLD_DONE = 0,    /* all samples are read */
    VI_HOLD_REFUSED = 1, /* the body failed in the step to sample `at` */
    VI_HOLD_LIMIT = 2,   /* the body reached its limit of impacts in this step */
    VI_HOLD_AGAIN = 3,   /* take the rows, handle signals, then call again to go on */
    VI_HOLD_TOUCHES = 4, /* the body touches its exciter at the start of the step to sample `at` */
    VI_HOLD_ENDS = 5     /* the body asked for the end of the simulation in this step */
};

typedef struct {
    uint32_t input, input_rate; /* of the body: a force, or the acceleration of its base, and its slope */
    vi_runs_variables outputs;  /* read at each sample */
    int32_t reads_begin;        /* outputs are read at the begin of each step, after its input is set */
    const vi_magnet *magnet;    /* turns voltages into forces; NULL: forces are given */
    uint32_t displacement;      /* of the body at the magnet */
    /* The body's record; row_capacity 0: no record. */
    uint32_t record_count, record_taken, record_rows;
    int32_t row_capacity;
} vi_hold_plan;

/* A block of samples and its progress. */
typedef struct {
    int64_t count;
    const double *ends;     /* [count] s, ascending: time of each sample */
    const double *inputs;   /* [count] N or m/s^2 at the begin of the step to each sample; V with a magnet */
    const double *rates;    /* [count] slope of the input over each step, N/s or m/s^3; NULL: the input is held */
    const uint8_t *renewed; /* [count] is the input set anew at the begin of the step to a sample? NULL: always */
    double *samples;        /* [count][outputs] */
    int64_t at;
    double time; /* reached by the body, s */
    int32_t begun; /* the input of the step to sample `at` is set */
    double *rows;  /* [rows_room][VI_RECORD_WIDTH]; rows_room >= row_capacity */
    int64_t rows_room, rows_used;
} vi_hold_block;

/* Run a block of samples, and take the rows recorded meanwhile; at the end all rows are in the block or have been
 * taken. A body must not record if its rows are never taken. Returns one of VI_HOLD_*. */
VI_DOOR int vi_door_hold(const vi_runs_fmu *fmu, const vi_hold_plan *plan, vi_hold_block *block);

#endif
