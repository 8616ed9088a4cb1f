/* A buffer on the ground, as other tools make one: a spring and a dashpot that start at a position and never pull.
 *
 * It reports neither position nor side. Its answer belongs to the end of a step, as in many tools. */
#include "model.h"

enum { D = 1, U, FORCE, STIFFNESS, DAMPING, GAP };

const bool model_has_state = true;
const bool model_has_event_mode = false;

void model_start(model *m)
{
    *m = (model){.value = {[STIFFNESS] = 1e4}};
}

bool model_begin(model *m, void *instance)
{
    (void)instance;
    return m->value[STIFFNESS] > 0.0;
}

void model_calculate(model *m)
{
    (void)m;
}

step_answer model_step(model *m, double size, void *instance)
{
    double *x = m->value;
    const double depth = x[D] - x[GAP];
    const double force = x[STIFFNESS] * depth + x[DAMPING] * x[U];
    (void)size, (void)instance;
    x[FORCE] = depth > 0.0 && force > 0.0 ? force : 0.0;
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
