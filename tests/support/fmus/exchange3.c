/* FMI 3.0 model exchange of the model in exchanged.c; each call in a wrong mode is an error. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "exchanged.h"
#include "fmi3Functions.h"
#include "wrong_token.h"

typedef struct {
    exchanged m;
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} instance3;

static exchanged *of(fmi3Instance c)
{
    return &((instance3 *)c)->m;
}

static fmi3Status wrong(fmi3Instance c, const char *where)
{
    instance3 *i = c;
    if (i->log != NULL) {
        i->log(i->environment, fmi3Error, "logStatusError", where);
    }
    return fmi3Error;
}

static fmi3Status said(fmi3Instance c, answer found)
{
    static const fmi3Status STATUS[] = {fmi3OK, fmi3Discard, fmi3Error, fmi3Fatal};
    return found == ANSWER_ERROR ? wrong(c, "the model fails") : STATUS[found];
}

#define IN_MODE(wanted, where)                                                                                         \
    if (!exchanged_takes(of(c), wanted)) {                                                                             \
        return wrong(c, where " in a wrong mode");                                                                     \
    }

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log)
{
    (void)name, (void)resources, (void)visible, (void)logging;
    instance3 *i = is_wrong(token) ? NULL : calloc(1, sizeof *i);
    if (i != NULL) {
        i->log = log;
        i->environment = environment;
        exchanged_start(&i->m);
    }
    return i;
}

void fmi3FreeInstance(fmi3Instance c)
{
    free(c);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean given, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean has_stop, fmi3Float64 stop)
{
    (void)given, (void)tolerance, (void)has_stop, (void)stop;
    IN_MODE(STARTING, "EnterInitializationMode")
    of(c)->real[0] = of(c)->completed = start;
    of(c)->mode = INITIALIZING;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    IN_MODE(INITIALIZING, "ExitInitializationMode")
    of(c)->mode = EVENT_MODE;
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance c)
{
    IN_MODE(CONTINUOUS, "EnterEventMode")
    of(c)->mode = EVENT_MODE;
    return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c)
{
    IN_MODE(EVENT_MODE, "EnterContinuousTimeMode")
    of(c)->mode = CONTINUOUS;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *ends, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *has_next, fmi3Float64 *next)
{
    decisions made;
    IN_MODE(EVENT_MODE, "UpdateDiscreteStates")
    const answer found = exchanged_update(of(c), &made);
    *again = made.again;
    *ends = made.ends;
    *nominals = made.nominals;
    *values = made.values;
    *has_next = made.has_next;
    *next = of(c)->next;
    return said(c, found);
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    (void)c;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    exchanged_start(of(c));
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time)
{
    IN_MODE(CONTINUOUS, "SetTime")
    of(c)->real[0] = time;
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 states[], size_t count)
{
    IN_MODE(CONTINUOUS, "SetContinuousStates")
    return count == 2 ? said(c, exchanged_states(of(c), states)) : wrong(c, "two states");
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 states[], size_t count)
{
    memcpy(states, &of(c)->real[X], count * sizeof *states);
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 rates[], size_t count)
{
    IN_MODE(CONTINUOUS, "GetContinuousStateDerivatives")
    return count == 2 ? said(c, exchanged_rates(of(c), rates)) : wrong(c, "two derivatives");
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 indicators[], size_t count)
{
    IN_MODE(CONTINUOUS, "GetEventIndicators")
    return count == 1 ? said(c, exchanged_indicators(of(c), indicators)) : wrong(c, "one indicator");
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominals[], size_t count)
{
    for (size_t i = 0; i < count; i++) {
        nominals[i] = of(c)->scale;
    }
    of(c)->real[NOMINALS] += 1.0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *count)
{
    (void)c;
    *count = 2;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *count)
{
    (void)c;
    *count = 1;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_prior, fmi3Boolean *event, fmi3Boolean *ends)
{
    (void)no_prior;
    IN_MODE(CONTINUOUS, "CompletedIntegratorStep")
    exchanged_completed(of(c), event, ends);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
                          size_t value_count)
{
    (void)value_count;
    for (size_t i = 0; i < count; i++) {
        values[i] = exchanged_real(of(c), references[i]);
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t value_count)
{
    (void)value_count;
    for (size_t i = 0; i < count; i++) {
        if (!exchanged_set_real(of(c), references[i], values[i])) {
            return wrong(c, "SetFloat64 in a wrong mode");
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t unknown_count,
                                        const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[],
                                        size_t seed_count, fmi3Float64 sensitivity[], size_t sensitivity_count)
{
    (void)known_count, (void)seed_count, (void)sensitivity_count;
    for (size_t i = 0; i < unknown_count; i++) {
        sensitivity[i] = unknowns[i] == V_RATE && knowns[0] == U ? seed[0] * exchanged_slope(of(c)) : 0.0;
    }
    return fmi3OK;
}

fmi3Status fmi3GetInt64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Int64 values[],
                        size_t value_count)
{
    (void)references, (void)count, (void)value_count;
    values[0] = of(c)->d;
    return fmi3OK;
}

fmi3Status fmi3SetInt64(fmi3Instance c, const fmi3ValueReference references[], size_t count, const fmi3Int64 values[],
                        size_t value_count)
{
    (void)references, (void)count, (void)value_count;
    return exchanged_set_d(of(c), (int)values[0]) ? fmi3OK : wrong(c, "SetInt64 in a wrong mode");
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(exchanged));
    }
    memcpy(*state, of(c), sizeof(exchanged));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    memcpy(of(c), state, sizeof(exchanged));
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

/* ---- clocks ---- */

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference references[], size_t count, const fmi3Clock values[])
{
    return count == 1 && values[0] && exchanged_tick(of(c), references[0]) ? fmi3OK
                                                                           : wrong(c, "SetClock at a wrong time");
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    exchanged *m = of(c);
    if (count != 1 || references[0] != FUSE || (m->mode != INITIALIZING && m->mode != EVENT_MODE)) {
        return wrong(c, "GetIntervalDecimal of a wrong clock, or in a wrong mode");
    }
    qualifiers[0] = m->is_lit           ? fmi3IntervalChanged
                    : isfinite(m->fuse) ? fmi3IntervalUnchanged
                                        : fmi3IntervalNotYetKnown;
    m->fuse = m->is_lit ? m->real[0] + m->real[AT] : m->fuse;
    intervals[0] = m->real[AT];
    m->is_lit = false;
    return fmi3OK;
}
