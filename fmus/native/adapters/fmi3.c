/* FMI 3.0 over vi_this_component; co-simulation: event mode with early return, get/set/serialize state. */
#include "fmi3Functions.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "derivatives.h"
#include "instance.h"
#include "model_exchange.h"
#include "saved_states.h"

#if defined(__GNUC__) || defined(__clang__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* FMI says which parameters there are */
#endif

static fmi3Status status(bool good)
{
    return good ? fmi3OK : fmi3Error;
}

static void log_message(const vi_instance *instance, int level, const char *category, const char *text)
{
    if (instance->callback != NULL) {
        const fmi3LogMessageCallback callback = (fmi3LogMessageCallback)instance->callback;
        callback(instance->environment, (fmi3Status)level, category, text);
    }
}

/* ---- instances ---- */

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[])
{
    if (instance == NULL) {
        return fmi3Error;
    }
    ((vi_instance *)instance)->logging = loggingOn;
    return fmi3OK;
}

static void refuse(fmi3LogMessageCallback log, fmi3InstanceEnvironment environment, const char *function,
                   const char *reason)
{
    char text[256];
    if (log != NULL) {
        (void)snprintf(text, sizeof text, "%s: %s", function, reason);
        log(environment, fmi3Error, "logStatusError", text);
    }
}

/* Make an instance with the sizes and start values of its description; NULL after logging. */
static vi_instance *instantiate(const char *function, fmi3String name, fmi3String token, fmi3String folder,
                                fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    if (name == NULL || name[0] == '\0') {
        refuse(log, environment, function, "expected an instance name, got none");
        return NULL;
    }
    if (!vi_token_fits(token)) {
        refuse(log, environment, function,
               "the instantiation token is not this component's: the binary and the model description are of different "
               "versions");
        return NULL;
    }
    vi_instance *instance = vi_instance_new(name);
    if (instance == NULL) {
        return NULL;
    }
    instance->log = log_message;
    instance->callback = (void (*)(void))log;
    instance->environment = environment;
    instance->logging = logging;
    if (!vi_instance_describe(instance, function, folder, vi_token_is_of_export(token))) {
        vi_instance_free(instance);
        return NULL;
    }
    return instance;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
                                         fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                         fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference requiredIntermediateVariables[],
                                         size_t nRequiredIntermediateVariables,
                                         fmi3InstanceEnvironment instanceEnvironment,
                                         fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate)
{
    static const char function[] = "fmi3InstantiateCoSimulation";
    /* FMI lets an importer require only variables described as intermediate, and this component has none; yet some
     * require all variables they record. The callback is never called; all values are there at the end of a step. */
    vi_instance *instance = instantiate(function, instanceName, instantiationToken, resourcePath, loggingOn,
                                        instanceEnvironment, logMessage);
    if (instance != NULL) {
        instance->event_mode_used = eventModeUsed;
        instance->early_return_allowed = earlyReturnAllowed;
    }
    if (instance != NULL && nRequiredIntermediateVariables > 0 && loggingOn) {
        log_message(instance, fmi3Warning, "logStatusWarning",
                    "fmi3InstantiateCoSimulation: intermediate variables are not available in this component");
    }
    return instance;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage)
{
    static const char function[] = "fmi3InstantiateModelExchange";
    if (vi_this_component.exchange == NULL) {
        refuse(logMessage, instanceEnvironment, function, "only co-simulation is available");
        return NULL;
    }
    vi_instance *instance = instantiate(function, instanceName, instantiationToken, resourcePath, loggingOn,
                                        instanceEnvironment, logMessage);
    if (instance != NULL) {
        vi_instance_exchange(instance);
    }
    return instance;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                               fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage,
                                               fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption)
{
    refuse(logMessage, instanceEnvironment, "fmi3InstantiateScheduledExecution", "not available in this component");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    vi_instance_free(instance);
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    static const char function[] = "fmi3EnterConfigurationMode";
    vi_instance *it = instance;
    if (it != NULL && !it->structural) {
        return status(vi_instance_fail(it, function, "expected an FMU with structural parameters, got one without"));
    }
    return status(vi_instance_enter(it, function, VI_MODE_INSTANTIATED, VI_MODE_CONFIGURATION));
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    return status(vi_instance_enter(instance, "fmi3ExitConfigurationMode", VI_MODE_CONFIGURATION, VI_MODE_INSTANTIATED));
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    static const char function[] = "fmi3EnterInitializationMode";
    vi_instance *it = instance;
    if (!vi_instance_expect(it, function, VI_MODE_INSTANTIATED)
        || !vi_instance_set_experiment(it, function, startTime, stopTimeDefined ? stopTime : HUGE_VAL)) {
        return fmi3Error;
    }
    it->mode = VI_MODE_INITIALIZATION;
    it->outputs_stale = true;
    return fmi3OK;
}

/* Does the importer stop at events? A law that another FMU answers needs it. */
static bool events_are_handled(vi_instance *it, const char *function)
{
    const bool needed = vi_this_component.needs_events != NULL && vi_this_component.needs_events(it->self);
    if (it->exchange || !needed || (it->event_mode_used && it->early_return_allowed)) {
        return true;
    }
    return vi_instance_fail(it, function,
                            "contact law external: expected an importer with event mode and early return, got "
                            "eventModeUsed = %s, earlyReturnAllowed = %s. Use a law that the body evaluates itself, such as "
                            "restitution (1), or an importer that handles events",
                            it->event_mode_used ? "true" : "false", it->early_return_allowed ? "true" : "false");
}

/* Event mode begins: clocks tick. */
static void enter_events(vi_instance *it, const char *function)
{
    it->mode = VI_MODE_EVENT;
    const double late = vi_this_component.tick != NULL ? vi_this_component.tick(it->self) : 0.0;
    if (late > 0.0) {
        vi_instance_warn(it, function, "expected event mode at nextEventTime, got it %.17g s later: the clock ticks now",
                         late);
    }
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    static const char function[] = "fmi3ExitInitializationMode";
    vi_instance *it = instance;
    if (!vi_instance_expect(it, function, VI_MODE_INITIALIZATION) || !events_are_handled(it, function)
        || !vi_instance_initialize(it, function)) {
        return fmi3Error;
    }
    if (!it->event_mode_used && !it->exchange) {
        it->mode = VI_MODE_STEP;
        return fmi3OK;
    }
    if (!it->exchange && !it->early_return_allowed && vi_this_component.next_tick != NULL
        && isfinite(vi_this_component.next_tick(it->self))) {
        vi_instance_warn(it, function, "earlyReturnAllowed = false: the clock ticks only where a step ends at"
                                       " nextEventTime");
    }
    enter_events(it, function);
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    vi_instance *it = instance;
    if (!vi_instance_expect(it, "fmi3EnterEventMode", VI_MODE_STEP | VI_MODE_CONTINUOUS)) {
        return fmi3Error;
    }
    if (!it->event_mode_used && !it->exchange) {
        return status(vi_instance_fail(it, "fmi3EnterEventMode", "the instance was made with eventModeUsed = false"));
    }
    enter_events(it, "fmi3EnterEventMode");
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return status(vi_instance_expect_steps(instance, "fmi3EnterStepMode")
                  && vi_instance_enter(instance, "fmi3EnterStepMode", VI_MODE_EVENT, VI_MODE_STEP));
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    return status(vi_instance_enter(instance, "fmi3Terminate", VI_RUNNING, VI_MODE_TERMINATED));
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    if (instance == NULL) {
        return fmi3Error;
    }
    vi_instance_reset(instance);
    return fmi3OK;
}

/* ---- steps and events ---- */

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn,
                      fmi3Float64 *lastSuccessfulTime)
{
    vi_instance *it = instance;
    if (it == NULL || eventHandlingNeeded == NULL || terminateSimulation == NULL || earlyReturn == NULL
        || lastSuccessfulTime == NULL || !vi_instance_expect_steps(it, "fmi3DoStep") || !vi_instance_expect(it, "fmi3DoStep", VI_MODE_STEP)
        || !vi_instance_expect_end(it, "fmi3DoStep", currentCommunicationPoint, communicationStepSize)) {
        return fmi3Error;
    }
    const vi_step_request request = {currentCommunicationPoint, communicationStepSize, it->event_mode_used,
                                     it->early_return_allowed};
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = false;
    *lastSuccessfulTime = currentCommunicationPoint;
    const vi_step_result result = vi_instance_step(it, &request);
    if (vi_step_failed(result)) {
        return status(vi_instance_fail(it, "fmi3DoStep", "%s", it->message));
    }
    it->outputs_stale = false;
    const double end = currentCommunicationPoint + communicationStepSize;
    const double reached = vi_instance_time(it); /* rounding may put a contact after the end */
    *lastSuccessfulTime = result == VI_STEP_DONE || reached > end ? end : reached;
    if (result == VI_STEP_IMPACT_LIMIT) {
        log_message(it, fmi3Discard, "logStatusWarning", "fmi3DoStep: impact_limit reached");
        return fmi3Discard;
    }
    if (result == VI_STEP_UNBOUNDED) {
        *terminateSimulation = true;
        *earlyReturn = it->early_return_allowed && *lastSuccessfulTime < end;
        vi_instance_warn(it, "fmi3DoStep", "%s", it->message);
        return it->early_return_allowed ? fmi3OK : fmi3Discard;
    }
    if (result == VI_STEP_UNFINISHED && !it->early_return_allowed) {
        log_message(it, fmi3Discard, "logStatusWarning",
                    "fmi3DoStep: expected a step whose end can be computed in a minute or so. Ask for shorter steps");
        return fmi3Discard;
    }
    *eventHandlingNeeded = result == VI_STEP_CONTACT
                           || (it->event_mode_used && vi_this_component.clock_is_due != NULL
                               && vi_this_component.clock_is_due(it->self));
    *earlyReturn = result != VI_STEP_DONE && *lastSuccessfulTime < end;
    return fmi3OK;
}

/* End the present ticks, and tell when the next one comes. */
static void expect_tick(vi_instance *it, bool *defined, double *time)
{
    const double next = vi_this_component.next_tick != NULL ? vi_this_component.next_tick(it->self) : HUGE_VAL;
    if (isfinite(next)) {
        *defined = true;
        *time = next;
    }
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime)
{
    static const char function[] = "fmi3UpdateDiscreteStates";
    vi_instance *it = instance;
    if (it == NULL || discreteStatesNeedUpdate == NULL || terminateSimulation == NULL
        || nominalsOfContinuousStatesChanged == NULL || valuesOfContinuousStatesChanged == NULL
        || nextEventTimeDefined == NULL || nextEventTime == NULL
        || !vi_instance_expect(it, function, VI_MODE_EVENT)) {
        return fmi3Error;
    }
    *discreteStatesNeedUpdate = *terminateSimulation = *nominalsOfContinuousStatesChanged = false;
    *nextEventTimeDefined = false;
    *nextEventTime = 0.0;
    if (it->exchange) {
        const bool good = vi_instance_handle_event(it, function, valuesOfContinuousStatesChanged, terminateSimulation);
        expect_tick(it, nextEventTimeDefined, nextEventTime);
        return status(good);
    }
    const bool has_events = vi_this_component.resolve != NULL;
    *valuesOfContinuousStatesChanged = has_events && vi_this_component.event_pending(it->self);
    it->message[0] = '\0';
    if (has_events && !vi_this_component.resolve(it->self, it->message)) {
        return status(vi_instance_fail(it, function, "%s", it->message));
    }
    it->outputs_stale = true;
    expect_tick(it, nextEventTimeDefined, nextEventTime);
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    return status(vi_instance_expect(instance, "fmi3EvaluateDiscreteStates", VI_MODE_EVENT));
}

/* ---- variables ---- */

static void read_int64(void *field, void *values, size_t first, size_t count)
{
    memcpy((int64_t *)values + first, field, count * sizeof(int64_t));
}

static void write_int64(void *field, void *values, size_t first, size_t count)
{
    memcpy(field, (const int64_t *)values + first, count * sizeof(int64_t));
}

static void read_boolean(void *field, void *values, size_t first, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        ((fmi3Boolean *)values)[first + i] = ((const int32_t *)field)[i] != 0;
    }
}

static void write_boolean(void *field, void *values, size_t first, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        ((int32_t *)field)[i] = ((const fmi3Boolean *)values)[first + i] ? 1 : 0;
    }
}

#define GETTER(NAME, CTYPE, TYPE, CONVERT)                                                                          \
    fmi3Status fmi3Get##NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],                      \
                             size_t nValueReferences, CTYPE values[], size_t nValues)                                \
    {                                                                                                                \
        return status(instance != NULL && (nValueReferences == 0 || (valueReferences != NULL && values != NULL))      \
                      && vi_instance_get(instance, "fmi3Get" #NAME, TYPE, valueReferences, nValueReferences, values, \
                                         nValues, CONVERT));                                                         \
    }
#define SETTER(NAME, CTYPE, TYPE, CONVERT)                                                                          \
    fmi3Status fmi3Set##NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],                      \
                             size_t nValueReferences, const CTYPE values[], size_t nValues)                          \
    {                                                                                                                \
        return status(instance != NULL && (nValueReferences == 0 || (valueReferences != NULL && values != NULL))      \
                      && vi_instance_set(instance, "fmi3Set" #NAME, TYPE, valueReferences, nValueReferences, values, \
                                         nValues, CONVERT));                                                         \
    }

GETTER(Float64, fmi3Float64, VI_FLOAT64, vi_read_doubles)
SETTER(Float64, fmi3Float64, VI_FLOAT64, vi_write_doubles)
GETTER(Int64, fmi3Int64, VI_INT64, read_int64)
SETTER(Int64, fmi3Int64, VI_INT64, write_int64)
GETTER(Boolean, fmi3Boolean, VI_BOOLEAN, read_boolean)
SETTER(Boolean, fmi3Boolean, VI_BOOLEAN, write_boolean)

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[])
{
    return status(instance != NULL && (nValueReferences == 0 || (valueReferences != NULL && values != NULL))
                  && vi_instance_get(instance, "fmi3GetClock", VI_CLOCK, valueReferences, nValueReferences, values,
                                     nValueReferences, read_boolean));
}

/* ---- derivatives ---- */

#define DERIVATIVE(NAME, ADJOINT)                                                                                    \
    fmi3Status fmi3Get##NAME##Derivative(fmi3Instance instance, const fmi3ValueReference unknowns[],                 \
                                         size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns,        \
                                         const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[],          \
                                         size_t nSensitivity)                                                        \
    {                                                                                                                \
        const vi_derivative_call call = {unknowns, knowns, nUnknowns,    nKnowns, seed,                              \
                                         nSeed,    sensitivity, nSensitivity, ADJOINT};                              \
        return (fmi3Status)vi_instance_derive(instance, "fmi3Get" #NAME "Derivative", &call);                        \
    }

DERIVATIVE(Directional, false)
DERIVATIVE(Adjoint, true)

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t nValues)
{
    static const char function[] = "fmi3GetOutputDerivatives";
    if (instance != NULL && nValues != nValueReferences) {
        return status(vi_instance_fail(instance, function, "expected room for %lu values, got %lu",
                                       (unsigned long)nValueReferences, (unsigned long)nValues));
    }
    return (fmi3Status)vi_instance_differentiate(instance, function, valueReferences, orders, values, nValues);
}

/* ---- saved states ---- */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    return status(vi_state_save(instance, "fmi3GetFMUState", state));
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    return status(vi_state_restore(instance, "fmi3SetFMUState", state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    return status(vi_state_free(state));
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    return status(vi_state_size(instance, state, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return status(vi_state_write(instance, state, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    return status(vi_state_read(instance, "fmi3DeserializeFMUState", bytes, size, state));
}
