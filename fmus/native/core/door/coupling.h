/* Coupled components between two moments that are an importer's: the loop over their steps and events.
 *
 * The calls are those of the importer's own loop, in its order and with its buffers, so that a run is the same bit for bit.
 * The loop returns wherever anything but a step, an event that settles, or a step repeated to an earlier event is to be
 * done; the importer does that and calls again.
 */
#ifndef VIBROIMPACT_COUPLING_H
#define VIBROIMPACT_COUPLING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "door/door.h"

/* Why vi_door_coupling returns. */
enum {
    VI_COUPLING_DONE = 0,    /* the end is reached, or a component asks for it */
    VI_COUPLING_LISTEN = 1,  /* it has taken as long as it was to, or the grid is finer than rounding */
    VI_COUPLING_STEPPED = 2, /* component `at` has made its step, which returned `status`: the importer's to judge */
    VI_COUPLING_REACHED = 3, /* all components are at the end of a step, which is the importer's to finish */
    VI_COUPLING_FAILED = 4,  /* call `at` returned `status` */
    VI_COUPLING_ENDLESS = 5, /* the events at this time do not settle */
    VI_COUPLING_CUT = 6      /* component `at` takes steps of another size than that to `goal` */
};

/* What a call is. */
enum {
    VI_CALL_PLAIN = 0,   /* of the instance alone */
    VI_CALL_MOVE3 = 1,   /* a read or a write, FMI 3.0 */
    VI_CALL_MOVE2 = 2,   /* the same, FMI 2.0 */
    VI_CALL_UPDATE = 3,  /* fmi3UpdateDiscreteStates; `values` are the decisions */
    VI_CALL_SCALE = 4,   /* no call: values = from * gains */
    VI_CALL_SAVE = 5,    /* of the state, into the slot `values` */
    VI_CALL_RESTORE = 6, /* of the state in it */
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
    const uint32_t *references; /* [count] of variables */
    size_t count;
    void *values; /* [value_count] */
    size_t value_count;
    const double *from, *gains; /* [value_count] */
    int64_t note;               /* what is noted before the call */
    int32_t kind, place;        /* one of VI_CALL_*; its number for the importer */
} vi_coupling_call;

typedef struct {
    const vi_coupling_call *calls;
    size_t count;
} vi_coupling_calls;

typedef struct {
    vi_coupling_call step;
    vi_coupling_calls inputs;       /* before its step */
    vi_coupling_calls save, restore; /* none where it has no states */
    vi_coupling_calls event_times;  /* FMI 2.0: one read, where it reports its first event */
    int32_t event_mode, may_return_early;
    int32_t number; /* by which its events are told */
    double internal_step; /* s */
    double only_step;     /* the one size of its steps, s; 0: any */
    /* What its step is given and answers, in the memory of the importer's instance; `flags` are those of FMI 3.0: needs
     * event mode, ends, has returned early. */
    double *step_time, *step_size, *last_time;
    unsigned char *flags;
    double time; /* its last step has reached, s */
} vi_coupling_component;

/* What is done in all runs. */
typedef struct {
    vi_coupling_component *components; /* in the order in which they are stepped */
    int32_t count;
    int32_t saves;                         /* a step may have to be repeated */
    vi_coupling_calls start;               /* before a step */
    vi_coupling_calls begin, again, leave; /* of event mode */
    const unsigned char *const *decisions; /* [deciding] of event mode: another iteration, the end */
    int32_t deciding, most_iterations;
    int32_t no_state_prior; /* noSetFMUStatePriorToCurrentPoint of every step */
    double same_instant, time_rounding, step_rounding; /* the importer's tolerances */
    volatile int64_t *noted_call; /* the call under way is noted there */
    volatile double *noted_time;  /* and the start of a step */
} vi_coupling_plan;

/* How far a run is; the importer's own. Times in s. */
typedef struct {
    double time, grid_start, next_point, event_time;
    int64_t grid_index, event_index, standstill, steps, repeated_steps;
} vi_coupling_progress;

/* One call of the loop. */
typedef struct {
    double end, macro_step;  /* s */
    double most_seconds;     /* of wall time */
    double *events;          /* [events_room][3] time, index, number of the component; NULL: nobody hears of them */
    int64_t events_room, events_used;
    int32_t hears_pauses;    /* a step that ends early without an event is the importer's to finish */
    int32_t wants_to_end;    /* a component asks for the end */
    /* The step under way: its start and end, the end that is tried at present, and where all have come to. */
    double start, target, goal, reached;
    int32_t *at_event; /* [components] those whose event ends it, `arrived` of them */
    int32_t arrived, at, status;
} vi_coupling_run;

/* Advance to `end`. Returns one of VI_COUPLING_*. */
VI_DOOR int vi_door_coupling(const vi_coupling_plan *plan, vi_coupling_progress *progress, vi_coupling_run *run);

#endif
