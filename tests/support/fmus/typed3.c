/* FMI 3.0 co-simulation of variables of all types. Strict: structural parameters are set in configuration mode alone,
 * other variables outside of it, and each call has as many values as its variables. A text lives until the next call. */
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "typed.h"
#include "wrong_token.h"

typedef enum { INSTANTIATED, CONFIGURATION, INITIALIZATION, STEP } mode;

typedef struct {
    typed t;
    mode now;
    char given[MOST_ELEMENTS][LONGEST]; /* the texts of the last call */
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} instance;

static fmi3Status refused(instance *i, const char *why)
{
    i->log(i->environment, fmi3Error, "logStatusError", why);
    return fmi3Error;
}

static instance *called(fmi3Instance c)
{
    instance *i = c;
    memset(i->given, '?', sizeof i->given);
    return i;
}

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t intermediate_count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
    (void)intermediate, (void)intermediate_count, (void)update;
    instance *i = is_wrong(token) ? NULL : calloc(1, sizeof *i);
    if (i != NULL) {
        i->log = log;
        i->environment = environment;
        typed_start(&i->t);
    }
    return i;
}

void fmi3FreeInstance(fmi3Instance c)
{
    free(c);
}

static fmi3Status moved(fmi3Instance c, mode from, mode to, const char *why)
{
    instance *i = called(c);
    if (i->now != from) {
        return refused(i, why);
    }
    i->now = to;
    return fmi3OK;
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c)
{
    return moved(c, INSTANTIATED, CONFIGURATION, "configuration mode is entered after instantiation");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c)
{
    return moved(c, CONFIGURATION, INSTANTIATED, "this is no configuration mode");
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop)
{
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    ((instance *)c)->t.time = start;
    return moved(c, INSTANTIATED, INITIALIZATION, "initialization begins after configuration");
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    return moved(c, INITIALIZATION, STEP, "this is no initialization mode");
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    (void)called(c);
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    instance *i = called(c);
    typed_start(&i->t);
    i->now = INSTANTIATED;
    return fmi3OK;
}

/* ---- values ---- */

static fmi3Status counted(instance *i, const fmi3ValueReference references[], size_t count, size_t value_count)
{
    size_t values = 0;
    for (size_t n = 0; n < count; n++) {
        values += typed_size(&i->t, references[n]);
    }
    return values == value_count ? fmi3OK : refused(i, "a wrong number of values for the sizes of the variables");
}

static fmi3Status may_set(instance *i, fmi3ValueReference reference)
{
    const bool is_size = reference == ROWS || reference == COLUMNS;
    if (is_size == (i->now == CONFIGURATION)) {
        return fmi3OK;
    }
    return refused(i, is_size ? "a structural parameter outside of configuration mode"
                              : "a variable that is not structural in configuration mode");
}

/* Functions that read and write variables of a type, whose cells have its values in `field`. */
#define MOVE(NAME, TYPE, KIND, FIELD, CELL)                                                                            \
    fmi3Status fmi3Get##NAME(fmi3Instance c, const fmi3ValueReference references[], size_t count, TYPE values[],       \
                             size_t value_count)                                                                       \
    {                                                                                                                  \
        instance *i = called(c);                                                                                       \
        fmi3Status status = counted(i, references, count, value_count);                                                \
        for (size_t n = 0; n < count && status == fmi3OK; n++) {                                                       \
            status = typed_type(references[n]) == (KIND) ? fmi3OK : refused(i, "a variable of another type");          \
            for (size_t k = 0; k < typed_size(&i->t, references[n]) && status == fmi3OK; k++) {                        \
                *values++ = (TYPE)typed_get(&i->t, references[n], k).FIELD;                                            \
            }                                                                                                          \
        }                                                                                                              \
        return status;                                                                                                 \
    }                                                                                                                  \
    fmi3Status fmi3Set##NAME(fmi3Instance c, const fmi3ValueReference references[], size_t count, const TYPE values[], \
                             size_t value_count)                                                                       \
    {                                                                                                                  \
        instance *i = called(c);                                                                                       \
        fmi3Status status = counted(i, references, count, value_count);                                                \
        for (size_t n = 0; n < count && status == fmi3OK; n++) {                                                       \
            status = may_set(i, references[n]);                                                                        \
            const size_t size = typed_size(&i->t, references[n]);                                                      \
            for (size_t k = 0; k < size && status == fmi3OK; k++) {                                                    \
                const cell value = {.FIELD = (CELL) * values++};                                                       \
                const bool good = typed_type(references[n]) == (KIND) && typed_set(&i->t, references[n], k, value);    \
                status = good ? fmi3OK : refused(i, "a variable that cannot have this value");                         \
            }                                                                                                          \
        }                                                                                                              \
        return status;                                                                                                 \
    }

MOVE(Float64, fmi3Float64, FLOAT64, real, double)
MOVE(Float32, fmi3Float32, FLOAT32, real, double)
MOVE(Int8, fmi3Int8, INT8, whole, int64_t)
MOVE(UInt8, fmi3UInt8, UINT8, natural, uint64_t)
MOVE(Int16, fmi3Int16, INT16, whole, int64_t)
MOVE(UInt16, fmi3UInt16, UINT16, natural, uint64_t)
MOVE(Int32, fmi3Int32, INT32, whole, int64_t)
MOVE(UInt32, fmi3UInt32, UINT32, natural, uint64_t)
MOVE(Int64, fmi3Int64, INT64, whole, int64_t)
MOVE(UInt64, fmi3UInt64, UINT64, natural, uint64_t)
MOVE(Boolean, fmi3Boolean, BOOLEAN, natural, uint64_t)

fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3String values[],
                         size_t value_count)
{
    instance *i = called(c);
    const fmi3Status status = counted(i, references, count, value_count);
    size_t place = 0;
    for (size_t n = 0; n < count && status == fmi3OK; n++) {
        for (size_t k = 0; k < typed_size(&i->t, references[n]); k++, place++) {
            strcpy(i->given[place], typed_text(&i->t, references[n], k));
            values[place] = i->given[place];
        }
    }
    return status;
}

fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference references[], size_t count, const fmi3String values[],
                         size_t value_count)
{
    instance *i = called(c);
    fmi3Status status = counted(i, references, count, value_count);
    for (size_t n = 0; n < count && status == fmi3OK; n++) {
        status = may_set(i, references[n]);
        for (size_t k = 0; k < typed_size(&i->t, references[n]) && status == fmi3OK; k++) {
            status = typed_set_text(&i->t, references[n], k, *values++) ? fmi3OK : refused(i, "a text too long");
        }
    }
    return status;
}

/* ---- states and steps ---- */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(typed));
    }
    memcpy(*state, &called(c)->t, sizeof(typed));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    memcpy(&called(c)->t, state, sizeof(typed));
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    (void)called(c);
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_state_before,
                      fmi3Boolean *needs_event, fmi3Boolean *terminates, fmi3Boolean *early, fmi3Float64 *last_time)
{
    (void)time, (void)no_state_before;
    instance *i = called(c);
    if (i->now != STEP) {
        return refused(i, "a step outside of step mode");
    }
    typed_step(&i->t, size);
    *needs_event = *terminates = *early = fmi3False;
    *last_time = time + size;
    return fmi3OK;
}
