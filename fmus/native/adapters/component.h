/* The interface of a component (Oscillator, ImpactStop, ...) to the FMI adapters.
 *
 * All variables of a component live in one flat struct; `vi_this_description`, which the build generates from
 * variables.toml, gives their places. So get and set are table look-ups, and saving a state is a copy
 * without zeros. The adapters
 * fmi2.c and fmi3.c are compiled once for each component and know nothing of its physics.
 */
#ifndef VIBROIMPACT_COMPONENT_H
#define VIBROIMPACT_COMPONENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "body/complaint.h"
#include "body/modal/variation.h"
#include "body/step.h"

enum { VI_FLOAT64 = 0, VI_INT64 = 1, VI_BOOLEAN = 2, VI_CLOCK = 3 };

/* VI_SENSITIVITY: a derivative since the start, which is no variable of the table and is read only. VI_SET_STRUCTURAL: a
 * number of blocks, which a description of FMI 3.0 may have as a structural parameter; else as VI_SET_INITIAL. */
enum {
    VI_READ_ONLY = 0,
    VI_SET_INITIAL = 1,
    VI_SET_TUNABLE = 2,
    VI_SET_INPUT = 3,
    VI_SET_STATE = 4,
    VI_SENSITIVITY = 5,
    VI_SET_STRUCTURAL = 6
};

/* One variable; its value reference is its index in the table. */
typedef struct {
    uint8_t type;   /* VI_FLOAT64, VI_INT64 (enumerations too), VI_BOOLEAN or VI_CLOCK (both stored as int32_t) */
    uint8_t access; /* states in which it may be set */
    uint32_t count; /* number of elements: 1, or the product of the dimensions */
    uint32_t offset; /* in the component's struct, bytes */
} vi_variable;

/* A component as its model description shows it. */
typedef struct {
    const char *token;
    size_t struct_size;
    size_t time; /* offset of the present time in the struct, bytes */
    const vi_variable *variables;
    size_t variable_count;
    /* References of the continuous states: all displacements, then all velocities; NULL without states. */
    const uint32_t *states;
    size_t state_count;
} vi_description;

/* Functions for an importer that integrates the component (model exchange). Derivatives and indicators are smooth
 * between events; all jumps happen in `handle_event`. A component without states gives only `set_time`. */
typedef struct {
    /* Numbers of states and of event indicators of the model description. */
    size_t (*states)(void *self);
    size_t (*indicators)(void *self);
    /* From the next initialization on the importer integrates the component; called after `defaults`. */
    void (*enable)(void *self);
    /* Initialization has ended. False, with all reasons in `message`, when this set-up cannot be integrated. */
    bool (*begin)(void *self, char message[VI_MESSAGE_LENGTH]);
    /* False when the time cannot be counted. */
    bool (*set_time)(void *self, double time);
    void (*get_states)(void *self, double states[]);
    void (*set_states)(void *self, const double states[]);
    bool (*states_are_finite)(void *self);
    void (*get_nominals)(void *self, double nominals[]);
    void (*get_derivatives)(void *self, double derivatives[]);
    void (*get_indicators)(void *self, double indicators[]);
    /* Resolve the events at this instant. *changed: states or their derivatives have jumped; *limit: impact_limit is
     * reached. Returns false, with the reason in `message`, when the events do not end. */
    bool (*handle_event)(void *self, bool *changed, bool *limit, char message[VI_MESSAGE_LENGTH]);
    /* Events are over and time goes on. */
    void (*go_on)(void *self);
} vi_model_exchange;

/* Partial derivatives at the present instant, for unknowns over knowns. The derivative of unknown i over known j is the
 * product of row i, the carried change, and column j. */
typedef struct {
    /* Take new inputs into account, before any other function; NULL: there is nothing to do. */
    void (*begin)(void *self);
    /* Describe a known, or an unknown, in `line` (zeroed up to `own`). False: this variable is none. */
    bool (*column)(void *self, uint32_t value_reference, vi_line *line);
    bool (*row)(void *self, uint32_t value_reference, vi_line *line);
    /* Carry a change from knowns to unknowns, and by the transposed equations back; NULL: both are the same. */
    void (*carry)(void *self, vi_variation *change);
    void (*carry_back)(void *self, vi_variation *change);
    /* Set a zeroed change to the derivative over time of this order, before it is carried. Orders are 1 to VI_MOST_ORDER,
     * and `first` is the carried change of order 1. Returns NULL, or what has no such derivative. NULL: nothing changes between events. */
    const char *(*rate)(void *self, int order, const vi_variation *first, vi_variation *change);
    /* The second derivative of an unknown along the first one over time, where the unknown is no linear form of a change.
     * NULL: all are. */
    double (*bend)(void *self, uint32_t value_reference);
} vi_partial_derivatives;

enum { VI_MOST_ORDER = 2 }; /* of an output's derivative over time */

/* An output, and a parameter over which its derivative since the start is an output of its own: value references. */
typedef struct {
    uint32_t unknown, known;
} vi_derivative_pair;

enum { VI_MOST_SENSITIVITIES = 512 }; /* most pairs of one instance */

/* A component. All functions work on the flat struct `self` and allocate nothing; `message` is empty on entry. */
typedef struct {
    /* Fill `self` (zeroed up to its caches) with the default values. */
    void (*defaults)(void *self);
    /* Check all parameters, start, compute the outputs. On failure write every problem into `message` and return false; on
     * success it is empty or holds a warning. */
    bool (*initialize)(void *self, double start_time, char message[VI_MESSAGE_LENGTH]);
    /* Called after the variable with this value reference was set; NULL: only outputs depend on variables. */
    void (*was_set)(void *self, uint32_t value_reference);
    /* Recompute the outputs that depend on inputs directly. */
    void (*update_outputs)(void *self);
    /* Advance to the end of the step; see step.h. */
    vi_step_result (*step)(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH]);
    /* For a component that raises events; otherwise these two are NULL. Resolve the pending event in event mode (FMI
     * 3.0) or at the start of a step (FMI 2.0). */
    bool (*resolve)(void *self, char message[VI_MESSAGE_LENGTH]);
    /* Does the component ask for an event at its present instant? */
    bool (*event_pending)(const void *self);
    /* Does this set-up need event mode (an external contact law)? NULL: never. */
    bool (*needs_events)(const void *self);
    /* For a component with an output clock; otherwise all three are NULL. Is its clock to tick at the present instant? */
    bool (*clock_is_due)(const void *self);
    /* Event mode begins: let a due clock tick. Returns how late it ticks, s: 0 at its own instant. */
    double (*tick)(void *self);
    /* The discrete states are updated: no clock ticks. Returns the time of the next tick, s; infinite: there is none. */
    double (*next_tick)(void *self);
    /* Present time, s; NULL: the variable `time` holds it. */
    double (*time)(const void *self);
    /* Bytes of `self` in use, so that a saved state holds no unused rows of the record; NULL: all bytes. */
    size_t (*used_size)(const void *self);
    /* Bytes of caches at the end of `self`: zero for a new instance, kept by a reset, and right for every state. */
    size_t cache_size;
    /* The model description has `count` of the repeated variables `block` ("modes", "contacts"); called after
     * `defaults`. NULL: sizes make no difference. */
    void (*sized)(void *self, const char *block, int count);

    /* For a component that reads more resources than start values; otherwise all three are NULL. `open` reads them once
     * for an instance from the folder (NULL: no folder) and may allocate. It returns NULL, with the reason in
     * `message`, for invalid resources. `attach` hands them over after `defaults`, and with NULL before they are read.
     * Resources are no part of the used size. `sized_by_resources`: this size follows from them. */
    void *(*open)(const char *folder, char message[VI_MESSAGE_LENGTH]);
    void (*attach)(void *self, const void *resources);
    void (*close)(void *resources);
    bool sized_by_resources;

    /* NULL for a component of co-simulation only. */
    const vi_model_exchange *exchange;

    /* NULL for a component that gives no derivatives. */
    const vi_partial_derivatives *partial;

    /* Follow the derivatives of these outputs over these parameters from the start on; called after `defaults`. False,
     * with the reason in `message`, for another pair. Their values are an array of doubles at the offset `followed`.
     * Both are NULL for a component that has none. */
    bool (*follow)(void *self, const vi_derivative_pair pairs[], size_t count, char message[VI_MESSAGE_LENGTH]);
    size_t (*followed)(void);
} vi_component;

/* The only component in this shared library. */
extern const vi_component vi_this_component;
extern const vi_description vi_this_description;

#endif
