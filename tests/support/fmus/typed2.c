/* FMI 2.0 co-simulation of the scalar variables of all types. A text lives until the next call. */
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "typed.h"
#include "wrong_token.h"

typedef struct {
    typed t;
    char given[LONGEST]; /* the text of the last call */
} instance;

static instance *called(fmi2Component c)
{
    instance *i = c;
    memset(i->given, '?', sizeof i->given);
    return i;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String token, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)name, (void)resources, (void)functions, (void)visible, (void)logging;
    instance *i = is_wrong(token) || kind != fmi2CoSimulation ? NULL : calloc(1, sizeof *i);
    if (i != NULL) {
        typed_start(&i->t);
    }
    return i;
}

void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop)
{
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    called(c)->t.time = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    (void)called(c);
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    (void)called(c);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)called(c);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    typed_start(&called(c)->t);
    return fmi2OK;
}

/* Functions that read and write variables of a type, whose cells have its values in `field`. */
#define MOVE(NAME, TYPE, FIELD, CELL)                                                                                  \
    fmi2Status fmi2Get##NAME(fmi2Component c, const fmi2ValueReference references[], size_t count, TYPE values[])      \
    {                                                                                                                  \
        instance *i = called(c);                                                                                       \
        for (size_t n = 0; n < count; n++) {                                                                           \
            values[n] = (TYPE)typed_get(&i->t, references[n], 0).FIELD;                                                \
        }                                                                                                              \
        return fmi2OK;                                                                                                 \
    }                                                                                                                  \
    fmi2Status fmi2Set##NAME(fmi2Component c, const fmi2ValueReference references[], size_t count,                     \
                             const TYPE values[])                                                                      \
    {                                                                                                                  \
        instance *i = called(c);                                                                                       \
        fmi2Status status = fmi2OK;                                                                                    \
        for (size_t n = 0; n < count; n++) {                                                                           \
            const cell value = {.FIELD = (CELL)values[n]};                                                             \
            status = typed_set(&i->t, references[n], 0, value) ? status : fmi2Error;                                   \
        }                                                                                                              \
        return status;                                                                                                 \
    }

MOVE(Real, fmi2Real, real, double)
MOVE(Integer, fmi2Integer, whole, int64_t)
MOVE(Boolean, fmi2Boolean, natural, uint64_t)

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2String values[])
{
    instance *i = called(c);
    for (size_t n = 0; n < count; n++) {
        strcpy(i->given, typed_text(&i->t, references[n], 0));
        values[n] = i->given;
    }
    return count == 1 ? fmi2OK : fmi2Error;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference references[], size_t count,
                         const fmi2String values[])
{
    instance *i = called(c);
    return count == 1 && typed_set_text(&i->t, references[0], 0, values[0]) ? fmi2OK : fmi2Error;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(typed));
    }
    memcpy(*state, &called(c)->t, sizeof(typed));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    memcpy(&called(c)->t, state, sizeof(typed));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)called(c);
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_state_before)
{
    (void)time, (void)no_state_before;
    typed_step(&called(c)->t, size);
    return fmi2OK;
}
