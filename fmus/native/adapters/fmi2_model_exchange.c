/* FMI 2.0 model exchange over vi_this_component: states, derivatives, event indicators. */
#include "fmi2Functions.h"

#include "model_exchange.h"

#if defined(__GNUC__) || defined(__clang__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* FMI says which parameters there are */
#endif

static fmi2Status status(bool good)
{
    return good ? fmi2OK : fmi2Error;
}

fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    return status(vi_instance_expect_exchange(c, "fmi2EnterEventMode", VI_ANY_MODE)
                  && vi_instance_enter(c, "fmi2EnterEventMode", VI_MODE_CONTINUOUS, VI_MODE_EVENT));
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo)
{
    static const char function[] = "fmi2NewDiscreteStates";
    if (eventInfo == NULL || !vi_instance_expect_exchange(c, function, VI_MODE_EVENT)) {
        return fmi2Error;
    }
    bool changed = false, terminate = false;
    *eventInfo = (fmi2EventInfo){0};
    const bool good = vi_instance_handle_event(c, function, &changed, &terminate);
    eventInfo->valuesOfContinuousStatesChanged = changed ? fmi2True : fmi2False;
    eventInfo->terminateSimulation = terminate ? fmi2True : fmi2False;
    return status(good);
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    return status(vi_instance_enter_continuous_time(c, "fmi2EnterContinuousTimeMode"));
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    if (enterEventMode == NULL || terminateSimulation == NULL
        || !vi_instance_expect_exchange(c, "fmi2CompletedIntegratorStep", VI_MODE_CONTINUOUS)) {
        return fmi2Error;
    }
    *enterEventMode = *terminateSimulation = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    return status(vi_instance_set_time(c, "fmi2SetTime", time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    return status(vi_instance_set_states(c, "fmi2SetContinuousStates", x, nx));
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real values[], size_t count)
{
    return (fmi2Status)vi_instance_read(c, "fmi2GetDerivatives", VI_DERIVATIVES, values, count);
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real values[], size_t count)
{
    return (fmi2Status)vi_instance_read(c, "fmi2GetEventIndicators", VI_INDICATORS, values, count);
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real values[], size_t count)
{
    return (fmi2Status)vi_instance_read(c, "fmi2GetContinuousStates", VI_STATES, values, count);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real values[], size_t count)
{
    return (fmi2Status)vi_instance_read(c, "fmi2GetNominalsOfContinuousStates", VI_NOMINALS, values, count);
}
