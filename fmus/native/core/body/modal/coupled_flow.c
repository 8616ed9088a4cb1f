#include "body/modal/coupled_flow.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "contact/complementarity.h"
#include "motion/majorant.h"

/* Length of a segment times the fastest rate: the first term left out is below 1e-17 of the motion, and the largest
 * terms are 12 times it. While a stop yields, less: its contact is short anyway, and keeps all digits. */
static const double REACH = 2.5, REACH_YIELDING = 1.0;
/* Of a power law the terms must fall by this over a segment: it has a singularity where the contact ends. */
static const double SMALLEST_TERM = 0.01;
/* In the first instants of a power law coefficient n is of size (rate / penetration)^n: the series ends before a
 * product of two of them overflows. */
static const double LARGEST_COEFFICIENT = 1e140;

/* Rate that no motion of the system exceeds, rad/s. */
static double fastest_rate(const vi_structure_model *model, const vi_drift_start *start)
{
    double stiffness = 0.0, damping = 0.0;
    for (int k = 0; k < model->contacts; ++k) {
        const vi_press *press = &start->press[k];
        const double mobility = fabs(model->mobility[k][k]);
        if (press->kind == VI_PRESS_LINEAR) {
            stiffness += fabs(press->stiffness) * mobility;
            damping += fabs(press->damping) * mobility;
        }
    }
    return model->fastest + sqrt(stiffness) + damping;
}

static double at_contact(const vi_structure_model *model, int k, const double vector[])
{
    return vi_structure_at(model, model->shape[k], vector);
}

/* Coefficient n of (penetration ^ exponent): the power-series recurrence of p d = exponent p d'. */
static void extend_power(const double d[], double exponent, int n, double power[])
{
    if (n == 0) {
        power[0] = pow(d[0], exponent);
        return;
    }
    double sum = 0.0;
    for (int i = 1; i <= n; ++i) {
        sum += (exponent * (double)i - (double)(n - i)) * d[i] * power[n - i];
    }
    power[n] = sum / ((double)n * d[0]);
}

static double pressed(const vi_drift *drift, int k, const vi_press *press, int n, double power[])
{
    const double *d = drift->penetration[k];
    const double rate = (double)(n + 1) * d[n + 1];
    if (press->kind == VI_PRESS_LINEAR) {
        return (n == 0 ? press->constant : 0.0) + press->stiffness * d[n] + press->damping * rate;
    }
    extend_power(d, press->exponent, n, power);
    double drag = 0.0;
    for (int i = 0; i <= n && press->damping != 0.0; ++i) {
        drag += power[i] * (double)(n - i + 1) * d[n - i + 1];
    }
    return press->stiffness * (power[n] + press->damping * drag);
}

/* Taylor coefficient n of everything in q'' but the forces of contacts. */
static void free_load(const vi_drift *drift, const vi_drift_start *start, double drive, int n, double load[])
{
    const vi_structure_model *model = drift->model;
    const double order = (double)(n + 1);
    for (int j = 0; j < model->modes; ++j) {
        const vi_mode *mode = &model->mode[j];
        const double first = start->held[j] - mode->stiffness * start->q[j];
        const double held = n == 0 ? first : n == 1 ? start->held_rate[j] : 0.0;
        load[j] = drive * mode->force + held - mode->stiffness * drift->modal[n][j];
    }
    for (int j = 0; j < model->modes && !model->coupled; ++j) {
        load[j] -= 2.0 * model->mode[j].decay * order * drift->modal[n + 1][j];
    }
    for (int j = 0; j < model->modes && model->coupled; ++j) {
        for (int i = 0; i < model->modes; ++i) {
            load[j] -= model->coupling[j][i] * order * drift->modal[n + 1][i];
        }
    }
}

static void push(const vi_structure_model *model, int k, double force, double load[])
{
    for (int j = 0; j < model->modes; ++j) {
        load[j] -= model->shape[k][j] * force;
    }
}

/* The forces that keep the held contacts at rest: shape_k . q'' = 0 for each of them. */
static void hold(vi_drift *drift, const vi_drift_start *start, int n, double load[])
{
    const vi_structure_model *model = drift->model;
    double g[VI_PORTS][VI_PORTS], b[VI_PORTS] = {0.0}, f[VI_PORTS];
    int held[VI_PORTS] = {0};
    for (int k = 0; k < model->contacts; ++k) {
        held[k] = start->press[k].kind == VI_PRESS_HOLD;
        for (int l = 0; l < model->contacts; ++l) {
            g[k][l] = start->sign[k] * start->sign[l] * model->compliance[k][l];
        }
        b[k] = held[k] ? start->sign[k] * at_contact(model, k, load) : 0.0;
    }
    vi_solve_active(model->contacts, g, b, held, f);
    for (int k = 0; k < model->contacts; ++k) {
        if (held[k]) {
            drift->force[k][n] = f[k];
            push(model, k, start->sign[k] * f[k], load);
        }
    }
}

static void extend_penetrations(vi_drift *drift, const vi_drift_start *start, int n)
{
    for (int k = 0; k < drift->model->contacts; ++k) {
        const int still = start->press[k].kind == VI_PRESS_HOLD;
        drift->penetration[k][n] = still ? 0.0 : start->sign[k] * at_contact(drift->model, k, drift->modal[n]);
    }
}

static void scale_of_holding(vi_drift *drift, const vi_drift_start *start)
{
    const vi_structure_model *model = drift->model;
    for (int k = 0; k < model->contacts; ++k) {
        double size = 0.0;
        for (int j = 0; j < model->modes; ++j) {
            const vi_mode *mode = &model->mode[j];
            double terms = fabs(mode->force) + fabs(start->held[j]) + mode->stiffness * fabs(start->q[j]);
            terms += vi_structure_drag_size(model, j, start->p);
            for (int l = 0; l < model->contacts; ++l) { /* of stops that yield, and of the others that hold */
                terms += l == k ? 0.0 : fabs(model->shape[l][j] * drift->force[l][0]);
            }
            size += fabs(model->shape[k][j]) * terms;
        }
        drift->force_scale[k] = size / fabs(model->mobility[k][k]);
    }
}

/* A power law's own length: up to where its last terms are below the tolerance. */
static void shorten(vi_drift *drift, const vi_drift_start *start)
{
    const double tolerance = SMALLEST_TERM * drift->model->tolerance;
    for (int k = 0; k < drift->model->contacts; ++k) {
        const double *d = drift->penetration[k];
        if (start->press[k].kind != VI_PRESS_POWER) {
            continue;
        }
        for (int n = drift->order - 1; n <= drift->order; ++n) {
            if (d[n] != 0.0) {
                drift->length = vi_min(drift->length, pow(tolerance * d[0] / fabs(d[n]), 1.0 / (double)n));
            }
        }
    }
}

/* Let the series end with this order. */
static void end_series(vi_drift *drift, int order)
{
    drift->order = order;
    for (int n = order + 1; n <= VI_ORDER; ++n) {
        memset(drift->modal[n], 0, sizeof drift->modal[n]);
        for (int k = 0; k < drift->model->contacts; ++k) {
            drift->penetration[k][n] = 0.0;
        }
    }
    for (int k = 0; k < drift->model->contacts; ++k) {
        for (int n = order - 1; n <= VI_ORDER; ++n) {
            drift->force[k][n] = 0.0;
        }
    }
}

/* Has a power law's series grown too steep to be continued? */
static bool too_steep(const vi_drift *drift, const vi_drift_start *start, int n, double power[VI_PORTS][VI_ORDER + 1])
{
    for (int k = 0; k < drift->model->contacts; ++k) {
        if (start->press[k].kind == VI_PRESS_POWER
            && !(fabs(drift->penetration[k][n + 2]) < LARGEST_COEFFICIENT && fabs(power[k][n]) < LARGEST_COEFFICIENT)) {
            return true;
        }
    }
    return false;
}

void vi_drift_begin(vi_drift *drift, const vi_structure_model *model, const vi_drift_start *start, double length)
{
    double power[VI_PORTS][VI_ORDER + 1], load[VI_MODES];
    const double w = model->clock.angular_frequency;
    double drive[2] = {start->cosine, -w * start->sine};
    int any_held = 0, any_yielding = 0;
    for (int k = 0; k < model->contacts; ++k) {
        any_held |= start->press[k].kind == VI_PRESS_HOLD;
        any_yielding |= start->press[k].kind >= VI_PRESS_LINEAR;
    }
    drift->model = model;
    drift->order = VI_ORDER;
    memset(drift->force, 0, sizeof drift->force);
    for (int j = 0; j < model->modes; ++j) {
        drift->modal[0][j] = 0.0;
        drift->modal[1][j] = start->p[j];
    }
    extend_penetrations(drift, start, 1);
    for (int k = 0; k < model->contacts; ++k) {
        drift->penetration[k][0] = start->penetration[k];
    }
    for (int n = 0; n + 2 <= VI_ORDER; ++n) {
        const double share = 1.0 / ((double)(n + 1) * (double)(n + 2)), next = -drive[0] * w * w * share;
        free_load(drift, start, drive[0], n, load);
        for (int k = 0; k < model->contacts; ++k) {
            if (start->press[k].kind == VI_PRESS_LINEAR || start->press[k].kind == VI_PRESS_POWER) {
                drift->force[k][n] = pressed(drift, k, &start->press[k], n, power[k]);
                push(model, k, start->sign[k] * drift->force[k][n], load);
            }
        }
        if (any_held) {
            hold(drift, start, n, load);
        }
        for (int j = 0; j < model->modes; ++j) {
            drift->modal[n + 2][j] = load[j] * share;
        }
        extend_penetrations(drift, start, n + 2);
        drive[0] = drive[1];
        drive[1] = next;
        if (too_steep(drift, start, n, power)) {
            end_series(drift, n + 1);
            break;
        }
    }
    scale_of_holding(drift, start);
    const double fastest = fastest_rate(model, start);
    drift->length = fastest > 0.0 ? vi_min(length, (any_yielding ? REACH_YIELDING : REACH) / fastest) : length;
    shorten(drift, start);
}

void vi_drift_at(const vi_drift *drift, double u, const double q[], double p_end[], double q_end[])
{
    for (int j = 0; j < drift->model->modes; ++j) {
        double x = drift->modal[VI_ORDER][j], v = 0.0;
        for (int n = VI_ORDER - 1; n >= 0; --n) {
            v = v * u + x;
            x = x * u + drift->modal[n][j];
        }
        q_end[j] = q[j] + x;
        p_end[j] = v;
    }
}

void vi_drift_point(const vi_drift *drift, const double shape[], double polynomial[VI_ORDER + 1])
{
    for (int n = 0; n <= VI_ORDER; ++n) {
        polynomial[n] = vi_structure_at(drift->model, shape, drift->modal[n]);
    }
}
