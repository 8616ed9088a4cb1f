/* y = k u + b: direct feedthrough and nothing else. It has no state to get or set. */
#include "model.h"

enum { U = 1, Y, K, B };

const bool model_has_state = false;
const bool model_has_event_mode = false;

void model_start(model *m)
{
    *m = (model){.value = {[K] = 1.0}};
}

bool model_begin(model *m, void *instance)
{
    (void)m;
    (void)instance;
    return true;
}

void model_calculate(model *m)
{
    m->value[Y] = m->value[K] * m->value[U] + m->value[B];
}

step_answer model_step(model *m, double size, void *instance)
{
    (void)m;
    (void)size;
    (void)instance;
    return STEP_DONE;
}

bool model_update(model *m)
{
    (void)m;
    return false;
}

step_answer model_at(model *m, occasion where, void *instance)
{
    (void)m, (void)where, (void)instance;
    return STEP_DONE;
}
