#include "body/modal/held.h"

#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/modal/forces.h"
#include "contact/complementarity.h"

/* Remaining mobility, relative to a contact's own, below which other held contacts keep its point in place. */
static const double LEAST_MOBILITY = 1e-9;

void vi_structure_look_at_held(const vi_structure *s, int k, vi_held_view *view)
{
    const vi_structure_model *model = s->model;
    vi_structure_state *state = s->state;
    double g[VI_PORTS][VI_PORTS], x[VI_PORTS] = {0.0}, unit[VI_PORTS], loads[VI_MODES], at[VI_PORTS], sign[VI_PORTS];
    int active[VI_PORTS] = {0};
    vi_press press[VI_PORTS];
    for (int l = 0; l < model->contacts; ++l) {
        press[l] = vi_structure_press(s, l);
        at[l] = -vi_structure_clearance(s, l);
        sign[l] = vi_structure_direction(s, l);
        if (l == k) {
            press[l] = (vi_press){.kind = VI_PRESS_HOLD};
        } else if (press[l].kind == VI_PRESS_POWER && !(at[l] > 0.0)) {
            press[l] = (vi_press){.kind = VI_PRESS_NONE};
        }
        active[l] = press[l].kind == VI_PRESS_HOLD;
    }
    vi_structure_signed(s, s->model->compliance, g);
    x[k] = 1.0;
    vi_solve_active(model->contacts, g, x, active, unit); /* 1 / effective mobility is the diagonal of the inverse */
    view->mobility = unit[k] > 0.0 ? 1.0 / unit[k] : HUGE_VAL;
    x[k] = vi_structure_approach(s, k);
    vi_solve_active(model->contacts, g, x, active, unit);
    memcpy(view->p, state->p, sizeof view->p);
    memcpy(view->impulse, unit, (size_t)model->contacts * sizeof unit[0]);
    for (int l = 0; l < model->contacts; ++l) {
        vi_structure_push(s, l, unit[l], view->p);
    }
    vi_structure_clear_rounding(s, state->p, view->p);
    at[k] = 0.0;
    const vi_drift_start start = {state->q, view->p, vi_structure_drive_now(s, loads), at, sign, press};
    vi_drift drift;
    vi_drift_begin(&drift, model, &start, 1.0);
    view->pressure = drift.force[k][0] * view->mobility;
    view->slope = drift.force[k][1] * view->mobility;
    view->bend = 2.0 * drift.force[k][2] * view->mobility;
    view->noise = VI_ROUNDING * drift.force_scale[k] * fabs(model->mobility[k][k]);
    view->first = vi_structure_first_of_force(s, &drift, k);
    view->lead = view->first <= VI_ORDER ? drift.force[k][view->first] : 0.0;
}

/* Size of the further sines' part, and of loads of degree 2 and above, in coefficient n of mode j. */
static double more_size(const vi_series_noise *noise, int j)
{
    const vi_structure *s = noise->s;
    const vi_mode *mode = &s->model->mode[j];
    const int load = noise->n - 2; /* order of the load */
    double size = load >= 2 && load <= vi_structure_degree(s) ? fabs(s->state->higher[load - 2][j]) : 0.0;
    for (int k = 0; k < vi_mode_sines(mode); ++k) {
        double term = fabs(mode->further[k].force);
        for (int n = 1; n <= load; ++n) {
            term *= mode->further[k].angular_frequency / (double)n;
        }
        size += term;
    }
    return size;
}

/* Size of the part of the forcing and of the constant loads in coefficient n of mode j. */
static double load_size(const vi_series_noise *noise, int j)
{
    const vi_mode *mode = &noise->s->model->mode[j];
    double size = fabs(mode->force) * noise->drive + more_size(noise, j);
    if (noise->n == 2) {
        size += fabs(noise->held[j]) + fabs(mode->stiffness * noise->s->state->q[j]);
    } else if (noise->n == 3) {
        size += fabs(noise->s->state->held_rate[j]);
    }
    return size;
}

/* Rounding of coefficient n - 2 of the force of contact l; a yielding stop turns rounding of the motion into force. */
static double force_noise(const vi_series_noise *noise, int l)
{
    const vi_structure *s = noise->s;
    const double own = VI_ROUNDING * fabs(noise->drift->force[l][noise->n - 2]);
    if (s->state->status[l] != VI_CONTACT_YIELDING) {
        return own;
    }
    const vi_contact_force slopes = vi_structure_yield(s, l);
    double displacement = 0.0, rate = 0.0;
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        displacement += fabs(s->model->shape[l][j]) * noise->before[j];
        rate += fabs(s->model->shape[l][j]) * noise->last[j];
    }
    return own + slopes.stiffness * displacement + slopes.damping * (double)(noise->n - 1) * rate;
}

/* Find the rounding of coefficient n from that of coefficients n - 2 and n - 1 and from the terms in its sum. */
static void carry(vi_series_noise *noise)
{
    const vi_structure_model *model = noise->s->model;
    double forces[VI_PORTS], next[VI_MODES];
    const int n = noise->n;
    for (int l = 0; l < model->contacts; ++l) {
        forces[l] = force_noise(noise, l);
    }
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const double stiffness = fabs(model->mode[j].stiffness);
        const double terms = load_size(noise, j) + stiffness * fabs(noise->drift->modal[n - 2][j])
                             + (double)(n - 1) * vi_structure_drag_size(model, j, noise->drift->modal[n - 1]);
        double carried =
            stiffness * noise->before[j] + (double)(n - 1) * vi_structure_drag_size(model, j, noise->last);
        for (int l = 0; l < model->contacts; ++l) {
            carried += fabs(model->shape[l][j]) * forces[l];
        }
        next[j] = (VI_ROUNDING * terms + carried) / ((double)n * (double)(n - 1));
    }
    memcpy(noise->before, noise->last, (size_t)vi_structure_modes(model) * sizeof *next);
    memcpy(noise->last, next, (size_t)vi_structure_modes(model) * sizeof *next);
    noise->drive *= model->clock.angular_frequency / (double)(n - 1);
    ++noise->n;
}

void vi_series_noise_begin(vi_series_noise *noise, const vi_structure *s, const vi_drift *drift)
{
    noise->s = s;
    noise->drift = drift;
    noise->drive = 1.0;
    noise->n = 2;
    vi_structure_held_now(s, noise->held);
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        const vi_mode *mode = &s->model->mode[j];
        const double loads = mode->force_size + fabs(noise->held[j]);
        const double within = mode->natural * fabs(s->state->q[j]) + loads * s->model->radian;
        const double velocity = fabs(drift->modal[1][j]) + within;
        noise->before[j] = 0.0; /* the series begins at the body's place */
        noise->last[j] = VI_ROUNDING * velocity;
    }
    carry(noise);
}

double vi_series_noise_next(vi_series_noise *noise, int k)
{
    const vi_structure_model *model = noise->s->model;
    double sum = 0.0;
    carry(noise);
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        sum += fabs(model->shape[k][j]) * noise->last[j];
    }
    return sum;
}

int vi_structure_first_of_force(const vi_structure *s, const vi_drift *drift, int k)
{
    vi_series_noise noise;
    vi_series_noise_begin(&noise, s, drift);
    for (int n = 1; n <= VI_ORDER - 2; ++n) {
        const double pressure = drift->force[k][n] * s->model->compliance[k][k] / (double)((n + 1) * (n + 2));
        if (fabs(pressure) > vi_series_noise_next(&noise, k)) {
            return n;
        }
    }
    return VI_ORDER + 1;
}

static bool others_hold(const vi_structure *s, int k)
{
    for (int l = 0; l < s->model->contacts; ++l) {
        if (l != k && s->state->status[l] == VI_CONTACT_HELD) {
            return true;
        }
    }
    return false;
}

double vi_structure_mobility_left(const vi_structure *s, int k)
{
    double g[VI_PORTS][VI_PORTS];
    if (!others_hold(s, k)) {
        return s->model->compliance[k][k];
    }
    vi_structure_signed(s, s->model->compliance, g);
    double column[VI_PORTS] = {0.0}, share[VI_PORTS], left = g[k][k];
    int held[VI_PORTS] = {0};
    for (int l = 0; l < s->model->contacts; ++l) {
        held[l] = l != k && s->state->status[l] == VI_CONTACT_HELD;
        column[l] = g[l][k];
    }
    vi_solve_active(s->model->contacts, g, column, held, share);
    for (int l = 0; l < s->model->contacts; ++l) {
        left -= g[k][l] * share[l];
    }
    return vi_max(left, LEAST_MOBILITY * g[k][k]);
}

bool vi_structure_is_kept(const vi_structure *s, int k)
{
    return others_hold(s, k) && vi_structure_mobility_left(s, k) <= LEAST_MOBILITY * s->model->compliance[k][k];
}

bool vi_structure_only_touches(const vi_structure *s, int k)
{
    if (!others_hold(s, k)) {
        return false;
    }
    const double speed = vi_structure_velocity_size(s, k);
    const double reach = s->model->fastest > 0.0 ? speed / s->model->fastest : 0.0; /* displacement within a radian */
    if (fabs(vi_structure_clearance(s, k)) > VI_ROUNDING * (vi_structure_displacement_size(s, k) + reach)
        || fabs(vi_structure_approach(s, k)) > VI_ROUNDING * speed) {
        return false;
    }
    return vi_structure_is_kept(s, k);
}
