/* A bouncing ball with a solver of its own, like FMI's Reference-FMUs: explicit Euler in steps of 1 ms. When a step of
 * the solver ends on or below the ground, the ball bounces there, inside the step of the importer. h is then the
 * smallest positive number, so the ends of steps never show h below 0. With event mode and early return the step ends
 * at the bounce, and event mode makes it. */
#include <float.h>
#include <math.h>

#include "model.h"

enum { H = 1, V, G, E, BOUNCES, SOLVER_TIME };

/* Step of the solver, s; distance within which a communication point counts as a solver step, s (absolute). */
#define SOLVER_STEP 1e-3
#define CLOSE 1e-5
/* Velocity below which the ball stops bouncing, m/s. */
#define SLOWEST 0.1

const bool model_has_state = true;
const bool model_has_event_mode = true;

void model_start(model *m)
{
    *m = (model){.value = {[H] = 1.0, [G] = -9.81, [E] = 0.7}};
}

bool model_begin(model *m, void *instance)
{
    (void)instance;
    m->value[SOLVER_TIME] = m->time;
    return true;
}

void model_calculate(model *m)
{
    (void)m;
}

static bool is_down(const double *x)
{
    return x[H] <= 0.0 && x[V] < 0.0;
}

static void bounce(double *x)
{
    x[H] = DBL_MIN;
    x[V] = -x[V] * x[E];
    x[BOUNCES] += 1.0;
    if (x[V] < SLOWEST) {
        x[V] = 0.0;
        x[G] = 0.0;
    }
}

step_answer model_step(model *m, double size, void *instance)
{
    double *x = m->value;
    const double end = m->time + size;
    (void)instance;
    while (x[SOLVER_TIME] + SOLVER_STEP <= end + CLOSE) {
        const double v = x[V];
        x[H] += SOLVER_STEP * v;
        x[V] += SOLVER_STEP * x[G];
        x[SOLVER_TIME] += SOLVER_STEP;
        if (is_down(x) && m->early_allowed) {
            m->reached = x[SOLVER_TIME];
            return STEP_EVENT_EARLY;
        }
        if (is_down(x)) {
            bounce(x);
        }
    }
    m->reached = x[SOLVER_TIME];
    m->says_early = false;
    return STEP_SOLVER_BEHIND;
}

bool model_update(model *m)
{
    if (is_down(m->value)) {
        bounce(m->value);
    }
    return false;
}

step_answer model_at(model *m, occasion where, void *instance)
{
    (void)m, (void)where, (void)instance;
    return STEP_DONE;
}
