/* A sampler with two input clocks: `tick` has a constant interval, `late` one that the FMU gives at initialization.
 *
 * At a tick of `tick` y = 10 ticks + u of that instant. u and y are variables of that clock: they are accessible only
 * while it ticks. `late` only counts. sum' = ticks + late_ticks, so the sum reveals the times of the ticks. */
#include "fmi3Functions.h"
#include "model.h"

enum { U = 1, Y, TICKS, LATE_TICKS, SUM, INTERVAL, SHIFT, ACTIVE };
enum { TICK = 20, LATE = 21, OF_TICK = 1, OF_LATE = 2 };

static const unsigned variables_of_tick = 1U << U | 1U << Y;

const bool model_has_state = true;
const bool model_has_event_mode = true;

void model_start(model *m)
{
    *m = (model){.value = {[INTERVAL] = 0.25, [SHIFT] = 0.125}};
}

bool model_begin(model *m, void *instance)
{
    (void)instance;
    m->closed = variables_of_tick;
    return true;
}

void model_calculate(model *m)
{
    if (((unsigned)m->value[ACTIVE] & OF_TICK) != 0U) {
        m->value[Y] = 10.0 * (m->value[TICKS] + 1.0) + m->value[U];
    }
}

step_answer model_step(model *m, double size, void *instance)
{
    (void)instance;
    m->value[SUM] += size * (m->value[TICKS] + m->value[LATE_TICKS]);
    return m->value[ACTIVE] == 0.0 ? STEP_DONE : STEP_FAILS; /* a clock that has ticked outside of event mode */
}

bool model_update(model *m)
{
    const unsigned active = (unsigned)m->value[ACTIVE];
    model_calculate(m);
    m->value[TICKS] += (active & OF_TICK) != 0U;
    m->value[LATE_TICKS] += (active & OF_LATE) != 0U;
    m->value[ACTIVE] = 0.0;
    m->closed = variables_of_tick;
    return false;
}

step_answer model_at(model *m, occasion where, void *instance)
{
    (void)m, (void)where, (void)instance;
    return STEP_DONE;
}

/* ---- functions of FMI 3.0 that only this model has; an instance begins with its model ---- */

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                        const fmi3Clock values[])
{
    model *m = instance;
    for (size_t k = 0; k < count; k++) {
        const unsigned which = references[k] == TICK ? OF_TICK : references[k] == LATE ? OF_LATE : 0U;
        if (which == 0U || !values[k] || ((unsigned)m->value[ACTIVE] & which) != 0U) {
            return fmi3Error;
        }
        m->value[ACTIVE] = (double)((unsigned)m->value[ACTIVE] | which);
        m->closed = which == OF_TICK ? 0U : m->closed;
    }
    return fmi3OK;
}

static fmi3Status of_late(fmi3Instance instance, const fmi3ValueReference references[], size_t count, int number,
                          fmi3Float64 values[])
{
    const model *m = instance;
    if (count != 1 || references[0] != LATE) {
        return fmi3Error;
    }
    values[0] = m->value[number];
    return fmi3OK;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    const model *m = instance;
    qualifiers[0] = m->value[INTERVAL] > 0.0 ? fmi3IntervalChanged : fmi3IntervalNotYetKnown;
    return of_late(instance, references, count, INTERVAL, intervals);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                               fmi3Float64 shifts[])
{
    return of_late(instance, references, count, SHIFT, shifts);
}
