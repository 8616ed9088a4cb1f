/* What a component (Oscillator, ImpactStop, ...) gives to the FMI adapters.
 *
 * All variables of a component live in one flat struct; `vi_this_description`, which the build generates from
 * variables.toml, says where. So get and set are table look-ups, and saving a state is a memcpy. The adapters fmi2.c and
 * fmi3.c are compiled once for each component and know nothing of its physics.
 */
#ifndef VIBROIMPACT_COMPONENT_H
#define VIBROIMPACT_COMPONENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "body/complaint.h"
#include "body/step.h"

enum { VI_FLOAT64 = 0, VI_INT64 = 1, VI_BOOLEAN = 2 };

enum { VI_READ_ONLY = 0, VI_SET_INITIAL = 1, VI_SET_TUNABLE = 2, VI_SET_INPUT = 3, VI_SET_STATE = 4 };

/* One variable; its value reference is its index in the table. */
typedef struct {
    uint8_t type;   /* VI_FLOAT64, VI_INT64 (enumerations too) or VI_BOOLEAN (stored as int32_t) */
    uint8_t access; /* when it may be set */
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
    /* References of the continuous states: all displacements, then all velocities; NULL where there are none. */
    const uint32_t *states;
    size_t state_count;
} vi_description;

/* What a component gives to an importer that integrates it (model exchange). Between events its derivatives and its
 * indicators are smooth; all that jumps does so in `handle_event`. One without states gives `set_time` alone. */
typedef struct {
    /* Numbers of states and of event indicators of the model description. */
    size_t (*states)(void *self);
    size_t (*indicators)(void *self);
    /* From its next initialization on it is integrated by the importer; called after `defaults`. */
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
    /* Resolve what happens at this instant; *changed: states, or their derivatives, have jumped, *limit: impact_limit is reached. False, with
     * the reason in `message`, when there is no end to it. */
    bool (*handle_event)(void *self, bool *changed, bool *limit, char message[VI_MESSAGE_LENGTH]);
    /* Time goes on: events are over. */
    void (*go_on)(void *self);
} vi_model_exchange;

/* A component. Each of its functions works on the flat struct `self` and never allocates; a `message` is empty when it is
 * called. */
typedef struct {
    /* Fill `self` (zeroed) with the default values. */
    void (*defaults)(void *self);
    /* Check all parameters, start, compute the outputs. On failure write every problem into `message` and return false; on
     * success it is empty or holds a warning. */
    bool (*initialize)(void *self, double start_time, char message[VI_MESSAGE_LENGTH]);
    /* The variable with this value reference was set; NULL: nothing follows from it but the outputs. */
    void (*was_set)(void *self, uint32_t value_reference);
    /* Recompute the outputs that depend on inputs directly. */
    void (*update_outputs)(void *self);
    /* Advance to the end of the step; see step.h. */
    vi_step_result (*step)(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH]);
    /* For a component that raises events; else these two are NULL. Resolve what is pending in event mode (FMI 3.0) or at the
     * start of a step (FMI 2.0). */
    bool (*resolve)(void *self, char message[VI_MESSAGE_LENGTH]);
    /* Is the component asking for an event at its present instant? */
    bool (*event_pending)(const void *self);
    /* Does this set-up need event mode (an external contact law)? NULL: no set-up does. */
    bool (*needs_events)(const void *self);
    /* Present time, s; NULL: the variable `time` holds it. */
    double (*time)(const void *self);
    /* Bytes of `self` in use, so that a saved state holds no unused rows of the record; NULL: all of it. */
    size_t (*used_size)(const void *self);
    /* The model description has `count` of the repeated variables `block` ("modes", "contacts"); called after
     * `defaults`. NULL for a component to which this makes no difference. */
    void (*sized)(void *self, const char *block, int count);

    /* For a component that reads more of the FMU's resources than start values; else all three are NULL. `open` reads them
     * once for an instance from the folder (NULL: there is none) and may allocate; NULL, with the reason in `message`, when
     * they are not what they must be. `attach` hands them over after `defaults`, and with NULL before they are read: they
     * are no part of the used size. */
    void *(*open)(const char *folder, char message[VI_MESSAGE_LENGTH]);
    void (*attach)(void *self, const void *resources);
    void (*close)(void *resources);

    /* NULL for a component of co-simulation alone. */
    const vi_model_exchange *exchange;
} vi_component;

/* The one component that this shared library holds. */
extern const vi_component vi_this_component;
extern const vi_description vi_this_description;

#endif
