/* A mass on a spring of its own, without contacts. Displacement and velocity go out; a force comes in, and is constant
 * over a step.
 *
 * mass x'' + stiffness x = f + load, on its exact flow or by Euler steps. Some schemes take no impulse, as some bodies. */
#include <math.h>

#include "model.h"

enum { X = 1, V, F, MASS, STIFFNESS, LOAD, SCHEME, INNER_STEP };
enum { EXACT, SYMPLECTIC_EULER, EXPLICIT_EULER, GRID, CLIPPED, ONE_SIZE, DISCARDS, DISCARDS_MUTE };

static const double most_force = 1e6;

#ifndef HAS_STATE
#define HAS_STATE true
#endif

const bool model_has_state = HAS_STATE;
const bool model_has_event_mode = false;

void model_start(model *m)
{
    *m = (model){.value = {[MASS] = 1.0}};
}

bool model_begin(model *m, void *instance)
{
    (void)instance;
    return m->value[MASS] > 0.0 && m->value[STIFFNESS] >= 0.0;
}

void model_calculate(model *m)
{
    (void)m;
}

static void flow(double *x, double size)
{
    const double f = x[SCHEME] == CLIPPED ? fmin(most_force, fmax(-most_force, x[F])) : x[F];
    const double force = f + x[LOAD];
    if (x[STIFFNESS] == 0.0) {
        const double acceleration = force / x[MASS];
        x[X] += size * (x[V] + 0.5 * acceleration * size);
        x[V] += acceleration * size;
        return;
    }
    const double w = sqrt(x[STIFFNESS] / x[MASS]), rest = force / x[STIFFNESS];
    const double half = sin(0.5 * w * size), s = sin(w * size), to_rest = rest - x[X], speed = x[V];
    /* as increments: the rest position under a contact's force may be far away */
    x[X] += 2.0 * half * half * to_rest + s * speed / w;
    x[V] += w * s * to_rest - 2.0 * half * half * speed;
}

static void euler(double *x, double size)
{
    const double acceleration = (x[F] + x[LOAD] - x[STIFFNESS] * x[X]) / x[MASS];
    if (x[SCHEME] == EXPLICIT_EULER) {
        x[X] += size * x[V];
        x[V] += size * acceleration;
    } else {
        x[V] += size * acceleration;
        x[X] += size * x[V];
    }
}

/* Return the number of multiples of the inner step in a step. */
static double grid_steps(const model *m, double size)
{
    const double before = m->time / m->value[INNER_STEP], after = (m->time + size) / m->value[INNER_STEP];
    return floor(after + 1e-6) - floor(before + 1e-6);
}

step_answer model_step(model *m, double size, void *instance)
{
    double *x = m->value;
    (void)instance;
    if ((x[SCHEME] == DISCARDS || x[SCHEME] == DISCARDS_MUTE) && size > x[INNER_STEP]) {
        flow(x, 0.5 * size);
        m->reached = -1.0; /* no time of the step */
        return x[SCHEME] == DISCARDS ? STEP_DISCARDS : STEP_DISCARDS_MUTE;
    }
    if (x[SCHEME] == EXACT || x[SCHEME] == CLIPPED || x[SCHEME] >= DISCARDS) {
        flow(x, size);
        return STEP_DONE;
    }
    if (x[SCHEME] == ONE_SIZE) {
        x[INNER_STEP] = x[INNER_STEP] > 0.0 ? x[INNER_STEP] : size;
        flow(x, x[INNER_STEP]); /* whatever size it is asked for */
        return STEP_DONE;
    }
    if (x[SCHEME] == GRID) {
        const double steps = grid_steps(m, size);
        for (double step = 0.0; step < steps; step += 1.0) {
            euler(x, x[INNER_STEP]);
        }
        return STEP_DONE;
    }
    const double parts = x[INNER_STEP] > 0.0 ? ceil(size / x[INNER_STEP]) : 1.0;
    for (double part = 0.0; part < parts; part += 1.0) {
        euler(x, size / parts);
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
