/* Many runs of one body, one after the other: the loop over the points of a chunk.
 *
 * The runs use an instance of the body's FMU with the calls of an importer, so that their rows are the same bit for
 * bit. The loop stops at a run that the body refuses or logs a message about; the importer then acts.
 */
#ifndef VIBROIMPACT_RUNS_H
#define VIBROIMPACT_RUNS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "door/door.h"
#include "door/log_ring.h"

/* Reasons why vi_door_runs returns. */
enum {
    VI_RUNS_DONE = 0,    /* all points have run */
    VI_RUNS_LISTEN = 1,  /* most_seconds are over; call again to go on */
    VI_RUNS_FULL = 2,    /* the rows need more room: take them, then call again */
    VI_RUNS_REFUSED = 3  /* the importer must treat point `at`: it failed, or its body logged a message */
};

/* End of a run; 0 and 1 are numbers of `analysis/dataset/schema.py`. */
enum { VI_RUN_ENDED = 0, VI_RUN_IMPACT_LIMIT = 2, VI_RUN_TIMEOUT = 5 };

/* The functions of FMI 3.0 that the loop calls, for one instance. */
typedef struct {
    void *instance;
    int (*reset)(void *);
    int (*enter_initialization)(void *, bool, double, double, bool, double);
    int (*exit_initialization)(void *);
    int (*step)(void *, double, double, bool, bool *, bool *, bool *, double *);
    int (*set_float64)(void *, const uint32_t[], size_t, const double[], size_t);
    int (*get_float64)(void *, const uint32_t[], size_t, double[], size_t);
    int (*set_int64)(void *, const uint32_t[], size_t, const int64_t[], size_t);
    int (*get_int64)(void *, const uint32_t[], size_t, int64_t[], size_t);
    int (*set_boolean)(void *, const uint32_t[], size_t, const bool[], size_t);
    int (*get_boolean)(void *, const uint32_t[], size_t, bool[], size_t);
    const vi_log_ring *log;
} vi_runs_fmu;

/* Variables of one type by their value references. */
typedef struct {
    const uint32_t *references;
    size_t count;
} vi_runs_variables;

/* Everything that all points share. */
typedef struct {
    vi_runs_variables parameters, integers, booleans; /* set before initialization; parameters may be arrays */
    int32_t columns;       /* numbers of a point: elements of the parameters */
    const int32_t *places; /* [columns] of each among the elements of all parameters */
    double *elements;      /* [size] of all parameters, as they are set; those of no place keep their values */
    size_t size;
    const int64_t *integer_values;
    const bool *boolean_values;
    vi_runs_variables switches; /* of the record, set when recording begins */
    const bool *switch_values;
    vi_runs_variables finals, flags; /* read at the end */
    size_t finals_size;              /* elements of the finals: arrays come last */
    uint32_t record_count, record_taken, record_rows;
    int32_t row_capacity; /* of the body's record */
    /* A run of a branch starts from the final state of the previous run: places of displacement, velocity and phase
     * among the parameters. A body beyond stop k, which has moved, starts on it at rest. */
    int32_t chained, displacement, velocity, phase, stops;
    const int32_t *stop_position; /* [stops] places among the parameters */
    const double *stop_direction; /* [stops] +1 for a stop above the motion, -1 below, 0 for a stop that yields */
} vi_runs_plan;

/* The points and their progress. Arrays are [point] or [point][...]. */
typedef struct {
    int64_t count;
    double *values;             /* [point][parameters] */
    const double *begin, *end;  /* of the recording, s */
    const uint8_t *first;       /* a branch begins here */
    int8_t *outcome;
    double *reached, *seconds, *finals;
    bool *flags;
    int64_t *rows_of; /* number of rows of each point */
    double *rows;     /* [rows_room][VI_RECORD_WIDTH] */
    int64_t rows_room, rows_used;
    double carried[2]; /* start state of the branch's next run */
    int32_t has_carried;
    int32_t give_up;  /* the present point has taken too long */
    double most_seconds; /* of one call; checked between points and where a step ends early */
    int64_t at;       /* the present point */
    int32_t stage;    /* of this point: 0 not begun, 1 before the recording, 2 in the recording, 3 at its end */
    double time;      /* time reached by the point, s */
    double spent;     /* wall time spent on the point, s */
} vi_runs_points;

/* Run the remaining points. Returns one of VI_RUNS_*. */
VI_DOOR int vi_door_runs(const vi_runs_fmu *fmu, const vi_runs_plan *plan, vi_runs_points *points);

#endif
