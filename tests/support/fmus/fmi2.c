/* FMI 2.0 co-simulation of the model that it is compiled with. Strict about common mistakes of importers: the
 * communication point must be the FMU's own time, and steps go forward. */
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "model.h"
#include "wrong_token.h"

/* Largest distance of a communication point from the FMU's own time, as a part of 1 + |time|. */
#define TIME_TOLERANCE 1e-9

typedef struct {
    model m;
    model before;          /* the last step */
    double no_going_before; /* the importer has said that it goes back to no state of a time before, s */
    fmi2CallbackFunctions callbacks;
    bool terminated;
    int pending; /* questions until a step that goes on by itself has ended */
    double goal; /* its end, s */
    char name[64];
} instance2;

static instance2 *of(fmi2Component c)
{
    return c;
}

void say(void *instance, const char *word, int number, double value)
{
    instance2 *i = instance;
    if (i->callbacks.logger != NULL) {
        i->callbacks.logger(i->callbacks.componentEnvironment, i->name, fmi2Error, "logStatusError", "%s %d %g", word,
                            number, value);
    }
}

static fmi2Status at(fmi2Component c, occasion where)
{
    if (of(c)->pending > 0) {
        return fmi2Error; /* the step still goes on */
    }
    switch (model_at(&of(c)->m, where, c)) {
    case STEP_DONE:
        return fmi2OK;
    case STEP_FATAL:
        return fmi2Fatal;
    case STEP_DISCARDS:
        return fmi2Discard;
    default:
        return fmi2Error;
    }
}

static fmi2Status status(bool good)
{
    return good ? fmi2OK : fmi2Error;
}

/* ---- life ---- */

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)c, (void)on, (void)count, (void)categories;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || is_wrong(guid) || callbacks->allocateMemory == NULL) {
        return NULL;
    }
    instance2 *i = callbacks->allocateMemory(1, sizeof *i); /* not by functions of its own */
    if (i != NULL) {
        i->callbacks = *callbacks;
        strncpy(i->name, name, sizeof i->name - 1);
        model_start(&i->m);
        if (at(i, AT_INSTANTIATE) != fmi2OK) {
            callbacks->freeMemory(i);
            return NULL;
        }
    }
    return i;
}

void fmi2FreeInstance(fmi2Component c)
{
    (void)at(c, AT_FREE);
    of(c)->callbacks.freeMemory(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop)
{
    (void)stop_defined, (void)stop;
    of(c)->m.time = of(c)->no_going_before = start;
    of(c)->m.tolerance = tolerance_defined ? tolerance : 0.0;
    of(c)->before = of(c)->m;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    return at(c, AT_ENTER_INITIALIZATION);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    const fmi2Status refused = at(c, AT_EXIT_INITIALIZATION);
    if (refused != fmi2OK) {
        return refused;
    }
    return status(model_begin(&of(c)->m, c));
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    const fmi2Status found = at(c, AT_RESET);
    model_start(&of(c)->m);
    of(c)->terminated = false;
    return found;
}

/* ---- values ---- */

static double *place(fmi2Component c, fmi2ValueReference reference)
{
    const bool is_open = reference < MODEL_VALUES && (of(c)->m.closed >> reference & 1U) == 0U;
    return is_open ? &of(c)->m.value[reference] : NULL;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Real values[])
{
    const fmi2Status found = at(c, AT_GET);
    if (found != fmi2OK) {
        return found;
    }
    model_calculate(&of(c)->m);
    for (size_t k = 0; k < count; k++) {
        const double *from = place(c, references[k]);
        if (from == NULL) {
            return fmi2Error;
        }
        values[k] = *from;
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, const fmi2Real values[])
{
    const fmi2Status found = at(c, AT_SET);
    if (found != fmi2OK) {
        return found;
    }
    for (size_t k = 0; k < count; k++) {
        double *to = place(c, references[k]);
        if (to == NULL) {
            return fmi2Error;
        }
        *to = values[k];
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Integer values[])
{
    for (size_t k = 0; k < count; k++) {
        double value;
        if (fmi2GetReal(c, &references[k], 1, &value) != fmi2OK) {
            return fmi2Error;
        }
        values[k] = (fmi2Integer)value;
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference references[], size_t count,
                          const fmi2Integer values[])
{
    for (size_t k = 0; k < count; k++) {
        const double value = values[k];
        if (fmi2SetReal(c, &references[k], 1, &value) != fmi2OK) {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference references[], size_t count,
                         const fmi2String values[])
{
    for (size_t k = 0; k < count; k++) {
        const double length = (double)strlen(values[k]);
        if (fmi2SetReal(c, &references[k], 1, &length) != fmi2OK) {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

/* ---- states ---- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    const fmi2Status found = at(c, AT_SAVE);
    if (found != fmi2OK) {
        return found;
    }
    if (!model_has_state) {
        return fmi2Error;
    }
    if (*state == NULL) {
        *state = malloc(sizeof(model));
    }
    if (*state == NULL) {
        return fmi2Error;
    }
    memcpy(*state, &of(c)->m, sizeof(model));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    const fmi2Status found = at(c, AT_RESTORE);
    if (found != fmi2OK) {
        return found;
    }
    if (!model_has_state || state == NULL) {
        return fmi2Error;
    }
    if (((const model *)state)->time < of(c)->no_going_before - TIME_TOLERANCE) {
        say(c, "a state before the point that no state is before", 0, ((const model *)state)->time);
        return fmi2Error;
    }
    memcpy(&of(c)->m, state, sizeof(model));
    of(c)->before = of(c)->m; /* no step that could be repeated leads to a restored state */
    of(c)->terminated = false;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c, (void)state;
    *size = sizeof(model);
    return status(model_has_state);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    (void)c;
    if (!model_has_state || size < sizeof(model)) {
        return fmi2Error;
    }
    memcpy(bytes, state, sizeof(model));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    if (size != sizeof(model) || fmi2GetFMUstate(c, state) != fmi2OK) {
        return fmi2Error;
    }
    memcpy(*state, bytes, sizeof(model));
    return fmi2OK;
}

/* ---- steps ---- */

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *status_of_step)
{
    instance2 *i = of(c);
    if (kind != fmi2DoStepStatus || i->pending == 0) {
        return fmi2Error;
    }
    i->m.time = --i->pending == 0 ? i->goal : i->m.time;
    *status_of_step = i->pending == 0 ? fmi2OK : fmi2Pending;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_state_before)
{
    model *m = &of(c)->m;
    if (of(c)->pending > 0 || fabs(time - m->time) > TIME_TOLERANCE * (1.0 + fabs(time)) || !(size > 0.0)) {
        say(c, "wrong communication point or step size", 0, time);
        return fmi2Error;
    }
    if (!no_state_before && of(c)->before.time < time) {
        memcpy(m->value, of(c)->before.value, sizeof m->value); /* the last step is not accepted */
    } else if (no_state_before) {
        of(c)->no_going_before = time;
    }
    m->time = time;
    of(c)->before = *m;
    const step_answer answer = model_step(m, size, c);
    of(c)->terminated = answer == STEP_TERMINATES || answer == STEP_ENDS_SHORT || answer == STEP_SAYS;
    switch (answer) {
    case STEP_FAILS:
        return fmi2Error;
    case STEP_FATAL:
        return fmi2Fatal;
    case STEP_PENDS:
        of(c)->pending = m->says_early ? INT_MAX : 3; /* it never ends, or soon */
        of(c)->goal = time + size;
        return fmi2Pending;
    case STEP_STALLS:
        return fmi2Discard;
    case STEP_DISCARDS:
        m->time = time + size / 2;
        return fmi2Discard;
    case STEP_DISCARDS_MUTE:
    case STEP_SHORT:
    case STEP_ENDS_SHORT:
    case STEP_SAYS:
        m->time = m->reached;
        return fmi2Discard;
    case STEP_TERMINATES:
        m->time = time + size;
        return fmi2Discard;
    default:
        m->time = time + size;
        return fmi2OK;
    }
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    *value = of(c)->m.time;
    return kind == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    *value = of(c)->terminated;
    return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}
