/* FMI 3.0 co-simulation of the model that it is compiled with. Strict about common mistakes of importers: the
 * communication point must be the FMU's own time. Steps go forward, and event mode needs a request for it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "model.h"
#include "wrong_token.h"

/* Largest distance of a communication point from the FMU's own time, as a part of 1 + |time|. */
#define TIME_TOLERANCE 1e-9

typedef struct {
    model m;
    model before;          /* the last step */
    double no_going_before; /* the importer has said that it goes back to no state of a time before, s */
    bool event_mode_used;
    bool in_event_mode;
    fmi3IntermediateUpdateCallback update;
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} instance3;

static instance3 *of(fmi3Instance c)
{
    return c;
}

void say(void *instance, const char *word, int number, double value)
{
    char line[200];
    instance3 *i = instance;
    if (i->log != NULL) {
        snprintf(line, sizeof line, "%s %d %g", word, number, value);
        i->log(i->environment, fmi3Error, "logStatusError", line);
    }
}

static fmi3Status at(fmi3Instance c, occasion where)
{
    switch (model_at(&of(c)->m, where, c)) {
    case STEP_DONE:
        return fmi3OK;
    case STEP_FATAL:
        return fmi3Fatal;
    case STEP_DISCARDS:
        return fmi3Discard;
    default:
        return fmi3Error;
    }
}

__attribute__((weak)) bool model_updates = false; /* a constant would be folded */

/* Call back in the middle of a step; true: the importer asks for its end there. */
static bool is_stopped(fmi3Instance c, double time, double size)
{
    fmi3Boolean early = true;
    double end = time;
    if (model_updates) {
        of(c)->update(of(c)->environment, time + 0.5 * size, true, true, true, true, &early, &end);
    }
    return model_updates && early;
}

static fmi3Status status(bool good)
{
    return good ? fmi3OK : fmi3Error;
}

/* ---- life ---- */

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    (void)c, (void)on, (void)count, (void)categories;
    return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode_used, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t intermediate_count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)intermediate;
    const bool is_asked = (update != NULL && !model_updates) || intermediate_count > 0;
    if (is_wrong(token) || is_asked || (event_mode_used && !model_has_event_mode)) {
        return NULL;
    }
    instance3 *i = calloc(1, sizeof *i);
    if (i != NULL) {
        i->event_mode_used = event_mode_used;
        i->log = log;
        i->update = update;
        i->environment = environment;
        model_start(&i->m);
        i->m.early_allowed = event_mode_used && early_return;
        if (at(i, AT_INSTANTIATE) != fmi3OK) {
            free(i);
            return NULL;
        }
    }
    return i;
}

void fmi3FreeInstance(fmi3Instance c)
{
    (void)at(c, AT_FREE);
    free(c);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop)
{
    (void)stop_defined, (void)stop;
    of(c)->m.time = of(c)->no_going_before = start;
    of(c)->m.tolerance = tolerance_defined ? tolerance : 0.0;
    of(c)->before = of(c)->m;
    return at(c, AT_ENTER_INITIALIZATION);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    of(c)->in_event_mode = of(c)->event_mode_used;
    const fmi3Status refused = at(c, AT_EXIT_INITIALIZATION);
    if (refused != fmi3OK) {
        return refused;
    }
    return status(model_begin(&of(c)->m, c));
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    (void)c;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    const fmi3Status found = at(c, AT_RESET);
    const bool early_allowed = of(c)->m.early_allowed;
    model_start(&of(c)->m);
    of(c)->m.early_allowed = early_allowed;
    of(c)->in_event_mode = false;
    return found;
}

/* ---- values ---- */

static double *place(fmi3Instance c, fmi3ValueReference reference)
{
    const bool is_open = reference < MODEL_VALUES && (of(c)->m.closed >> reference & 1U) == 0U;
    return is_open ? &of(c)->m.value[reference] : NULL;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
                          size_t value_count)
{
    const fmi3Status found = at(c, AT_GET);
    if (found != fmi3OK) {
        return found;
    }
    model_calculate(&of(c)->m);
    of(c)->m.value[0] = of(c)->m.time;
    for (size_t k = 0; k < count; k++) {
        const double *from = place(c, references[k]);
        if (from == NULL || value_count != count) {
            return fmi3Error;
        }
        values[k] = *from;
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t value_count)
{
    const fmi3Status found = at(c, AT_SET);
    if (found != fmi3OK) {
        return found;
    }
    for (size_t k = 0; k < count; k++) {
        double *to = place(c, references[k]);
        if (to == NULL || value_count != count) {
            return fmi3Error;
        }
        *to = values[k];
    }
    return fmi3OK;
}

fmi3Status fmi3GetInt64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Int64 values[],
                        size_t value_count)
{
    for (size_t k = 0; k < count; k++) {
        double value;
        if (value_count != count || fmi3GetFloat64(c, &references[k], 1, &value, 1) != fmi3OK) {
            return fmi3Error;
        }
        values[k] = (fmi3Int64)value;
    }
    return fmi3OK;
}

fmi3Status fmi3SetInt64(fmi3Instance c, const fmi3ValueReference references[], size_t count, const fmi3Int64 values[],
                        size_t value_count)
{
    for (size_t k = 0; k < count; k++) {
        const double value = (double)values[k];
        if (value_count != count || fmi3SetFloat64(c, &references[k], 1, &value, 1) != fmi3OK) {
            return fmi3Error;
        }
    }
    return fmi3OK;
}

fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference references[], size_t count, const fmi3String values[],
                         size_t value_count)
{
    for (size_t k = 0; k < count; k++) {
        const double length = value_count == count ? (double)strlen(values[k]) : 0.0;
        if (value_count != count || fmi3SetFloat64(c, &references[k], 1, &length, 1) != fmi3OK) {
            return fmi3Error;
        }
    }
    return fmi3OK;
}

/* ---- states ---- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    const fmi3Status found = at(c, AT_SAVE);
    if (found != fmi3OK) {
        return found;
    }
    if (!model_has_state) {
        return fmi3Error;
    }
    if (*state == NULL) {
        *state = malloc(sizeof(model));
    }
    if (*state == NULL) {
        return fmi3Error;
    }
    memcpy(*state, &of(c)->m, sizeof(model));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    const fmi3Status found = at(c, AT_RESTORE);
    if (found != fmi3OK) {
        return found;
    }
    if (!model_has_state || state == NULL) {
        return fmi3Error;
    }
    if (((const model *)state)->time < of(c)->no_going_before - TIME_TOLERANCE) {
        say(c, "a state before the point that no state is before", 0, ((const model *)state)->time);
        return fmi3Error;
    }
    memcpy(&of(c)->m, state, sizeof(model));
    of(c)->before = of(c)->m; /* no step that could be repeated leads to a restored state */
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    (void)c, (void)state;
    *size = sizeof(model);
    return status(model_has_state);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    (void)c;
    if (!model_has_state || size < sizeof(model)) {
        return fmi3Error;
    }
    memcpy(bytes, state, sizeof(model));
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    if (size != sizeof(model) || fmi3GetFMUState(c, state) != fmi3OK) {
        return fmi3Error;
    }
    memcpy(*state, bytes, sizeof(model));
    return fmi3OK;
}

/* ---- steps and events ---- */

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_state_before,
                      fmi3Boolean *needs_event, fmi3Boolean *terminates, fmi3Boolean *early, fmi3Float64 *last_time)
{
    model *m = &of(c)->m;
    if (fabs(time - m->time) > TIME_TOLERANCE * (1.0 + fabs(time)) || !(size > 0.0) || of(c)->in_event_mode) {
        say(c, "wrong communication point, step size or mode", of(c)->in_event_mode, time);
        return fmi3Error;
    }
    if (!no_state_before && of(c)->before.time < time) {
        memcpy(m->value, of(c)->before.value, sizeof m->value); /* the last step is not accepted */
    } else if (no_state_before) {
        of(c)->no_going_before = time;
    }
    if (model_updates && of(c)->update == NULL) {
        say(c, "no callback for intermediate updates", 0, time);
        return fmi3Error;
    }
    if (is_stopped(c, time, size)) {
        *needs_event = *terminates = false;
        *early = true;
        *last_time = time;
        return fmi3OK;
    }
    m->time = time;
    of(c)->before = *m;
    const step_answer answer = model_step(m, size, c);
    const double share = answer == STEP_STALLS ? 0.0 : answer == STEP_DISCARDS ? 0.5 : 1.0;
    const bool is_mute = answer == STEP_DISCARDS_MUTE;
    const bool short_of_end = answer == STEP_ENDS_SHORT || answer == STEP_EVENT_EARLY || answer == STEP_SHORT || is_mute;
    m->time = short_of_end ? m->reached : share < 1.0 ? time + share * size : time + size;
    *needs_event = (answer == STEP_NEEDS_EVENT || answer == STEP_EVENT_EARLY) && of(c)->event_mode_used;
    *terminates = answer == STEP_TERMINATES || answer == STEP_ENDS_SHORT;
    *early = answer == STEP_STALLS || answer == STEP_EVENT_EARLY || answer == STEP_SHORT || (answer == STEP_SAYS && m->says_early);
    *last_time = answer == STEP_SAYS || answer == STEP_SOLVER_BEHIND ? m->reached : m->time;
    switch (answer) {
    case STEP_PENDS:
    case STEP_FAILS:
        return fmi3Error;
    case STEP_FATAL:
        return fmi3Fatal;
    case STEP_DISCARDS:
    case STEP_DISCARDS_MUTE:
        return fmi3Discard;
    default:
        return fmi3OK;
    }
}

fmi3Status fmi3EnterEventMode(fmi3Instance c)
{
    of(c)->in_event_mode = of(c)->event_mode_used;
    return status(of(c)->event_mode_used);
}

fmi3Status fmi3EnterStepMode(fmi3Instance c)
{
    of(c)->in_event_mode = false;
    return status(of(c)->event_mode_used);
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminates,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
                                    fmi3Boolean *next_event_defined, fmi3Float64 *next_event)
{
    if (!of(c)->in_event_mode) {
        say(c, "not in event mode", 0, of(c)->m.time);
        return fmi3Error;
    }
    const fmi3Status found = at(c, AT_EVENT);
    if (found != fmi3OK) {
        return found;
    }
    *again = model_update(&of(c)->m);
    *terminates = false;
    *nominals_changed = false;
    *values_changed = *again;
    *next_event_defined = false;
    *next_event = 0.0;
    return fmi3OK;
}
