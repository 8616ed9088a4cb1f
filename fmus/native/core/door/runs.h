/* Many runs of one body, one after the other: the loop over the points of a chunk.
 *
 * The runs are those of an instance of the body's FMU, by the very calls that an importer makes for one of them, so that
 * their rows are the same bit for bit. What is done with a run that the body refuses, or has something to say of, is the
 * importer's: the loop stops there.
 */
#ifndef VIBROIMPACT_RUNS_H
#define VIBROIMPACT_RUNS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "door/door.h"
#include "door/log_ring.h"

/* Why vi_door_runs returns. */
enum {
    VI_RUNS_DONE = 0,    /* all points have run */
    VI_RUNS_LISTEN = 1,  /* it has taken as long as it was to; call again to go on */
    VI_RUNS_FULL = 2,    /* the rows need more room: take them, then call again */
    VI_RUNS_REFUSED = 3  /* the point `at` is for the importer: it failed, or its body has logged something */
};

/* How a run ended; 0 and 1 as `analysis/dataset/schema.py` has them. */
enum { VI_RUN_ENDED = 0, VI_RUN_IMPACT_LIMIT = 2, VI_RUN_TIMEOUT = 5 };

/* The functions of FMI 3.0 that are called, of one instance. */
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

/* What all points have in common. */
typedef struct {
    vi_runs_variables parameters, integers, booleans; /* set before initialization */
    const int64_t *integer_values;
    const bool *boolean_values;
    vi_runs_variables switches; /* of the record, set when recording begins */
    const bool *switch_values;
    vi_runs_variables finals, flags; /* read at the end */
    uint32_t record_count, record_taken, record_rows;
    int32_t row_capacity; /* of the body's record */
    /* A run of a branch starts from the state where the one before ended: the places of displacement, velocity and phase
     * among the parameters. What lies beyond stop k, which has moved, is put on it, at rest. */
    int32_t chained, displacement, velocity, phase, stops;
    const int32_t *stop_position; /* [stops] among the parameters */
    const double *stop_direction; /* [stops] +1 for a stop above the motion, -1 below, 0 for one that yields */
} vi_runs_plan;

/* The points, and how far they are. Arrays are [point] or [point][...]. */
typedef struct {
    int64_t count;
    double *values;             /* [point][parameters] */
    const double *begin, *end;  /* of the recording, s */
    const uint8_t *first;       /* a branch begins here */
    int8_t *outcome;
    double *reached, *seconds, *finals;
    bool *flags;
    int64_t *rows_of; /* rows of each */
    double *rows;     /* [rows_room][VI_RECORD_WIDTH] */
    int64_t rows_room, rows_used;
    double carried[2]; /* where the next run of the branch starts */
    int32_t has_carried;
    int32_t give_up;  /* the point under way has taken long enough */
    double most_seconds; /* of one call; it is heard between two points and where a step ends early */
    int64_t at;       /* the point under way */
    int32_t stage;    /* of it: 0 not begun, 1 before the recording, 2 in it, 3 at its end */
    double time;      /* it has reached, s */
    double spent;     /* on it, s */
} vi_runs_points;

/* Run what is left of the points. Returns one of VI_RUNS_*. */
VI_DOOR int vi_door_runs(const vi_runs_fmu *fmu, const vi_runs_plan *plan, vi_runs_points *points);

#endif
