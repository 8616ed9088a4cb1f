/* A step of an FMU for model exchange, in the form of a co-simulation step: CVODE integrates between events.
 *
 * The functions of the FMU and of CVODE come as addresses, so that this library links neither. A step ends early at an
 * event; the importer then calls enter, update and leave, as for an FMU of FMI 3.0 with event mode. Each function
 * returns a status of FMI; where it is an error, `function` and `reason` explain it.
 */
#ifndef VIBROIMPACT_MODEL_EXCHANGE_H
#define VIBROIMPACT_MODEL_EXCHANGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "door/cvode.h"
#include "door/door.h"

/* Functions of the FMU. */
enum {
    VI_EXCHANGE_SET_TIME = 0,
    VI_EXCHANGE_SET_STATES = 1,
    VI_EXCHANGE_GET_STATES = 2,
    VI_EXCHANGE_DERIVATIVES = 3,
    VI_EXCHANGE_INDICATORS = 4,
    VI_EXCHANGE_NOMINALS = 5,
    VI_EXCHANGE_COMPLETED = 6,
    VI_EXCHANGE_ENTER_EVENT = 7,
    VI_EXCHANGE_UPDATE = 8,
    VI_EXCHANGE_ENTER_CONTINUOUS = 9,
    VI_EXCHANGE_SAVE = 10,
    VI_EXCHANGE_RESTORE = 11,
    VI_EXCHANGE_FREE = 12,
    VI_EXCHANGE_SET = 13, /* setting of inputs, by the functions of a vi_exchange_input */
    VI_EXCHANGE_FUNCTIONS = 14
};

/* Reasons of an error. */
enum {
    VI_EXCHANGE_STATUS = 0,     /* the function returned this status */
    VI_EXCHANGE_NOT_FINITE = 1, /* the function gave a number that is not finite */
    VI_EXCHANGE_SOLVER = 2,     /* CVODE returned `solver_flag` */
    VI_EXCHANGE_STEPS = 3,      /* most_steps steps of CVODE did not reach the end */
    VI_EXCHANGE_TIME = 4,       /* the step does not begin at the time of the FMU */
    VI_EXCHANGE_ENDLESS = 5,    /* event iterations for a discrete input do not end */
    VI_EXCHANGE_SHORT = 6       /* steps of CVODE became shorter than the rounding of time */
};

typedef union {
    void *address;
    int (*plain)(void *);
    int (*set_time)(void *, double);
    int (*set_numbers)(void *, const double[], size_t);
    int (*get_numbers)(void *, double[], size_t);
    int (*completed3)(void *, bool, bool *, bool *);
    int (*completed2)(void *, int, int *, int *);
    int (*update3)(void *, bool *, bool *, bool *, bool *, bool *, double *);
    int (*update2)(void *, void *);
    int (*save)(void *, void **);
    int (*restore)(void *, void *);
} vi_exchange_function;

/* An FMU with its solver. Buffers belong to the caller; numbers from `time` on to the functions below. */
typedef struct {
    void *fmu;
    const vi_cvode *cvode;
    vi_exchange_function calls[VI_EXCHANGE_FUNCTIONS];
    volatile int64_t *noted_call;            /* number of the present call; NULL: not wanted */
    int64_t numbers[VI_EXCHANGE_FUNCTIONS];  /* number noted before a call of each function */
    double *states, *kept, *absolute;        /* [state_count or 1] states; a copy; absolute tolerances */
    double *indicators, *compared;           /* [indicator_count] event indicators */
    int64_t state_count, indicator_count;
    int64_t most_steps;                      /* of CVODE in one step */
    int32_t most_iterations;                 /* event iterations at one instant */
    int32_t version;                         /* 2 or 3, of FMI */
    int32_t needs_completed;                 /* the FMU wants to hear of each completed step */
    int32_t restorable;                      /* an earlier state may be restored */
    double tolerance;                        /* relative */

    double time, next_event; /* s; next_event may be infinite */
    void *context, *solver, *vector, *tolerances, *matrix, *linear;
    int32_t has_begun, in_event_mode, ends, begins_anew, inputs_changed, nominals_changed;
    int32_t function, reason, solver_flag; /* of the last error */
    int32_t cause;   /* function at whose answer CVODE took a shorter step; -1: none */
    int32_t failure; /* status of the FMU at which CVODE gave up */
    int64_t derivative_calls, solver_steps;
} vi_exchange;

/* Begin a run at `time` (s): the FMU has left initialization mode. */
VI_DOOR int vi_door_exchange_begin(vi_exchange *exchange, double time);
/* Free the solver. */
VI_DOOR void vi_door_exchange_end(vi_exchange *exchange);
/* Advance as fmi3DoStep does. */
VI_DOOR int vi_door_exchange_step(vi_exchange *exchange, double time, double size, bool no_state_prior, bool *event,
                                  bool *ends, bool *early, double *last_time);
/* Event mode, in the forms of FMI 3.0. */
VI_DOOR int vi_door_exchange_enter(vi_exchange *exchange);
VI_DOOR int vi_door_exchange_update(vi_exchange *exchange, bool *again, bool *ends, bool *nominals, bool *values,
                                    bool *has_next, double *next);
VI_DOOR int vi_door_exchange_leave(vi_exchange *exchange);
/* States by value: the FMU's own, and the solver's. */
VI_DOOR int vi_door_exchange_save(vi_exchange *exchange, void **slot);
VI_DOOR int vi_door_exchange_restore(vi_exchange *exchange, void *slot);
VI_DOOR int vi_door_exchange_free(vi_exchange *exchange, void **slot);

#endif
