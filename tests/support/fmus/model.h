/* A model of these FMUs: a flat struct, and a function for a step. The adapters fmi2.c and fmi3.c do the rest; they are
 * compiled once for each model. */
#ifndef TEST_MODEL_H
#define TEST_MODEL_H

#include <stdbool.h>
#include <stddef.h>

enum { MODEL_VALUES = 20 };

/* Call in which an adapter is, as `fault_place` in the model descriptions of Faulty. */
typedef enum {
    AT_STEP,
    AT_INSTANTIATE,
    AT_ENTER_INITIALIZATION,
    AT_EXIT_INITIALIZATION,
    AT_RESET,
    AT_FREE,
    AT_GET,
    AT_SET,
    AT_SAVE,
    AT_RESTORE,
    AT_EVENT,
    PLACES
} occasion;

/* A state: copying it saves it. Integers and enumerations are stored as doubles too; a text by its number of bytes. */
typedef struct {
    double time;                /* s */
    double value[MODEL_VALUES]; /* by value reference; 0 is the time in FMI 3.0 and unused in FMI 2.0 */
    double reached;             /* what the last step says of its end, where its answer needs that, s */
    bool says_early;            /* STEP_SAYS: early return */
    bool early_allowed;         /* the importer handles event mode and early return */
    double tolerance;           /* relative, that the importer has given; 0: none */
    unsigned closed;            /* bits of the value references that may not be read or written now */
} model;

typedef enum {
    STEP_DONE,
    STEP_NEEDS_EVENT, /* done; FMI 3.0 asks for event mode */
    STEP_TERMINATES,  /* done; asks for the end of the simulation (FMI 2.0: discard, and terminated) */
    STEP_STALLS,      /* the time stays where it is (FMI 3.0: early return, FMI 2.0: discard) */
    STEP_DISCARDS,    /* half of the step is done, then discard */
    STEP_DISCARDS_MUTE, /* nothing is done; discard, and a false last successful time */
    STEP_SHORT,       /* done up to `reached` (FMI 3.0: early return, FMI 2.0: discard) */
    STEP_ENDS_SHORT,  /* as STEP_TERMINATES, at `reached` */
    STEP_EVENT_EARLY, /* FMI 3.0: the step has ended at `reached` and asks for event mode */
    STEP_SAYS,        /* done; says that it has ended at `reached` (FMI 2.0: with discard, and terminated) */
    STEP_SOLVER_BEHIND, /* done; the solver is at `reached`, which is what FMI 3.0 is told */
    STEP_PENDS, /* FMI 2.0: goes on by itself; FMI 3.0 has no such answer */
    STEP_FAILS,
    STEP_FATAL
} step_answer;

/* ---- each model has these ---- */

extern const bool model_has_state;      /* get, set and serialize state */
extern const bool model_has_event_mode; /* FMI 3.0 */
extern bool model_updates;              /* FMI 3.0: calls back within each step; false unless the model has it */

void model_start(model *m);
/* False: the parameters are refused. */
bool model_begin(model *m, void *instance);
/* At the begin of each call of the importer but doStep; any answer but STEP_DONE is the call's status. */
step_answer model_at(model *m, occasion where, void *instance);
/* Outputs from inputs and states; called before every get. */
void model_calculate(model *m);
/* Advance by `size` (s, > 0); the adapter moves the time. */
step_answer model_step(model *m, double size, void *instance);
/* One event iteration; true: another one is needed. */
bool model_update(model *m);

/* ---- each adapter has this ---- */

/* Log "<word> <number> <value>", as an error: in FMI 2.0 through the variadic logger. */
void say(void *instance, const char *word, int number, double value);

#endif
