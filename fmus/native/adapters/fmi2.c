/* FMI 2.0 over vi_this_component. Co-simulation of FMI 2.0 has no event mode: see event_time in the model description.
 *
 * Only fmi2Discard could announce a step that ends early (a full record, impact_limit), and no stock importer continues
 * after it. So no step ends early here: rows beyond the record count as dropped, and reaching impact_limit is an error.
 */
#include "fmi2Functions.h"

#include <math.h>
#include <limits.h>
#include <string.h>

#include "derivatives.h"
#include "instance.h"
#include "model_exchange.h"
#include "saved_states.h"

#if defined(__GNUC__) || defined(__clang__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* FMI says which parameters there are */
#endif

static fmi2Status status(bool good)
{
    return good ? fmi2OK : fmi2Error;
}

static fmi2Status unavailable(fmi2Component c, const char *function)
{
    if (c != NULL) {
        vi_instance_fail(c, function, "not available in this component");
    }
    return fmi2Error;
}

static void log_message(const vi_instance *instance, int level, const char *category, const char *text)
{
    if (instance->callback != NULL) {
        const fmi2CallbackLogger callback = (fmi2CallbackLogger)instance->callback;
        callback(instance->environment, instance->name, (fmi2Status)level, category, "%s", text);
    }
}

/* ---- instances ---- */

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    if (c == NULL) {
        return fmi2Error;
    }
    ((vi_instance *)c)->logging = loggingOn != fmi2False;
    return fmi2OK;
}

static fmi2Component refuse(const fmi2CallbackFunctions *functions, const char *name, const char *text)
{
    if (functions != NULL && functions->logger != NULL) {
        functions->logger(functions->componentEnvironment, name != NULL ? name : "", fmi2Error, "logStatusError", "%s",
                          text);
    }
    return NULL;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    if (instanceName == NULL || instanceName[0] == '\0') {
        return refuse(functions, instanceName, "fmi2Instantiate: expected an instance name, got none");
    }
    if (fmuType != fmi2CoSimulation && vi_this_component.exchange == NULL) {
        return refuse(functions, instanceName, "fmi2Instantiate: only co-simulation is available");
    }
    if (!vi_token_fits(fmuGUID)) {
        return refuse(functions, instanceName,
                      "fmi2Instantiate: the guid is not this component's: the binary and the model description are of "
                      "different versions");
    }
    vi_instance *instance = vi_instance_new(instanceName);
    if (instance != NULL) {
        instance->log = log_message;
        instance->callback = functions != NULL ? (void (*)(void))functions->logger : NULL;
        instance->environment = functions != NULL ? functions->componentEnvironment : NULL;
        instance->logging = loggingOn != fmi2False;
        char folder[VI_PATH_LENGTH];
        if (!vi_instance_describe(instance, "fmi2Instantiate", vi_folder_of_uri(fmuResourceLocation, folder), false)) {
            vi_instance_free(instance);
            return NULL;
        }
        if (fmuType == fmi2ModelExchange) {
            vi_instance_exchange(instance);
        }
    }
    return instance;
}

void fmi2FreeInstance(fmi2Component c)
{
    vi_instance_free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    vi_instance *it = c;
    const double stop = stopTimeDefined ? stopTime : HUGE_VAL;
    return status(vi_instance_expect(it, "fmi2SetupExperiment", VI_MODE_INSTANTIATED)
                  && vi_instance_set_experiment(it, "fmi2SetupExperiment", startTime, stop));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    vi_instance *it = c;
    if (!vi_instance_enter(it, "fmi2EnterInitializationMode", VI_MODE_INSTANTIATED, VI_MODE_INITIALIZATION)) {
        return fmi2Error;
    }
    it->outputs_stale = true;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    static const char function[] = "fmi2ExitInitializationMode";
    vi_instance *it = c;
    if (!vi_instance_expect(it, function, VI_MODE_INITIALIZATION) || !vi_instance_initialize(it, function)) {
        return fmi2Error;
    }
    it->mode = it->exchange ? VI_MODE_EVENT : VI_MODE_STEP;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    return status(vi_instance_enter(c, "fmi2Terminate", VI_RUNNING, VI_MODE_TERMINATED));
}

fmi2Status fmi2Reset(fmi2Component c)
{
    if (c == NULL) {
        return fmi2Error;
    }
    vi_instance_reset(c);
    return fmi2OK;
}

/* ---- steps ---- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    static const char function[] = "fmi2DoStep";
    vi_instance *it = c;
    if (!vi_instance_expect_steps(it, function) || !vi_instance_expect(it, function, VI_MODE_STEP)
        || !vi_instance_expect_end(it, function, currentCommunicationPoint, communicationStepSize)) {
        return fmi2Error;
    }
    const vi_step_request request = {currentCommunicationPoint, communicationStepSize, false, false};
    const vi_step_result result = vi_instance_step(it, &request);
    if (vi_step_failed(result)) {
        return status(vi_instance_fail(it, function, "%s", it->message));
    }
    it->outputs_stale = false;
    if (result == VI_STEP_IMPACT_LIMIT) {
        return status(vi_instance_fail(it, function, "impact_limit reached at %.17g s; expected fewer impacts",
                                       vi_instance_time(it)));
    }
    it->wants_to_end = result == VI_STEP_UNBOUNDED;
    if (it->wants_to_end) {
        vi_instance_warn(it, function, "%s", it->message);
        return fmi2Discard;
    }
    if (result == VI_STEP_UNFINISHED) {
        return status(vi_instance_fail(it, function, "expected a step whose end can be computed in a minute or so, got as"
                                       " far as %.17g s. Ask for shorter steps", vi_instance_time(it)));
    }
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    return unavailable(c, "fmi2CancelStep");
}

/* doStep is never asynchronous, and discarded only at the end of the simulation: time and end can be queried. */
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    if (c == NULL || value == NULL || s != fmi2DoStepStatus) {
        return unavailable(c, "fmi2GetStatus");
    }
    *value = fmi2OK;
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    vi_instance *it = c;
    if (it == NULL || value == NULL || s != fmi2LastSuccessfulTime || ((int)it->mode & VI_RUNNING) == 0) {
        return unavailable(c, "fmi2GetRealStatus");
    }
    *value = vi_instance_time(it);
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    return unavailable(c, "fmi2GetIntegerStatus");
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    const vi_instance *it = c;
    if (it == NULL || value == NULL || s != fmi2Terminated) {
        return unavailable(c, "fmi2GetBooleanStatus");
    }
    *value = it->wants_to_end ? fmi2True : fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    return unavailable(c, "fmi2GetStringStatus");
}

/* ---- variables ---- */

/* FMI 2.0 integers have 32 bits: larger counts become the largest integer. */
static void read_integer(void *field, void *values, size_t first, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        const int64_t wide = ((const int64_t *)field)[i];
        ((fmi2Integer *)values)[first + i] = wide > INT_MAX ? INT_MAX : wide < INT_MIN ? INT_MIN : (fmi2Integer)wide;
    }
}

static void write_integer(void *field, void *values, size_t first, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        ((int64_t *)field)[i] = ((const fmi2Integer *)values)[first + i];
    }
}

static void read_boolean(void *field, void *values, size_t first, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        ((fmi2Boolean *)values)[first + i] = ((const int32_t *)field)[i] != 0 ? fmi2True : fmi2False;
    }
}

static void write_boolean(void *field, void *values, size_t first, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        ((int32_t *)field)[i] = ((const fmi2Boolean *)values)[first + i] != fmi2False ? 1 : 0;
    }
}

#define GETTER(NAME, TYPE, CONVERT)                                                                                 \
    fmi2Status fmi2Get##NAME(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2##NAME value[])         \
    {                                                                                                                \
        return status(c != NULL && (nvr == 0 || (vr != NULL && value != NULL                                         \
                      && vi_instance_get(c, "fmi2Get" #NAME, TYPE, vr, nvr, value, nvr, CONVERT))));                 \
    }
#define SETTER(NAME, TYPE, CONVERT)                                                                                 \
    fmi2Status fmi2Set##NAME(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2##NAME value[])   \
    {                                                                                                                \
        return status(c != NULL && (nvr == 0 || (vr != NULL && value != NULL                                         \
                      && vi_instance_set(c, "fmi2Set" #NAME, TYPE, vr, nvr, value, nvr, CONVERT))));                 \
    }

GETTER(Real, VI_FLOAT64, vi_read_doubles)
SETTER(Real, VI_FLOAT64, vi_write_doubles)
GETTER(Integer, VI_INT64, read_integer)
SETTER(Integer, VI_INT64, write_integer)
GETTER(Boolean, VI_BOOLEAN, read_boolean)
SETTER(Boolean, VI_BOOLEAN, write_boolean)

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    return nvr == 0 ? fmi2OK : unavailable(c, "fmi2GetString");
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    return nvr == 0 ? fmi2OK : unavailable(c, "fmi2SetString");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    return nvr == 0 ? fmi2OK : unavailable(c, "fmi2SetRealInputDerivatives");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    return (fmi2Status)vi_instance_differentiate(c, "fmi2GetRealOutputDerivatives", vr, order, value, nvr);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    const vi_derivative_call call = {.unknowns = vUnknown_ref,
                                     .unknown_count = nUnknown,
                                     .knowns = vKnown_ref,
                                     .known_count = nKnown,
                                     .seed = dvKnown,
                                     .seed_count = nKnown,
                                     .sensitivity = dvUnknown,
                                     .sensitivity_count = nUnknown};
    return (fmi2Status)vi_instance_derive(c, "fmi2GetDirectionalDerivative", &call);
}

/* ---- saved states ---- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return status(vi_state_save(c, "fmi2GetFMUstate", state));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    return status(vi_state_restore(c, "fmi2SetFMUstate", state));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return status(vi_state_free(state));
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    return status(vi_state_size(c, state, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return status(vi_state_write(c, state, (unsigned char *)bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return status(vi_state_read(c, "fmi2DeSerializeFMUstate", (const unsigned char *)bytes, size, state));
}
