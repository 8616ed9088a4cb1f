/* FMI 3.0 model exchange over vi_this_component: states, derivatives, event indicators. */
#include "fmi3Functions.h"

#include "instance.h"

#define UNUSED(argument) (void)(argument)

static const vi_model_exchange *exchange(void)
{
    return vi_this_component.exchange;
}

static fmi3Status status(bool good)
{
    return good ? fmi3OK : fmi3Error;
}

enum { READABLE = VI_MODE_INITIALIZATION | VI_RUNNING };

/* Is it an array of as many numbers as there are states, or indicators, in one of these modes? */
static bool expect(vi_instance *it, const char *function, int modes, const double values[], size_t given, bool states)
{
    if (it == NULL || !vi_instance_expect_exchange(it, function, modes)) {
        return false;
    }
    if (it->mode == VI_MODE_INITIALIZATION) {
        vi_instance_refresh(it);
    }
    const size_t needed = states ? exchange()->states(it->self) : exchange()->indicators(it->self);
    if (given != needed || (values == NULL && needed > 0)) {
        return vi_instance_fail(it, function, "expected %lu values, got %lu", (unsigned long)needed,
                                (unsigned long)(values == NULL ? 0 : given));
    }
    return true;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    vi_instance *it = instance;
    if (it == NULL || !vi_instance_expect_exchange(it, "fmi3EnterContinuousTimeMode", VI_MODE_EVENT)) {
        return fmi3Error;
    }
    exchange()->go_on(it->self);
    it->mode = VI_MODE_CONTINUOUS;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation)
{
    UNUSED(noSetFMUStatePriorToCurrentPoint);
    vi_instance *it = instance;
    if (it == NULL || enterEventMode == NULL || terminateSimulation == NULL
        || !vi_instance_expect_exchange(it, "fmi3CompletedIntegratorStep", VI_MODE_CONTINUOUS)) {
        return fmi3Error;
    }
    *enterEventMode = *terminateSimulation = false;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    static const char function[] = "fmi3SetTime";
    vi_instance *it = instance;
    if (it == NULL || !vi_instance_expect_exchange(it, function, VI_MODE_EVENT | VI_MODE_CONTINUOUS)) {
        return fmi3Error;
    }
    it->outputs_stale = true;
    return status(exchange()->set_time(it->self, time)
                  || vi_instance_fail(it, function, "expected a time below 2^53 forcing periods, got %.17g", time));
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates)
{
    vi_instance *it = instance;
    if (!expect(it, "fmi3SetContinuousStates", VI_MODE_CONTINUOUS, continuousStates, nContinuousStates, true)) {
        return fmi3Error;
    }
    exchange()->set_states(it->self, continuousStates);
    it->outputs_stale = true;
    return fmi3OK;
}

/* `COMPUTED`: values that follow from the states, which must be finite; states and nominal values are as they are. */
#define READ(NAME, GET, STATES, COMPUTED)                                                                            \
    fmi3Status NAME(fmi3Instance instance, fmi3Float64 values[], size_t count)                                       \
    {                                                                                                                \
        vi_instance *it = instance;                                                                                  \
        if (!expect(it, #NAME, READABLE, values, count, STATES)) {                                                   \
            return fmi3Error;                                                                                        \
        }                                                                                                            \
        exchange()->GET(it->self, values);                                                                           \
        const bool good = !(COMPUTED) || vi_instance_is_finite(it, #NAME, values, count);                            \
        return good ? fmi3OK : fmi3Discard;                                                                          \
    }
#define COUNT(NAME, OF)                                                                                             \
    fmi3Status NAME(fmi3Instance instance, size_t *count)                                                            \
    {                                                                                                                \
        vi_instance *it = instance;                                                                                  \
        if (it == NULL || count == NULL || !vi_instance_expect_exchange(it, #NAME, VI_ANY_MODE)) {                   \
            return fmi3Error;                                                                                        \
        }                                                                                                            \
        *count = exchange()->OF(it->self);                                                                           \
        return fmi3OK;                                                                                               \
    }

READ(fmi3GetContinuousStateDerivatives, get_derivatives, true, true)
READ(fmi3GetEventIndicators, get_indicators, false, true)
READ(fmi3GetContinuousStates, get_states, true, false)
READ(fmi3GetNominalsOfContinuousStates, get_nominals, true, false)
COUNT(fmi3GetNumberOfEventIndicators, indicators)
COUNT(fmi3GetNumberOfContinuousStates, states)
