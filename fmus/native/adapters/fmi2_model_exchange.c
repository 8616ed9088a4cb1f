/* FMI 2.0 model exchange over vi_this_component: states, derivatives, event indicators. */
#include "fmi2Functions.h"

#include "instance.h"

#define UNUSED(argument) (void)(argument)

static const vi_model_exchange *exchange(void)
{
    return vi_this_component.exchange;
}

static fmi2Status status(bool good)
{
    return good ? fmi2OK : fmi2Error;
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

fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    vi_instance *it = c;
    if (it == NULL || !vi_instance_expect_exchange(it, "fmi2EnterEventMode", VI_MODE_CONTINUOUS)) {
        return fmi2Error;
    }
    it->mode = VI_MODE_EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo)
{
    static const char function[] = "fmi2NewDiscreteStates";
    vi_instance *it = c;
    if (it == NULL || eventInfo == NULL || !vi_instance_expect_exchange(it, function, VI_MODE_EVENT)) {
        return fmi2Error;
    }
    bool changed = false, terminate = false;
    *eventInfo = (fmi2EventInfo){0};
    const bool good = vi_instance_handle_event(it, function, &changed, &terminate);
    eventInfo->valuesOfContinuousStatesChanged = changed ? fmi2True : fmi2False;
    eventInfo->terminateSimulation = terminate ? fmi2True : fmi2False;
    return status(good);
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    vi_instance *it = c;
    if (it == NULL || !vi_instance_expect_exchange(it, "fmi2EnterContinuousTimeMode", VI_MODE_EVENT)) {
        return fmi2Error;
    }
    exchange()->go_on(it->self);
    it->mode = VI_MODE_CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    UNUSED(noSetFMUStatePriorToCurrentPoint);
    vi_instance *it = c;
    if (it == NULL || enterEventMode == NULL || terminateSimulation == NULL
        || !vi_instance_expect_exchange(it, "fmi2CompletedIntegratorStep", VI_MODE_CONTINUOUS)) {
        return fmi2Error;
    }
    *enterEventMode = *terminateSimulation = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    static const char function[] = "fmi2SetTime";
    vi_instance *it = c;
    if (it == NULL || !vi_instance_expect_exchange(it, function, VI_MODE_EVENT | VI_MODE_CONTINUOUS)) {
        return fmi2Error;
    }
    it->outputs_stale = true;
    return status(exchange()->set_time(it->self, time)
                  || vi_instance_fail(it, function, "expected a time below 2^53 forcing periods, got %.17g", time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    vi_instance *it = c;
    if (!expect(it, "fmi2SetContinuousStates", VI_MODE_CONTINUOUS, x, nx, true)) {
        return fmi2Error;
    }
    exchange()->set_states(it->self, x);
    it->outputs_stale = true;
    return fmi2OK;
}

/* `COMPUTED`: values that follow from the states, which must be finite; states and nominal values are as they are. */
#define READ(NAME, GET, STATES, COMPUTED)                                                                            \
    fmi2Status NAME(fmi2Component c, fmi2Real values[], size_t count)                                                \
    {                                                                                                                \
        vi_instance *it = c;                                                                                         \
        if (!expect(it, #NAME, READABLE, values, count, STATES)) {                                                   \
            return fmi2Error;                                                                                        \
        }                                                                                                            \
        exchange()->GET(it->self, values);                                                                           \
        const bool good = !(COMPUTED) || vi_instance_is_finite(it, #NAME, values, count);                            \
        return good ? fmi2OK : fmi2Discard;                                                                          \
    }

READ(fmi2GetDerivatives, get_derivatives, true, true)
READ(fmi2GetEventIndicators, get_indicators, false, true)
READ(fmi2GetContinuousStates, get_states, true, false)
READ(fmi2GetNominalsOfContinuousStates, get_nominals, true, false)
