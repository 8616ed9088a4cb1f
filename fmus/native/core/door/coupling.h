/* The loop over the steps and events of coupled components, as long as the importer need not act.
 *
 * The calls, their order and their buffers are those of the importer's own loop, so that a run is the same bit for bit.
 * The loop handles steps, events that settle, and steps repeated to an earlier event. For anything else it returns; the
 * importer acts and calls again.
 */
#ifndef VIBROIMPACT_COUPLING_H
#define VIBROIMPACT_COUPLING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "door/door.h"

/* Reasons why vi_door_coupling returns. */
enum {
    VI_COUPLING_DONE = 0,    /* the end is reached, or a component asks for the end */
    VI_COUPLING_LISTEN = 1,  /* most_seconds are over, or the grid is finer than rounding */
    VI_COUPLING_STEPPED = 2, /* component `at` has made its step with `status`; the importer judges it */
    VI_COUPLING_REACHED = 3, /* all components are at the end of a step; the importer finishes it */
    VI_COUPLING_FAILED = 4,  /* call `at` returned `status` */
    VI_COUPLING_ENDLESS = 5, /* the events at this time do not settle */
    VI_COUPLING_CUT = 6      /* component `at` cannot step to `goal` with its only step size */
};

/* Kinds of calls. */
enum {
    VI_CALL_PLAIN = 0,   /* with the instance alone */
    VI_CALL_MOVE3 = 1,   /* a read or a write, FMI 3.0 */
    VI_CALL_MOVE2 = 2,   /* a read or a write, FMI 2.0 */
    VI_CALL_UPDATE = 3,  /* fmi3UpdateDiscreteStates; `values` are the decisions */
    VI_CALL_SCALE = 4,   /* no call: values = from * gains + offsets */
    VI_CALL_SAVE = 5,    /* save the state into the slot `values` */
    VI_CALL_RESTORE = 6, /* restore the state from it */
    VI_CALL_STEP3 = 7,
    VI_CALL_STEP2 = 8
};

typedef union {
    int (*plain)(void *);
    int (*move3)(void *, const uint32_t[], size_t, void *, size_t);
    int (*move2)(void *, const uint32_t[], size_t, void *);
    int (*update)(void *, bool *, bool *, bool *, bool *, bool *, double *);
    int (*save)(void *, void **);
    int (*restore)(void *, void *);
    int (*step3)(void *, double, double, bool, bool *, bool *, bool *, double *);
    int (*step2)(void *, double, double, int);
} vi_coupling_function;

typedef struct {
    vi_coupling_function function;
    void *instance;
    const uint32_t *references; /* [count] value references */
    size_t count;
    void *values; /* [value_count] */
    size_t value_count;
    const double *from, *gains, *offsets; /* [value_count]; without offsets NULL */
    int64_t note;               /* number noted before the call */
    int32_t kind, place;        /* one of VI_CALL_*; the importer's number of the call */
} vi_coupling_call;

typedef struct {
    const vi_coupling_call *calls;
    size_t count;
} vi_coupling_calls;

typedef struct {
    vi_coupling_call step;
    vi_coupling_calls inputs;       /* before each step */
    vi_coupling_calls save, restore; /* empty without saved states */
    vi_coupling_calls event_times;  /* FMI 2.0: one read, if it reports its first event */
    int32_t event_mode, may_return_early;
    int32_t number; /* its number in `events` */
    double internal_step; /* s */
    double only_step;     /* its only step size, s; 0: any size */
    /* Arguments and results of its step, in the memory of the importer's instance. `flags` are those of FMI 3.0: needs
     * event mode, ends, has returned early. */
    double *step_time, *step_size, *last_time;
    unsigned char *flags;
    double time; /* end of its last step, s */
} vi_coupling_component;

/* Everything that all runs share. */
typedef struct {
    vi_coupling_component *components; /* in the order of their steps */
    int32_t count;
    int32_t saves;                         /* a step may have to be repeated */
    vi_coupling_calls start;               /* before a step */
    vi_coupling_calls begin, again, leave; /* of event mode */
    const unsigned char *const *decisions; /* [deciding] of event mode: another iteration, the end */
    int32_t deciding, most_iterations;
    int32_t no_state_prior; /* noSetFMUStatePriorToCurrentPoint of every step */
    double same_instant, time_rounding, step_rounding; /* the importer's tolerances */
    volatile int64_t *noted_call; /* number of the present call */
    volatile double *noted_time;  /* start of the present step */
} vi_coupling_plan;

/* Progress of a run, owned by the importer. Times in s. */
typedef struct {
    double time, grid_start, next_point, event_time;
    int64_t grid_index, event_index, standstill, steps, repeated_steps;
} vi_coupling_progress;

/* One call of the loop. */
typedef struct {
    double end, macro_step;  /* s */
    double most_seconds;     /* of wall time */
    double *events;          /* [events_room][3] time, index, number of the component; NULL: not wanted */
    int64_t events_room, events_used;
    int32_t hears_pauses;    /* the importer finishes a step that ends early without an event */
    int32_t wants_to_end;    /* a component asks for the end */
    /* The present step: its start and end, the end tried now, and the time reached by all components. */
    double start, target, goal, reached;
    int32_t *at_event; /* [components] those whose event ends the step; `arrived` of them */
    int32_t arrived, at, status;
} vi_coupling_run;

/* Advance to `end`. Returns one of VI_COUPLING_*. */
VI_DOOR int vi_door_coupling(const vi_coupling_plan *plan, vi_coupling_progress *progress, vi_coupling_run *run);

/* ---- parts of a step, for steps on trial ---- */

/* Result of a part that went well. */
enum { VI_COUPLING_GO_ON = -1 };

/* Make calls; VI_COUPLING_FAILED with their place and status in the run. */
int vi_coupling_make(const vi_coupling_plan *plan, vi_coupling_run *r, const vi_coupling_calls *calls);

/* Save the states of all components, or restore the saved ones. */
int vi_coupling_save(const vi_coupling_plan *plan, vi_coupling_run *r);
int vi_coupling_restore(const vi_coupling_plan *plan, vi_coupling_run *r);

/* Step all components from `start` to `target`, or to the first event of any; `reached` is the end. */
int vi_coupling_step(const vi_coupling_plan *plan, vi_coupling_progress *p, vi_coupling_run *r);

#endif
