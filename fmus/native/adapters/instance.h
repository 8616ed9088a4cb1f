/* Instances, for both versions of FMI: their mode, their variables, their steps. */
#ifndef VIBROIMPACT_INSTANCE_H
#define VIBROIMPACT_INSTANCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "component.h"
#include "resources.h"

typedef enum {
    VI_MODE_INSTANTIATED = 1,
    VI_MODE_INITIALIZATION = 2,
    VI_MODE_STEP = 4,
    VI_MODE_EVENT = 8,
    VI_MODE_TERMINATED = 16,
    VI_MODE_FAILED = 32,
    VI_MODE_CONTINUOUS = 64,
    VI_MODE_CONFIGURATION = 128
} vi_mode_of_use;

enum {
    VI_ANY_MODE = 255,
    VI_BEFORE_START = VI_MODE_INSTANTIATED | VI_MODE_INITIALIZATION,
    VI_RUNNING = VI_MODE_STEP | VI_MODE_EVENT | VI_MODE_CONTINUOUS
};

typedef struct vi_instance vi_instance;

/* References of the last derivative, ordered by the arrays of their variables. `place` has the order. `run` counts, from
 * each place of the order on, variables that follow each other in one array. All are in the memory of `references`. */
typedef struct {
    uint32_t *references, *place, *run, *head;
    size_t count, room;
} vi_order;

struct vi_instance {
    void *self;            /* the component's struct, with its record */
    vi_mode_of_use mode;
    bool outputs_stale;    /* an input was set since the outputs were computed */
    bool event_mode_used, early_return_allowed, logging;
    bool exchange;         /* made for model exchange: the importer integrates the component */
    bool structural;       /* the description has the numbers of blocks as structural parameters */
    bool wants_to_end;     /* the last step asked for the end of the simulation */
    double start_time, stop_time; /* stop_time: infinite if the importer defines none */
    char *name;
    char message[VI_MESSAGE_LENGTH];
    /* version-specific logger: level 0 event, 1 warning, 3 error */
    void (*log)(const vi_instance *instance, int level, const char *category, const char *text);
    void *environment;
    void (*callback)(void);
    vi_sizes sizes;          /* of the description */
    vi_start *starts;        /* start values of the description that differ from the component's */
    size_t start_count;
    uint32_t *references;    /* the component's references for 1, 2, ... of the description; NULL: the same */
    size_t reference_count;
    vi_derivative_pair *pairs; /* whose derivatives are further variables; NULL: none are */
    vi_variable *slots;      /* these variables */
    size_t pair_count;
    vi_order knowns, unknowns;
    void *resources;         /* resources opened by the component; NULL for most components */
};

/* Is this token the component's? Its last twelve digits are an export's own, so exports are different FMUs. */
bool vi_token_fits(const char *token);

/* A new instance; NULL when memory is out. */
vi_instance *vi_instance_new(const char *name);
void vi_instance_free(vi_instance *instance);
void vi_instance_reset(vi_instance *instance);

/* Take sizes and start values of the description from the folder of resources, now and after each reset; NULL: the
 * component's own. `numbered`: the description of an export's token has its own value references, which must be there.
 * Returns false, after logging, when they are missing, memory is out or the component cannot use its resources. */
bool vi_instance_describe(vi_instance *instance, const char *function, const char *folder, bool numbered);

/* Is this token, which fits, an export's? */
bool vi_token_is_of_export(const char *token);

/* Log an error `function: text` and return false. */
bool vi_instance_fail(vi_instance *instance, const char *function, const char *format, ...);
void vi_instance_warn(const vi_instance *instance, const char *function, const char *format, ...);

/* Set start and stop time (infinite: none). Returns false, after logging, when the stop time lies before `start`. */
bool vi_instance_set_experiment(vi_instance *instance, const char *function, double start, double stop);

/* Does a step from `time` by `size` end by the stop time, within rounding? If not, log it. */
bool vi_instance_expect_end(vi_instance *instance, const char *function, double time, double size);

/* Is there an instance in one of these modes? If not, log it. */
bool vi_instance_expect(vi_instance *instance, const char *function, int modes);

/* Change the mode from one of these modes to another. */
bool vi_instance_enter(vi_instance *instance, const char *function, int from, vi_mode_of_use to);

/* End initialization and log warnings. A bad parameter logs the component's message, and the result is false. */
bool vi_instance_initialize(vi_instance *instance, const char *function);

/* Present time, s. */
double vi_instance_time(const vi_instance *instance);

/* Advance the component; `message` holds the problem of a step that failed. */
vi_step_result vi_instance_step(vi_instance *instance, const vi_step_request *request);

/* Is this an instance of co-simulation? If not, log it. */
bool vi_instance_expect_steps(vi_instance *instance, const char *function);

/* Recompute the outputs if a variable was set since; in initialization mode the motion starts anew. */
void vi_instance_refresh(vi_instance *instance);

/* Return the variable of a type with this value reference of the description; NULL, after logging: there is none. */
const vi_variable *vi_instance_find(vi_instance *instance, const char *function, int type, uint32_t reference);

/* Get and set `n` variables of one type. `convert` moves the `count` elements of one variable between the struct and
 * the importer's array, from element `first` on. Return false after logging. */
typedef void (*vi_convert)(void *field, void *values, size_t first, size_t count);
bool vi_instance_get(vi_instance *instance, const char *function, int type, const uint32_t references[], size_t n,
                     void *values, size_t value_count, vi_convert convert);
bool vi_instance_set(vi_instance *instance, const char *function, int type, const uint32_t references[], size_t n,
                     const void *values, size_t value_count, vi_convert convert);

/* Conversions of doubles. */
void vi_read_doubles(void *field, void *values, size_t first, size_t count);
void vi_write_doubles(void *field, void *values, size_t first, size_t count);

#endif
