/* FMI 3.0 model exchange over vi_this_component: states, derivatives, event indicators. */
#include "fmi3Functions.h"

#include "model_exchange.h"

#if defined(__GNUC__) || defined(__clang__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* FMI says which parameters there are */
#endif

static fmi3Status status(bool good)
{
    return good ? fmi3OK : fmi3Error;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    return status(vi_instance_enter_continuous_time(instance, "fmi3EnterContinuousTimeMode"));
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation)
{
    if (enterEventMode == NULL || terminateSimulation == NULL
        || !vi_instance_expect_exchange(instance, "fmi3CompletedIntegratorStep", VI_MODE_CONTINUOUS)) {
        return fmi3Error;
    }
    *enterEventMode = *terminateSimulation = false;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    return status(vi_instance_set_time(instance, "fmi3SetTime", time));
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates)
{
    return status(vi_instance_set_states(instance, "fmi3SetContinuousStates", continuousStates, nContinuousStates));
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 values[], size_t count)
{
    return (fmi3Status)vi_instance_read(instance, "fmi3GetContinuousStateDerivatives", VI_DERIVATIVES, values, count);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 values[], size_t count)
{
    return (fmi3Status)vi_instance_read(instance, "fmi3GetEventIndicators", VI_INDICATORS, values, count);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 values[], size_t count)
{
    return (fmi3Status)vi_instance_read(instance, "fmi3GetContinuousStates", VI_STATES, values, count);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 values[], size_t count)
{
    return (fmi3Status)vi_instance_read(instance, "fmi3GetNominalsOfContinuousStates", VI_NOMINALS, values, count);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *count)
{
    return status(vi_instance_count(instance, "fmi3GetNumberOfEventIndicators", VI_INDICATORS, count));
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *count)
{
    return status(vi_instance_count(instance, "fmi3GetNumberOfContinuousStates", VI_STATES, count));
}
