#include "body/modal/structure_held.h"

#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/modal/structure_forces.h"
#include "contact/complementarity.h"

/* Of its own mobility, what is left to a contact whose point others hold. */
static const double KEPT = 1e-9;

void vi_structure_look_at_held(const vi_structure *s, int k, vi_held_view *view)
{
    const vi_structure_model *model = s->model;
    vi_structure_state *state = s->state;
    double g[VI_PORTS][VI_PORTS], x[VI_PORTS] = {0.0}, unit[VI_PORTS], held[VI_MODES], at[VI_PORTS], sign[VI_PORTS];
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
    vi_solve_active(model->contacts, g, x, active, unit); /* 1 / effective mobility = the diagonal of the inverse */
    view->mobility = unit[k] > 0.0 ? 1.0 / unit[k] : HUGE_VAL;
    x[k] = vi_structure_approach(s, k);
    vi_solve_active(model->contacts, g, x, active, unit);
    memcpy(view->p, state->p, sizeof view->p);
    for (int l = 0; l < model->contacts; ++l) {
        vi_structure_push(s, l, unit[l], view->p);
    }
    const vi_phase phase = vi_structure_phase(s);
    vi_structure_held_now(s, held);
    at[k] = 0.0;
    const vi_drift_start start = {state->q, view->p, phase.cosine, phase.sine, held, state->held_rate, at, sign, press};
    vi_drift drift;
    vi_drift_begin(&drift, model, &start, 1.0);
    view->pressure = drift.force[k][0] * view->mobility;
    view->slope = drift.force[k][1] * view->mobility;
    view->bend = 2.0 * drift.force[k][2] * view->mobility;
    view->noise = VI_ROUNDING * drift.force_scale[k] * fabs(model->mobility[k][k]);
    view->first = vi_structure_first_of_force(s, &drift, k);
    view->lead = view->first <= VI_ORDER ? drift.force[k][view->first] : 0.0;
}

double vi_structure_series_noise(const vi_structure *s, const vi_drift *drift, int k, int n)
{
    const vi_structure_model *model = s->model;
    double terms = 0.0, drive = 1.0, turn = 1.0;
    for (int i = 1; i <= n - 2; ++i) {
        drive *= model->clock.angular_frequency / (double)i;
        turn *= (i == 1 ? 1.0 : model->fastest) / (double)i;
    }
    for (int j = 0; j < model->modes; ++j) {
        const vi_mode *mode = &model->mode[j];
        double size = fabs(mode->force) * drive + mode->stiffness * fabs(drift->modal[n - 2][j]);
        size += n == 3 ? fabs(s->state->held_rate[j]) : 0.0;
        for (int i = 0; i < model->modes; ++i) {
            const double damping = vi_structure_damping(model, j, i);
            size += fabs(damping * drift->modal[n - 1][i]) * (double)(n - 1);
        }
        terms += fabs(model->shape[k][j]) * size;
    }
    for (int l = 0; l < model->contacts; ++l) {
        double force = fabs(drift->force[l][n - 2]);
        if (s->state->status[l] == VI_CONTACT_YIELDING) { /* which turns the rounding of its rate into force */
            const vi_contact_force slopes = vi_structure_yield(s, l);
            const double stiffness = slopes.stiffness + slopes.damping * model->fastest;
            force += stiffness * vi_structure_velocity_size(s, l) * turn;
        }
        terms += vi_structure_push_size(model, k, l) * force;
    }
    return VI_ROUNDING * terms / ((double)n * (double)(n - 1));
}

int vi_structure_first_of_force(const vi_structure *s, const vi_drift *drift, int k)
{
    for (int n = 1; n <= VI_ORDER - 2; ++n) {
        const double pressure = drift->force[k][n] * s->model->compliance[k][k] / (double)((n + 1) * (n + 2));
        if (fabs(pressure) > vi_structure_series_noise(s, drift, k, n + 2)) {
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
    double column[VI_PORTS], share[VI_PORTS], left = g[k][k];
    int held[VI_PORTS] = {0};
    for (int l = 0; l < s->model->contacts; ++l) {
        held[l] = l != k && s->state->status[l] == VI_CONTACT_HELD;
        column[l] = g[l][k];
    }
    vi_solve_active(s->model->contacts, g, column, held, share);
    for (int l = 0; l < s->model->contacts; ++l) {
        left -= g[k][l] * share[l];
    }
    return vi_max(left, KEPT * g[k][k]);
}

bool vi_structure_is_kept(const vi_structure *s, int k)
{
    return others_hold(s, k) && vi_structure_mobility_left(s, k) <= KEPT * s->model->compliance[k][k];
}

bool vi_structure_only_touches(const vi_structure *s, int k)
{
    if (!others_hold(s, k)) {
        return false;
    }
    const double speed = vi_structure_velocity_size(s, k);
    const double reach = s->model->fastest > 0.0 ? speed / s->model->fastest : 0.0; /* within a radian */
    if (fabs(vi_structure_clearance(s, k)) > VI_ROUNDING * (vi_structure_displacement_size(s, k) + reach)
        || fabs(vi_structure_approach(s, k)) > VI_ROUNDING * speed) {
        return false;
    }
    return vi_structure_is_kept(s, k);
}
