/* An FMU for model exchange with its solver, and the calls of its functions. */
#ifndef VIBROIMPACT_MODEL_EXCHANGE_CALLS_H
#define VIBROIMPACT_MODEL_EXCHANGE_CALLS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "contact/contact_law.h"
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
    VI_EXCHANGE_GET = 14, /* reading of watched variables */
    VI_EXCHANGE_SET_FORCES = 15, /* setting of the force inputs on which stops act */
    VI_EXCHANGE_FUNCTIONS = 16
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
    int (*get3)(void *, const uint32_t[], size_t, double[], size_t);
    int (*get2)(void *, const uint32_t[], size_t, double[]);
    int (*put3)(void *, const uint32_t[], size_t, const double[], size_t);
    int (*put2)(void *, const uint32_t[], size_t, const double[]);
    int (*save)(void *, void **);
    int (*restore)(void *, void *);
} vi_exchange_function;

/* A watched point of an FMU: a contact point and a surface that stands still, or a variable and its level.
 *
 * The distance is factor * value + offset. A step ends where the distance of an armed watch falls to its level. For a
 * contact, the level is 0, or below the start of a step that begins nearer than `room`. */
typedef struct {
    double factor, offset, room, level;
    double start, start_rate, end,
        end_rate; /* distance of a contact point, m, and its rate, at the ends of a step of CVODE */
    int32_t value, rate; /* places among the watched variables; rate: velocity of a contact point, -1 of a variable */
    int32_t direction;   /* of a variable's crossing: -1 falling, 1 rising, 0 either; a contact has -1 */
    int32_t is_armed;
    int32_t is_pressed; /* a stop that yields presses the body, from the meeting until its force has fallen to 0 */
    int32_t was_pressed; /* at the start of the last step, and so within it */
    int32_t force;       /* place of its force input */
    vi_contact_law law; /* of a stop that yields */
    double impulse, largest; /* N s of all steps of the run; largest force of the last step, N */
} vi_exchange_watch;

/* An FMU with its solver. Buffers belong to the caller; numbers from `time` on to the functions below. */
typedef struct {
    void *fmu;
    const vi_cvode *cvode;
    vi_exchange_function calls[VI_EXCHANGE_FUNCTIONS];
    volatile int64_t *noted_call;            /* number of the present call; NULL: not wanted */
    int64_t numbers[VI_EXCHANGE_FUNCTIONS];  /* number noted before a call of each function */
    double *states, *kept, *absolute;        /* [state_count or 1] states; a copy; absolute tolerances */
    double *indicators, *compared;           /* [indicator_count] event indicators */
    vi_exchange_watch *watches;              /* [watch_count] */
    const uint32_t *watched;                 /* [watched_count] value references */
    double *values;                          /* [watched_count] */
    int *roots, *directions;                 /* [indicator_count + watch_count] functions whose roots end steps */
    const uint32_t *forces;                  /* [force_count] value references of force inputs */
    double *given;                           /* [force_count] N */
    double *point;                           /* [state_count or 1] states between two steps of CVODE */
    const double *instants;                  /* [instant_count] ascending, s: a step keeps the states there */
    double *samples;                         /* [instant_count][state_count] */
    int64_t state_count, indicator_count;
    int64_t most_steps;                      /* of CVODE in one step */
    int64_t watch_count, watched_count, force_count, instant_count;
    int64_t sample_count;                    /* instants that the last step has kept */
    int32_t most_iterations;                 /* event iterations at one instant */
    int32_t version;                         /* 2 or 3, of FMI */
    int32_t needs_completed;                 /* the FMU wants to hear of each completed step */
    int32_t restorable;                      /* an earlier state may be restored */
    double tolerance;                        /* relative */

    double time, next_event; /* s; next_event may be infinite */
    void *context, *solver, *vector, *matrix, *linear, *point_vector;
    int32_t has_begun, in_event_mode, ends, begins_anew, inputs_changed, nominals_changed;
    int32_t gives_forces; /* some force input is not 0 */
    int32_t meets; /* the last step has ended where a contact point meets its surface */
    int32_t function, reason, solver_flag; /* of the last error */
    int32_t cause;   /* function at whose answer CVODE took a shorter step; -1: none */
    int32_t failure; /* status of the FMU at which CVODE gave up */
    int64_t derivative_calls, solver_steps;
    int64_t first_step; /* solver_steps where the solver has begun anew */
} vi_exchange;

/* Statuses of FMI. */
enum { VI_EXCHANGE_OK = 0, VI_EXCHANGE_WARNING = 1, VI_EXCHANGE_DISCARD = 2, VI_EXCHANGE_ERROR = 3 };

/* Note the call of a function that begins, and return the function. */
vi_exchange_function vi_exchange_begin_call(const vi_exchange *exchange, int function);
/* Return 0 after a good call, else its status, with `function` and `reason` of the error. */
int vi_exchange_judged(vi_exchange *exchange, int function, int status);
/* Return the status of an error for this reason. */
int vi_exchange_refused(vi_exchange *exchange, int function, int reason);
/* Make a call without further arguments, or one that gives `count` numbers. */
int vi_exchange_call(vi_exchange *exchange, int function);
int vi_exchange_get_numbers(vi_exchange *exchange, int function, double numbers[], int64_t count);
/* Read the watched variables at the present point of the FMU. */
int vi_exchange_read_watched(vi_exchange *exchange);
/* Put the states that CVODE's last step passed at `time` into `point`. */
int vi_exchange_move_point(vi_exchange *exchange, double time);
/* Let the FMU have these states at `time`, in continuous-time mode, with its present inputs. */
int vi_exchange_set_point(vi_exchange *exchange, double time, const double states[]);

#endif
