#include "body/modal/structure/drift.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/modal/entry_flow.h"
#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "body/modal/stop_motion.h"
#include "body/modal/structure/contact.h"
#include "body/modal/structure/extremes.h"
#include "body/modal/structure/power_contact.h"
#include "body/modal/structure/pressed.h"
#include "body/modal/structure/thin.h"
#include "body/modal/structure/unbounded.h"
#include "contact/complementarity.h"

/* Depth, relative to the depth reached by a thin contact, below which a power law counts as thin. */
static const double ENTRY = 1e-3;

/* Depth, in roundings of the displacement, below which a power law counts as thin too. Steps of its series are parts of
 * the depth and would not move it. */
static const double SHALLOW = 32.0;

/* Velocity change over the way out times the rate, relative to the squared rate, below which the rate is kept. */
static const double COASTS = 1e-2;

/* Does a contact on its way out keep its rate, despite the force that still presses it? */
static bool coasts(const vi_structure *s, int k, double depth, double rate)
{
    const double force = vi_structure_yield(s, k).force;
    return rate < 0.0 && force * s->model->compliance[k][k] * depth <= COASTS * rate * rate;
}

static void look(const vi_structure *s, vi_situation *now)
{
    now->any_thin = now->any_acceleration = false;
    now->length = HUGE_VAL;
    vi_structure_held_now(s, now->held);
    for (int k = 0; k < s->model->contacts; ++k) {
        now->at[k] = -vi_structure_clearance(s, k);
        now->sign[k] = vi_structure_direction(s, k);
        now->press[k] = vi_structure_press(s, k);
        now->thin[k] = 0;
        if (now->press[k].kind == VI_PRESS_NONE && s->state->status[k] == VI_CONTACT_RECEDING
            && vi_structure_surface_lags(s, k)) {
            now->length = vi_min(now->length, s->contacts[k].relaxation_time);
        }
        now->kept[k] = s->state->status[k] == VI_CONTACT_YIELDING && !vi_structure_stops_move(s->model)
                       && vi_structure_is_kept(s, k);
        if (now->kept[k]) { /* constant force, since rounding would move it and set the step */
            now->press[k] = (vi_press){VI_PRESS_LINEAR, vi_structure_yield(s, k).force, 0.0, 0.0, 1.0};
        }
    }
}

/* Depth of rounding size of contact k, m. */
static double shallow_depth(const vi_structure *s, int k)
{
    return SHALLOW * DBL_EPSILON * vi_structure_displacement_size(s, k);
}

/* Is a power law pressed in deeper than any thin contact? A thin contact lasts a radian at most. */
static bool is_deep(const vi_structure *s, const vi_situation *now, int k, double rate, double acceleration)
{
    const double radian = s->model->fastest > 0.0 ? 1.0 / s->model->fastest : 1.0;
    const double thickest = rate > 0.0 ? ENTRY * (rate + 0.5 * fabs(acceleration) * radian) * radian : -rate * radian;
    return now->at[k] > thickest && now->at[k] > shallow_depth(s, k);
}

/* Is power law k thin? *time: for how long at most. */
static bool is_thin(const vi_structure *s, const vi_situation *now, int k, double rate, double acceleration,
                    double *time)
{
    const double depth = vi_max(0.0, now->at[k]), shallow = shallow_depth(s, k);
    *time = vi_thin_time(s, k, rate, now->acceleration, rate < 0.0 && depth > shallow ? -depth / rate : 0.0);
    /* on the way in it is thin while its series would need steps much shorter than *time */
    const double reached = (rate + 0.5 * vi_max(0.0, acceleration) * *time) * *time;
    const double entered = vi_max(ENTRY * reached, shallow);
    const double left = vi_max(-rate * *time, coasts(s, k, depth, rate) ? shallow : 0.0);
    if (rate > 0.0) {
        return depth <= entered;
    }
    return depth <= shallow ? depth <= left || depth == 0.0
                            : depth <= left && vi_thin_lasts(s, k, rate, now->acceleration, *time);
}

static void look_at_power(const vi_structure *s, vi_situation *now, int k, double rate)
{
    double force[VI_PORTS], time;
    if (!now->any_acceleration) {
        vi_structure_accelerate(s, now->acceleration, force);
        now->any_acceleration = true;
    }
    const double a = vi_structure_at(s->model, s->model->shape[k], now->acceleration) * vi_structure_direction(s, k);
    if (!is_deep(s, now, k, rate, a) && is_thin(s, now, k, rate, a, &time)) {
        now->thin[k] = 1;
        now->any_thin = true;
        now->press[k] = (vi_press){.kind = VI_PRESS_NONE};
        now->length = vi_min(now->length, time); /* on its way out it may turn round before it is out */
    }
}

/* Find the thin power laws, and how far the series of the others may go. */
static void look_at_powers(const vi_structure *s, vi_situation *now)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        if (now->press[k].kind == VI_PRESS_POWER) {
            const double rate = vi_structure_approach(s, k);
            if (rate > 0.0 || !is_deep(s, now, k, rate, 0.0)) {
                look_at_power(s, now, k, rate);
            }
            if (rate < 0.0 && !now->thin[k]) {
                /* not past a turning point next to depth 0: there the power law is |d|^n, but its series is d^n */
                now->length = vi_min(now->length, -now->at[k] / rate);
            }
        }
    }
}

/* The contact that begins to press now, by a power law, while all others are free and off their stops; -1: none. */
static int entering(const vi_structure *s, const vi_situation *now)
{
    int found = -1;
    for (int k = 0; k < s->model->contacts; ++k) {
        if (s->state->status[k] == VI_CONTACT_YIELDING && s->state->leaving[k] == 1
            && now->press[k].kind == VI_PRESS_POWER && found < 0 && vi_structure_approach(s, k) > 0.0) {
            found = k;
        } else if (s->state->status[k] != VI_CONTACT_FREE
                   || (vi_structure_watched(s, k)
                       && -now->at[k] <= VI_ROUNDING * vi_structure_displacement_size(s, k))) {
            return -1;
        }
    }
    return s->model->coupled || !vi_structure_is_plain(s) ? -1 : found;
}

/* Follow the beginning of a contact if it goes in further than rounding. */
static bool enter(const vi_structure *s, const vi_situation *now, const vi_drift_start *start, double length,
                  vi_drift *drift)
{
    double depth[4];
    const int k = entering(s, now);
    if (k < 0 || !vi_entry_begin(drift, s->model, start, k, length)) {
        return false;
    }
    vi_polynomial_at(drift->penetration[k], sqrt(drift->length), depth);
    return depth[0] > shallow_depth(s, k);
}

/* ---- one segment ---- */

static void add_impulses(const vi_structure *s, const vi_drift *drift, const vi_situation *now, double u)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        if (now->thin[k]) {
            vi_thin_impulse(s, k, now->at[k], drift->penetration[k][1], u);
        } else if (s->state->status[k] == VI_CONTACT_YIELDING) {
            s->state->touch_down[k].impulse += vi_drift_impulse(drift, k, u);
        }
    }
}

/* Kinetic and elastic energy of the modes, J. */
static double energy_now(const vi_structure *s)
{
    double elastic = 0.0;
    for (int j = 0; j < vi_structure_free_modes(s->model); ++j) {
        elastic += 0.5 * s->model->mode[j].stiffness * s->state->q[j] * s->state->q[j];
    }
    return vi_structure_kinetic(s) + elastic;
}

/* Add the impulses of the held contacts, which keep their points in place against the impulses of the others. */
static void bear(const vi_structure *s, double impulse[VI_PORTS])
{
    double g[VI_PORTS][VI_PORTS], approach[VI_PORTS] = {0.0}, borne[VI_PORTS];
    int held[VI_PORTS] = {0};
    vi_structure_signed(s, s->model->compliance, g);
    for (int k = 0; k < s->model->contacts; ++k) {
        held[k] = s->state->status[k] == VI_CONTACT_HELD;
        for (int l = 0; l < s->model->contacts; ++l) {
            approach[k] -= g[k][l] * impulse[l];
        }
    }
    vi_solve_active(s->model->contacts, g, approach, held, borne);
    for (int k = 0; k < s->model->contacts; ++k) {
        impulse[k] += borne[k];
    }
}

/* Finish a segment: add impulses of thin contacts, project held contacts. Stops take the lost energy. */
static void finish(const vi_structure *s, const vi_drift *drift, const vi_situation *now, double u)
{
    const bool follow = now->any_thin && s->state->follow_energies;
    const double before = follow ? energy_now(s) : 0.0;
    double impulse[VI_PORTS] = {0.0};
    for (int k = 0; k < s->model->contacts; ++k) {
        impulse[k] = now->thin[k] ? -s->state->touch_down[k].impulse : 0.0;
    }
    add_impulses(s, drift, now, u);
    for (int k = 0; k < s->model->contacts; ++k) {
        impulse[k] += now->thin[k] ? s->state->touch_down[k].impulse : 0.0;
    }
    vi_structure_project(s);
    if (follow) {
        double work = 0.0;
        if (vi_structure_stops_move(s->model)) {
            bear(s, impulse);
            work = vi_stop_motions_work(s, impulse);
        }
        s->state->energies.forcing_work += work;
        s->state->energies.contact_loss += before - energy_now(s) + work;
    }
}

static void follow_energies(const vi_structure *s, const vi_drift *drift, const vi_situation *now, double u)
{
    int still[VI_PORTS] = {0};
    for (int k = 0; k < s->model->contacts; ++k) {
        double moved[VI_ORDER + 1];
        memcpy(moved, drift->penetration[k], sizeof moved);
        moved[0] = 0.0;
        still[k] = s->state->status[k] == VI_CONTACT_YIELDING
                   && vi_structure_stays(s, drift, k, moved, vi_drift_variable(drift, u));
    }
    vi_energies_of_drift(s, drift, now->held, still, u);
}

/* Does nothing move, now and later? So it is for a body at rest on a stop under constant loads. */
static bool at_rest_for_good(const vi_structure *s, const vi_drift *drift, const vi_situation *now)
{
    const vi_structure_model *model = s->model;
    if (s->record->periods) {
        return false;
    }
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        const bool forced = (mode->force != 0.0 && model->clock.angular_frequency > 0.0) || !vi_structure_is_plain(s);
        const double load = fabs(now->held[j]) + fabs(mode->force) + fabs(mode->stiffness * s->state->q[j]);
        if (forced || s->state->held_rate[j] != 0.0 || s->state->p[j] != 0.0
            || fabs(2.0 * drift->modal[2][j]) > VI_ROUNDING * load) {
            return false;
        }
    }
    return true;
}

/* Cost of a drift, in evaluations of a mode. */
static int64_t drift_evaluations(const vi_structure_model *model)
{
    const int64_t modes = vi_structure_modes(model);
    return VI_ORDER * modes + (model->coupled ? modes * modes / 2 : 0);
}

double vi_structure_drift(const vi_structure *s, double length, double room, vi_drift_event *event, int *k)
{
    vi_structure_state *state = s->state;
    const double rested = vi_structure_rest_on(s, length, room);
    if (rested > 0.0) {
        *event = VI_DRIFT_NO_EVENT;
        *k = -1;
        return rested;
    }
    double loads[VI_MODES];
    vi_situation now;
    vi_drift drift;
    state->series += 1;
    look(s, &now);
    vi_budget_spend(&state->budget, drift_evaluations(s->model));
    const vi_drift_start start = {state->q, state->p, vi_structure_drive_now(s, loads), now.at, now.sign, now.press};
    if (!enter(s, &now, &start, length + room, &drift)) {
        look_at_powers(s, &now);
        const double pressed = vi_structure_press_on(s, &now, &start, length);
        if (pressed > 0.0) {
            *event = VI_DRIFT_NO_EVENT;
            *k = -1;
            return pressed;
        }
        vi_drift_begin(&drift, s->model, &start, vi_min(length + room, now.length));
    }
    const bool to_end = drift.length >= length;
    const double reach = to_end ? length : drift.length;
    const vi_event_found first = vi_structure_first_event(s, &drift, &now, reach, vi_max(reach, drift.length));
    *event = first.event;
    *k = first.contact;
    double u = first.time;
    if (first.event == VI_DRIFT_NO_EVENT && at_rest_for_good(s, &drift, &now)) {
        return length;
    }
    if (vi_structure_grows(s->model) && vi_unbounded_drift(s, &drift, &u)) {
        *event = VI_DRIFT_NO_EVENT;
    }
    if (s->record->extrema) {
        vi_extremes_of_drift(s, &drift, u);
    }
    if (state->follow_energies) {
        follow_energies(s, &drift, &now, u);
    }
    if (s->record->impacts) {
        vi_peaks_of_drift(s, &drift, u);
    }
    double q[VI_MODES];
    memcpy(q, state->q, sizeof q);
    vi_drift_at(&drift, u, q, state->p, state->q);
    finish(s, &drift, &now, u);
    if (state->follow_energies) {
        vi_energies_of_rounding(s, &drift, q, now.held, u);
    }
    return u;
}
