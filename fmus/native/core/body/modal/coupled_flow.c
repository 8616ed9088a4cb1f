#include "body/modal/coupled_flow.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "contact/complementarity.h"
#include "motion/majorant.h"

/* Length of a segment times the fastest rate: the first term left out is below 1e-17 of the motion, and the largest
 * terms are 12 times it. */
static const double REACH = 2.5;
/* Of a power law the terms must fall by this over a segment: it has a singularity where the contact ends. */
static const double SMALLEST_TERM = 0.01;
/* In the first instants of a power law coefficient n is of size (rate / penetration)^n: the series ends before a
 * product of two of them overflows. */
static const double LARGEST_COEFFICIENT = 1e140;

/* Rate at which the Taylor coefficients of no motion grow faster, rad/s. */
static double fastest_rate(const vi_structure_model *model, const vi_drift_start *start)
{
    double stiffness = 0.0, damping = 0.0, drag = model->coupled ? model->fastest : 0.0;
    for (int k = 0; k < model->contacts; ++k) {
        const vi_press *press = &start->press[k];
        if (press->kind == VI_PRESS_LINEAR) {
            stiffness += fabs(press->stiffness) * model->compliance[k][k];
            damping += fabs(press->damping) * model->compliance[k][k];
        }
    }
    if (stiffness == 0.0 && damping == 0.0) {
        return model->fastest;
    }
    for (int j = 0; j < model->modes && !model->coupled; ++j) {
        drag = vi_max(drag, 2.0 * model->mode[j].decay);
    }
    const double decay = 0.5 * (drag + damping);
    return decay + sqrt(decay * decay + model->fastest * model->fastest + stiffness);
}

/* ---- rows of modes ---- */

/* The equation of the modes; its rows end with modes that do not move. */
typedef struct {
    int width;                                             /* of the rows in use */
    double stiffness[VI_ROW], drag[VI_ROW], force[VI_ROW]; /* drag: 0 where the damping couples the modes */
    double held[2][VI_ROW];                                /* constant load at the start, and its slope */
    double toward[VI_PORTS][VI_ROW];                       /* shapes, towards the stops */
} equation;

static int whole_lanes(int count)
{
    return (count + VI_LANES - 1) / VI_LANES * VI_LANES;
}

static void set_up(equation *e, const vi_structure_model *model, const vi_drift_start *start)
{
    e->width = whole_lanes(model->modes);
    for (int j = model->modes; j < e->width; ++j) {
        e->stiffness[j] = e->drag[j] = e->force[j] = e->held[0][j] = e->held[1][j] = 0.0;
    }
    for (int j = 0; j < model->modes; ++j) {
        const vi_mode *mode = &model->mode[j];
        e->stiffness[j] = mode->stiffness;
        e->drag[j] = model->coupled ? 0.0 : 2.0 * mode->decay;
        e->force[j] = mode->force;
        e->held[0][j] = start->held[j] - mode->stiffness * start->q[j];
        e->held[1][j] = start->held_rate[j];
    }
    for (int k = 0; k < model->contacts; ++k) {
        for (int j = 0; j < e->width; ++j) {
            e->toward[k][j] = j < model->modes ? start->sign[k] * model->shape[k][j] : 0.0;
        }
    }
}

/* Sum of the products of two rows, lane by lane: the same bits for vectors of any width. */
static inline double dot(const double *restrict a, const double *restrict b, int width)
{
    double sum[VI_LANES] = {0.0};
    for (int j = 0; j < width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            sum[i] += a[j + i] * b[j + i];
        }
    }
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

/* row += factor * other */
static inline void add_row(double *restrict row, double factor, const double *restrict other, int width)
{
    for (int j = 0; j < width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            row[j + i] += factor * other[j + i];
        }
    }
}

/* Taylor coefficient n of everything in q'' but the forces of contacts. */
static void free_load(const equation *restrict e, const vi_drift *drift, double drive, int n, double *restrict load)
{
    const vi_structure_model *model = drift->model;
    const double *restrict x = drift->modal[n], *restrict v = drift->modal[n + 1];
    const double order = (double)(n + 1);
    for (int j = 0; j < e->width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            load[j + i] = drive * e->force[j + i] - e->stiffness[j + i] * x[j + i] - order * (e->drag[j + i] * v[j + i]);
        }
    }
    if (n < 2) {
        add_row(load, 1.0, e->held[n], e->width);
    }
    for (int j = 0; j < model->modes && model->coupled; ++j) {
        for (int i = 0; i < model->modes; ++i) {
            load[j] -= model->coupling[j][i] * order * v[i];
        }
    }
}

static void extend_penetrations(vi_drift *drift, const equation *e, const vi_drift_start *start, int n)
{
    for (int k = 0; k < drift->model->contacts; ++k) {
        const bool still = start->press[k].kind == VI_PRESS_HOLD;
        drift->penetration[k][n] = still ? 0.0 : dot(e->toward[k], drift->modal[n], e->width);
    }
}

/* ---- forces of contacts ---- */

/* The series of (penetration ^ exponent), each coefficient told as soon as the motion allows: power' d = exponent power d'.
 * Powers are stored backwards, so that a coefficient of a product is the sum of products of two rows. */
enum { VI_SERIES_ROOM = VI_ORDER + VI_LANES };

typedef struct {
    double depth[VI_SERIES_ROOM], rate[VI_SERIES_ROOM];   /* coefficient n of d, and n times it */
    double behind[VI_SERIES_ROOM], turned[VI_SERIES_ROOM]; /* coefficient n of the power, at [VI_ORDER - n], and n times it */
    double power;                                          /* its coefficient that is needed next */
} power_series;

static void start_power(power_series *p, const vi_press *press, double depth)
{
    memset(p, 0, sizeof *p);
    p->depth[0] = depth;
    p->power = p->behind[VI_ORDER] = pow(depth, press->exponent);
}

/* Coefficient n of the force of a power law; coefficient n + 1 of d is known. */
static double pressed_by_power(power_series *p, const vi_press *press, const double d[], int n)
{
    const double order = (double)(n + 1), power = p->power;
    const int width = whole_lanes(n + 2), last = VI_ORDER - 1 - n;
    p->depth[n + 1] = d[n + 1];
    p->rate[n + 1] = order * d[n + 1];
    const double drag = dot(p->rate, &p->behind[last], width); /* of power d' */
    const double turn = press->exponent * drag - dot(p->depth, &p->turned[last], width);
    p->power = p->behind[last] = turn * (1.0 / (order * d[0]));
    p->turned[last] = order * p->power;
    return press->stiffness * (power + press->damping * drag);
}

static double pressed_by_line(const vi_press *press, const double d[], int n)
{
    const double rate = (double)(n + 1) * d[n + 1];
    return (n == 0 ? press->constant : 0.0) + press->stiffness * d[n] + press->damping * rate;
}

/* What the contacts that yield add to coefficient n of the load. */
static void press(vi_drift *drift, const equation *e, const vi_drift_start *start, int n, power_series power[],
                  double *restrict load)
{
    for (int k = 0; k < drift->model->contacts; ++k) {
        const vi_press *law = &start->press[k];
        if (law->kind == VI_PRESS_LINEAR || law->kind == VI_PRESS_POWER) {
            const double *d = drift->penetration[k];
            drift->force[k][n] = law->kind == VI_PRESS_LINEAR ? pressed_by_line(law, d, n)
                                                              : pressed_by_power(&power[k], law, d, n);
            add_row(load, -drift->force[k][n], e->toward[k], e->width);
        }
    }
}

/* The forces that keep the held contacts at rest: shape_k . q'' = 0 for each of them. */
static void hold(vi_drift *drift, const equation *e, const vi_drift_start *start, int n, double *restrict load)
{
    const vi_structure_model *model = drift->model;
    double g[VI_PORTS][VI_PORTS], b[VI_PORTS] = {0.0}, f[VI_PORTS];
    int held[VI_PORTS] = {0};
    for (int k = 0; k < model->contacts; ++k) {
        held[k] = start->press[k].kind == VI_PRESS_HOLD;
        for (int l = 0; l < model->contacts; ++l) {
            g[k][l] = start->sign[k] * start->sign[l] * model->compliance[k][l];
        }
        b[k] = held[k] ? dot(e->toward[k], load, e->width) : 0.0;
    }
    vi_solve_active(model->contacts, g, b, held, f);
    for (int k = 0; k < model->contacts; ++k) {
        if (held[k]) {
            drift->force[k][n] = f[k];
            add_row(load, -f[k], e->toward[k], e->width);
        }
    }
}

/* ---- a drift ---- */

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

/* Has a power law's series grown too steep to be continued beyond coefficient n + 2? */
static bool too_steep(const vi_drift *drift, const vi_drift_start *start, int n, const power_series power[])
{
    for (int k = 0; k < drift->model->contacts; ++k) {
        if (start->press[k].kind == VI_PRESS_POWER
            && !(fabs(drift->penetration[k][n + 2]) < LARGEST_COEFFICIENT && fabs(power[k].power) < LARGEST_COEFFICIENT)) {
            return true;
        }
    }
    return false;
}

static bool presses(const vi_drift_start *start, const vi_structure_model *model, vi_press_kind kind)
{
    for (int k = 0; k < model->contacts; ++k) {
        if (start->press[k].kind == kind) {
            return true;
        }
    }
    return false;
}

static void start_series(vi_drift *drift, const equation *e, const vi_drift_start *start, power_series power[])
{
    const vi_structure_model *model = drift->model;
    memset(drift->force, 0, (size_t)model->contacts * sizeof drift->force[0]);
    for (int j = 0; j < e->width; ++j) {
        drift->modal[0][j] = 0.0;
        drift->modal[1][j] = j < model->modes ? start->p[j] : 0.0;
    }
    extend_penetrations(drift, e, start, 1);
    for (int k = 0; k < model->contacts; ++k) {
        drift->penetration[k][0] = start->penetration[k];
        if (start->press[k].kind == VI_PRESS_POWER) {
            start_power(&power[k], &start->press[k], start->penetration[k]);
        }
    }
}

void vi_drift_begin(vi_drift *drift, const vi_structure_model *model, const vi_drift_start *start, double length)
{
    double load[VI_ROW];
    power_series power[VI_PORTS];
    equation e;
    const double w = model->clock.angular_frequency;
    double drive[2] = {start->cosine, -w * start->sine};
    const bool any_held = presses(start, model, VI_PRESS_HOLD);
    drift->model = model;
    drift->order = VI_ORDER;
    set_up(&e, model, start);
    start_series(drift, &e, start, power);
    for (int n = 0; n + 2 <= VI_ORDER; ++n) {
        const double share = 1.0 / ((double)(n + 1) * (double)(n + 2)), next = -drive[0] * w * w * share;
        free_load(&e, drift, drive[0], n, load);
        press(drift, &e, start, n, power, load);
        if (any_held) {
            hold(drift, &e, start, n, load);
        }
        for (int j = 0; j < e.width; ++j) {
            drift->modal[n + 2][j] = share * load[j];
        }
        extend_penetrations(drift, &e, start, n + 2);
        drive[0] = drive[1];
        drive[1] = next;
        if (too_steep(drift, start, n, power)) {
            end_series(drift, n + 1);
            break;
        }
    }
    scale_of_holding(drift, start);
    const double fastest = fastest_rate(model, start);
    drift->length = fastest > 0.0 ? vi_min(length, REACH / fastest) : length;
    shorten(drift, start);
}

void vi_drift_at(const vi_drift *drift, double u, const double q[], double p_end[], double q_end[])
{
    const int modes = drift->model->modes;
    for (int j = 0; j < modes; j += VI_LANES) {
        double x[VI_LANES], v[VI_LANES] = {0.0};
        memcpy(x, &drift->modal[VI_ORDER][j], sizeof x);
        for (int n = VI_ORDER - 1; n >= 0; --n) {
            const double *c = &drift->modal[n][j];
            for (int i = 0; i < VI_LANES; ++i) {
                v[i] = v[i] * u + x[i];
                x[i] = x[i] * u + c[i];
            }
        }
        for (int i = 0; i < VI_LANES && j + i < modes; ++i) {
            q_end[j + i] = q[j + i] + x[i];
            p_end[j + i] = v[i];
        }
    }
}

void vi_drift_point(const vi_drift *drift, const double shape[], double polynomial[VI_ORDER + 1])
{
    for (int n = 0; n <= VI_ORDER; ++n) {
        polynomial[n] = vi_structure_at(drift->model, shape, drift->modal[n]);
    }
}
