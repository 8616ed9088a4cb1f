/* A bouncing ball with the usual mistake: flight is exact, but the ground is checked only at the end of a step.
 *
 * Inside a step the ball flies through the ground. At the end of the step a ball on or below the ground that falls
 * bounces. The bounce is too late, and too fast by up to g times the step. */
#include <float.h>

#include "model.h"

enum { H = 1, V, G, E, LANDING, BOUNCES, LABEL, LABEL_LENGTH, TOLERANCE };
enum { LANDING_ZERO, LANDING_KEPT, LANDING_ABOVE };

const bool model_has_state = true;
const bool model_has_event_mode = false;

void model_start(model *m)
{
    *m = (model){.value = {[H] = 1.0, [G] = -9.81, [E] = 0.7}};
}

bool model_begin(model *m, void *instance)
{
    (void)m;
    (void)instance;
    return true;
}

void model_calculate(model *m)
{
    m->value[LABEL_LENGTH] = m->value[LABEL];
    m->value[TOLERANCE] = m->tolerance;
}

static void bounce(double *x)
{
    const int landing = (int)x[LANDING];
    if (landing != LANDING_KEPT) {
        x[H] = landing == LANDING_ABOVE ? DBL_MIN : 0.0;
    }
    x[V] = -x[E] * x[V];
    x[BOUNCES] += 1.0;
}

step_answer model_step(model *m, double size, void *instance)
{
    double *x = m->value;
    (void)instance;
    x[H] += size * (x[V] + 0.5 * x[G] * size);
    x[V] += size * x[G];
    if (x[H] <= 0.0 && x[V] < 0.0) {
        bounce(x);
    }
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
