/* FMI 2.0 model exchange of the model in exchanged.c; each call in a wrong mode is an error. */
#include <stdlib.h>
#include <string.h>

#include "exchanged.h"
#include "fmi2Functions.h"
#include "wrong_token.h"

typedef struct {
    exchanged m;
    fmi2CallbackFunctions callbacks;
} instance2;

static exchanged *of(fmi2Component c)
{
    return &((instance2 *)c)->m;
}

static fmi2Status wrong(fmi2Component c, const char *where)
{
    instance2 *i = c;
    i->callbacks.logger(i->callbacks.componentEnvironment, "exchanged", fmi2Error, "logStatusError", "%s", where);
    return fmi2Error;
}

static fmi2Status said(fmi2Component c, answer found)
{
    static const fmi2Status STATUS[] = {fmi2OK, fmi2Discard, fmi2Error, fmi2Fatal};
    return found == ANSWER_ERROR ? wrong(c, "the model fails") : STATUS[found];
}

#define IN_MODE(wanted, where)                                                                                         \
    if (!exchanged_takes(of(c), wanted)) {                                                                             \
        return wrong(c, where " in a wrong mode");                                                                     \
    }

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)name, (void)resources, (void)visible, (void)logging;
    instance2 *i = is_wrong(token) || type != fmi2ModelExchange ? NULL : calloc(1, sizeof *i);
    if (i != NULL) {
        i->callbacks = *callbacks;
        exchanged_start(&i->m);
    }
    return i;
}

void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean given, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop)
{
    (void)given, (void)tolerance, (void)has_stop, (void)stop;
    of(c)->real[0] = of(c)->completed = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    IN_MODE(STARTING, "EnterInitializationMode")
    of(c)->mode = INITIALIZING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    IN_MODE(INITIALIZING, "ExitInitializationMode")
    of(c)->mode = EVENT_MODE;
    return fmi2OK;
}

fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    IN_MODE(CONTINUOUS, "EnterEventMode")
    of(c)->mode = EVENT_MODE;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    IN_MODE(EVENT_MODE, "EnterContinuousTimeMode")
    of(c)->mode = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    decisions made;
    IN_MODE(EVENT_MODE, "NewDiscreteStates")
    const answer found = exchanged_update(of(c), &made);
    info->newDiscreteStatesNeeded = made.again;
    info->terminateSimulation = made.ends;
    info->nominalsOfContinuousStatesChanged = made.nominals;
    info->valuesOfContinuousStatesChanged = made.values;
    info->nextEventTimeDefined = made.has_next;
    info->nextEventTime = of(c)->next;
    return said(c, found);
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    exchanged_start(of(c));
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    IN_MODE(CONTINUOUS, "SetTime")
    of(c)->real[0] = time;
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real states[], size_t count)
{
    IN_MODE(CONTINUOUS, "SetContinuousStates")
    return count == 2 ? said(c, exchanged_states(of(c), states)) : wrong(c, "two states");
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real states[], size_t count)
{
    memcpy(states, &of(c)->real[X], count * sizeof *states);
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real rates[], size_t count)
{
    IN_MODE(CONTINUOUS, "GetDerivatives")
    return count == 2 ? said(c, exchanged_rates(of(c), rates)) : wrong(c, "two derivatives");
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t count)
{
    IN_MODE(CONTINUOUS, "GetEventIndicators")
    return count == 1 ? said(c, exchanged_indicators(of(c), indicators)) : wrong(c, "one indicator");
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t count)
{
    for (size_t i = 0; i < count; i++) {
        nominals[i] = of(c)->scale;
    }
    of(c)->real[NOMINALS] += 1.0;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_prior, fmi2Boolean *event, fmi2Boolean *ends)
{
    bool wants_event, wants_end;
    (void)no_prior;
    IN_MODE(CONTINUOUS, "CompletedIntegratorStep")
    exchanged_completed(of(c), &wants_event, &wants_end);
    *event = wants_event;
    *ends = wants_end;
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Real values[])
{
    for (size_t i = 0; i < count; i++) {
        values[i] = exchanged_real(of(c), references[i]);
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, const fmi2Real values[])
{
    for (size_t i = 0; i < count; i++) {
        if (!exchanged_set_real(of(c), references[i], values[i])) {
            return wrong(c, "SetReal in a wrong mode");
        }
    }
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t unknown_count,
                                        const fmi2ValueReference knowns[], size_t known_count, const fmi2Real seed[],
                                        fmi2Real sensitivity[])
{
    (void)known_count;
    for (size_t i = 0; i < unknown_count; i++) {
        sensitivity[i] = unknowns[i] == V_RATE && knowns[0] == U ? seed[0] * exchanged_slope(of(c)) : 0.0;
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Integer values[])
{
    (void)references, (void)count;
    values[0] = of(c)->d;
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference references[], size_t count,
                          const fmi2Integer values[])
{
    (void)references, (void)count;
    return exchanged_set_d(of(c), (int)values[0]) ? fmi2OK : wrong(c, "SetInteger in a wrong mode");
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(exchanged));
    }
    memcpy(*state, of(c), sizeof(exchanged));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    memcpy(of(c), state, sizeof(exchanged));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}
