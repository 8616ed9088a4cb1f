/* An integrator, y' = u, whose y is one variable of the process: two instances add to the same. */
#include "model.h"

enum { U = 1, Y };

static double sum;

const bool model_has_state = false;
const bool model_has_event_mode = false;

void model_start(model *m)
{
    *m = (model){.value = {[U] = 1.0}};
    sum = 0.0;
}

bool model_begin(model *m, void *instance)
{
    (void)m, (void)instance;
    return true;
}

void model_calculate(model *m)
{
    m->value[Y] = sum;
}

step_answer model_step(model *m, double size, void *instance)
{
    (void)instance;
    sum += size * m->value[U];
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
