#include "body/modal/entry_flow.h"

#include <math.h>
#include <string.h>

#include "motion/majorant.h"
#include "motion/power_series.h"

/* Last terms of depth and modes, relative to the tolerance times the first terms, above which the segment ends. */
static const double SMALLEST_TERM = 0.01;

/* The equation of the modes, with the force of the contact. */
typedef struct {
    const vi_structure_model *model;
    const vi_drift_start *start;
    int contact;
    int32_t shift;         /* power of r with which d^exponent begins */
    vi_power_series power; /* e^exponent */
} entry;

/* Coefficient n of the contact's force: stiffness r^shift e^exponent (1 + damping d'), with d' = e + r e' / 2. The
 * product with e follows from the product with e': (e^exponent e)' = (exponent + 1) e^exponent e'. */
static double force(entry *at, const double d[], int n)
{
    const vi_press *press = &at->start->press[at->contact];
    const int order = n - at->shift;
    double drag = at->power.power * at->power.base_first;
    if (order < 0) {
        return 0.0;
    }
    if (order > 0) {
        drag = vi_power_series_extend(&at->power, d[order + 2]) * ((press->exponent + 1.0) / (double)order + 0.5);
    }
    return press->stiffness * (at->power.power + press->damping * drag);
}

/* Coefficient n + 4 of the motion, from coefficient n of the accelerations: (r^n)'' = n (n - 2) r^(n - 4) / 4 in
 * time. */
static void extend(vi_drift *drift, const entry *at, double drive, int n)
{
    const vi_structure_model *model = at->model;
    const double *x = drift->modal[n], *v = drift->modal[n + 2], *shape = model->shape[at->contact];
    const double push = at->start->sign[at->contact] * drift->force[at->contact][n], rate = 0.5 * (double)(n + 2);
    const double share = 4.0 / ((double)(n + 4) * (double)(n + 2));
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        double load = drive * mode->force - mode->stiffness * x[j] - rate * (2.0 * mode->decay * v[j])
                      - shape[j] * push;
        load += n == 0 ? at->start->drive.held[j] - mode->stiffness * at->start->q[j] : 0.0;
        load += n == 2 ? at->start->drive.held_rate[j] : 0.0;
        drift->modal[n + 4][j] = share * load;
    }
    for (int k = 0; k < model->contacts; ++k) {
        drift->penetration[k][n + 4] = at->start->sign[k]
                                       * vi_structure_at(model, model->shape[k], drift->modal[n + 4]);
    }
}

static void start_series(vi_drift *drift, const entry *at)
{
    const vi_structure_model *model = at->model;
    memset(drift->force, 0, (size_t)model->contacts * sizeof drift->force[0]);
    memset(drift->force_scale, 0, sizeof drift->force_scale);
    memset(drift->modal, 0, 4 * sizeof drift->modal[0]);
    memcpy(drift->modal[2], at->start->p, (size_t)vi_structure_modes(model) * sizeof(double));
    for (int k = 0; k < model->contacts; ++k) {
        drift->penetration[k][0] = k == at->contact ? 0.0 : at->start->penetration[k];
        drift->penetration[k][1] = drift->penetration[k][3] = 0.0;
        drift->penetration[k][2] = at->start->sign[k] * vi_structure_at(model, model->shape[k], drift->modal[2]);
    }
}

static double whole_power(double r, int n)
{
    double power = 1.0;
    for (double square = r; n > 0; n /= 2, square *= square) {
        power *= n % 2 == 1 ? square : 1.0;
    }
    return power;
}

/* Terms n of the depth and of the modes at r = 1, relative to their first terms. */
static double share_of_terms(const vi_drift *drift, const double depth[], int n)
{
    double first = 0.0, last = 0.0;
    for (int j = 0; j < vi_structure_modes(drift->model); ++j) {
        first = vi_max(first, fabs(drift->modal[2][j]));
        last = vi_max(last, fabs(drift->modal[n][j]));
    }
    return vi_max(fabs(depth[n]) / depth[2], last / first);
}

/* The largest r at which the last terms are within the tolerance. If the contact alone acts, only each (shift + 2)-th
 * term is above 0. */
static double reach(const vi_drift *drift, const entry *at)
{
    const double *depth = drift->penetration[at->contact], tolerance = SMALLEST_TERM * drift->model->tolerance;
    double r = HUGE_VAL;
    for (int n = VI_ORDER; n > VI_ORDER - at->shift - 2; --n) {
        const double share = share_of_terms(drift, depth, n);
        if (share > 0.0 && !(share * whole_power(r, n - 2) <= tolerance)) {
            r = pow(tolerance / share, 1.0 / (double)(n - 2));
        }
    }
    return r;
}

bool vi_entry_begin(vi_drift *drift, const vi_structure_model *model, const vi_drift_start *start, int k, double length)
{
    const double doubled = 2.0 * start->press[k].exponent, w = model->clock.angular_frequency;
    double drive[2] = {start->drive.phase.cosine, -w * start->drive.phase.sine};
    if (!(doubled == floor(doubled)) || !(doubled < VI_ORDER / 2)) {
        return false;
    }
    entry at = {.model = model, .start = start, .contact = k, .shift = (int32_t)doubled};
    drift->model = model;
    drift->order = VI_ORDER;
    drift->rooted = 1;
    start_series(drift, &at);
    vi_power_series_begin(&at.power, start->press[k].exponent, drift->penetration[k][2]);
    for (int n = 0; n + 4 <= VI_ORDER; ++n) {
        const double whole = 0.5 * (double)n;
        drift->force[k][n] = force(&at, drift->penetration[k], n);
        extend(drift, &at, n % 2 == 0 ? drive[0] : 0.0, n);
        if (n % 2 == 0) {
            const double next = -drive[0] * w * w / ((whole + 1.0) * (whole + 2.0));
            drive[0] = drive[1];
            drive[1] = next;
        }
    }
    const double r = reach(drift, &at);
    drift->length = vi_min(length, r * r);
    return isfinite(drift->penetration[k][VI_ORDER]) && drift->length > 0.0;
}
