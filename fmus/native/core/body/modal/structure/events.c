#include "body/modal/structure/events.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "body/modal/structure/contact.h"
#include "body/modal/structure/thin.h"
#include "motion/majorant.h"

/* Distance of a relaxing surface, relative to the displacements, below which the surface is at rest. */
static const double RELAXED = 1e-16;

/* Press of a receding contact, in roundings, up to which its return is searched. Above, it returns at once. */
static const double MOST_PRESS = 1e4;

/* Take the result of a search: an event, or none up to fall->time. */
static void consider(vi_event_found *first, const vi_fall *fall, vi_drift_event event, int contact)
{
    if (!fall->found) {
        first->searched = vi_min(first->searched, fall->time);
    } else if (fall->time < first->time) {
        *first = (vi_event_found){fall->time, event, contact, first->searched};
    }
}

/* First fall of a polynomial through zero; touches from above are passed over. */
static vi_fall fall_through(const double c[VI_ORDER + 1], double length, double noise)
{
    vi_fall fall = vi_polynomial_fall(c, 0.0, length, noise);
    for (int turn = 0; turn < 8 && fall.found && fall.speed == 0.0; ++turn) {
        const double after = fall.time + vi_max(1e-3 * length, DBL_EPSILON * length);
        if (!(after < length)) {
            return (vi_fall){false, length, 0.0};
        }
        fall = vi_polynomial_fall(c, after, length, noise);
    }
    return fall;
}

bool vi_structure_stays(const vi_structure *s, const vi_drift *drift, int k, const double clearance[], double length)
{
    const double moved = vi_polynomial_size(clearance, length);
    double terms = s->state->status[k] == VI_CONTACT_FREE ? vi_structure_displacement_size(s, k) : 0.0;
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        double size = 0.0;
        for (int n = VI_ORDER; n >= 0; --n) {
            size = size * length + fabs(drift->modal[n][j]);
        }
        terms += fabs(s->model->shape[k][j]) * size;
    }
    /* the loads and the other stops' forces, which holding forces cancel */
    terms += drift->force_scale[k] * fabs(s->model->mobility[k][k]) * length * length;
    for (int l = 0; l < s->model->contacts; ++l) {
        terms += fabs(s->model->compliance[k][l]) * vi_polynomial_size(drift->force[l], length) * length * length;
    }
    return moved <= VI_ROUNDING * terms;
}

/* Divide a series that starts at 0, within rounding, by time to the power `first`. It keeps all other zeros. */
static void divide(double c[VI_ORDER + 1], int first)
{
    for (int n = 0; n <= VI_ORDER; ++n) {
        c[n] = n + first <= VI_ORDER ? c[n + first] : 0.0;
    }
}

/* Set the exactly known start of touching contact k. Thin contacts, which its series leaves out, lift the contact off,
 * or have just ceased to hold it. */
static void correct_start(const vi_structure *s, const vi_situation *now, int k, double clearance[VI_ORDER + 1])
{
    const int exact = s->state->leaving[k];
    clearance[0] = 0.0;
    clearance[1] = exact ? 0.0 : clearance[1];
    if (exact >= 2) {
        clearance[2] = now->any_thin ? vi_max(0.0, clearance[2]) : 0.0;
    } else if (now->any_thin) {
        clearance[2] = -0.5 * vi_structure_direction(s, k)
                       * vi_structure_at(s->model, s->model->shape[k], now->acceleration);
    }
}

/* Divide the clearance of a contact that leaves its stop with neither speed nor acceleration. The first coefficient
 * above rounding moves it; divided by that power of time, the clearance keeps all zeros but the one at the start. False
 * where nothing moves the contact. */
static bool divide_by_start(const vi_structure *s, const vi_drift *drift, int k, double clearance[VI_ORDER + 1])
{
    int first = 2;
    if (clearance[2] == 0.0) {
        vi_series_noise noise;
        vi_series_noise_begin(&noise, s, drift);
        do {
            ++first;
        } while (first <= VI_ORDER && fabs(clearance[first]) <= vi_series_noise_next(&noise, k));
    }
    divide(clearance, first);
    return first <= VI_ORDER;
}

static void arrivals(const vi_structure *s, const vi_drift *drift, const vi_situation *now, int k, double length,
                     vi_event_found *first)
{
    double clearance[VI_ORDER + 1];
    for (int n = 0; n <= VI_ORDER; ++n) {
        clearance[n] = -drift->penetration[k][n];
    }
    if (s->state->status[k] == VI_CONTACT_TOUCHING) {
        correct_start(s, now, k, clearance);
    }
    if (vi_structure_only_touches(s, k)
        || (fabs(clearance[0]) <= VI_ROUNDING * vi_structure_displacement_size(s, k)
            && vi_structure_stays(s, drift, k, clearance, length))) {
        return;
    }
    double noise = VI_ROUNDING * (fabs(s->contacts[k].position) + vi_polynomial_size(clearance, length));
    bool pressed = false;
    if (s->state->status[k] == VI_CONTACT_TOUCHING && s->state->leaving[k] >= 2) {
        if (!divide_by_start(s, drift, k, clearance)) {
            return;
        }
        noise = VI_ROUNDING * vi_polynomial_size(clearance, length);
        pressed = clearance[0] < 0.0; /* pressed by an event at this instant, since it left */
    }
    const vi_fall fall = pressed ? (vi_fall){true, 0.0, 0.0} : vi_polynomial_fall(clearance, 0.0, length, noise);
    consider(first, &fall, VI_DRIFT_ARRIVAL, k);
}

/* First fall of held contact k's force through zero, thin contacts included. Without them it falls at `alone`. */
static vi_fall release_beside_thin(const vi_structure *s, const vi_drift *drift, const vi_situation *now, int k,
                                   vi_fall alone, double length, double noise)
{
    double value[4], size;
    vi_polynomial_at(drift->force[k], alone.time, value);
    if (value[0] + vi_thin_part(s, drift, now->thin, now->at, k, alone.time, &size) <= noise) {
        return alone;
    }
    vi_polynomial_at(drift->force[k], length, value);
    if (value[0] + vi_thin_part(s, drift, now->thin, now->at, k, length, &size) >= 0.0) {
        return (vi_fall){false, length, 0.0};
    }
    double pressed = alone.time, lifted = length;
    for (int halving = 0; halving < DBL_MANT_DIG; ++halving) {
        const double middle = 0.5 * (pressed + lifted);
        vi_polynomial_at(drift->force[k], middle, value);
        *(value[0] + vi_thin_part(s, drift, now->thin, now->at, k, middle, &size) >= 0.0 ? &pressed : &lifted) = middle;
    }
    return (vi_fall){true, lifted, 1.0};
}

/* Is held contact k, which bears no force of its own, pulled off its stop by thin contacts within this length? */
static bool is_pulled(const vi_structure *s, const vi_drift *drift, const vi_situation *now, int k, double length)
{
    double size, value[4];
    vi_polynomial_at(drift->force[k], length, value);
    const double thin = vi_thin_part(s, drift, now->thin, now->at, k, length, &size);
    return value[0] + thin < -VI_ROUNDING * size;
}

static void releases(const vi_structure *s, const vi_drift *drift, const vi_situation *now, int k, double length,
                     vi_event_found *first)
{
    double force[VI_ORDER + 1], size = 0.0;
    memcpy(force, drift->force[k], sizeof force);
    const double thin = now->any_thin ? vi_thin_part(s, drift, now->thin, now->at, k, 0.0, &size) : 0.0;
    const double scale = drift->force_scale[k] * s->model->compliance[k][k] / vi_structure_mobility_left(s, k);
    const double noise = VI_ROUNDING * (scale + size);
    vi_fall fall = {true, 0.0, 1.0};
    vi_drift_event event = VI_DRIFT_RELEASE;
    /* opposite stops at one place may have left a pull of VI_PORTS roundings: the share of each is rounding */
    if (force[0] <= noise && force[0] >= -VI_PORTS * noise && fabs(thin) <= noise) {
        const int lead = vi_structure_first_of_force(s, drift, k);
        event = lead > 1 ? VI_DRIFT_GENTLE_RELEASE : VI_DRIFT_RELEASE;
        divide(force, lead);
        if (force[0] >= 0.0) {
            event = VI_DRIFT_RELEASE;
            fall = fall_through(force, length, VI_ROUNDING * vi_polynomial_size(force, length));
            fall = now->any_thin && fall.found ? release_beside_thin(s, drift, now, k, fall, length, noise) : fall;
        }
        if (lead > VI_ORDER && now->any_thin && is_pulled(s, drift, now, k, length)) {
            fall = (vi_fall){true, 0.0, 1.0};
            event = VI_DRIFT_GENTLE_RELEASE;
        }
    } else if (force[0] + thin >= -noise) {
        fall = force[0] >= -noise ? fall_through(force, length, noise) : fall;
        fall = now->any_thin && fall.found ? release_beside_thin(s, drift, now, k, fall, length, noise) : fall;
    } else {
        event = VI_DRIFT_LIFT;
    }
    consider(first, &fall, event, k);
}

/* Rounding of a number with the sign of a compliant force: the force itself or, for a power law, 1 + damping d'. */
static double pressing_noise(const vi_structure *s, int k)
{
    const vi_press press = vi_structure_stop_press(s, k);
    const double level = press.kind == VI_PRESS_POWER ? 1.0 : press.stiffness * vi_structure_displacement_size(s, k);
    return VI_ROUNDING * (level + (press.damping != 0.0 ? press.damping * vi_structure_velocity_size(s, k) : 0.0));
}

/* Series with the sign of a yielding contact's force: the force itself or, for a power law, 1 + damping d'. The series
 * of a power law's force reaches less far than that of the motion. Near touch-down this force moves nothing yet, but
 * its series has a singularity there. */
static void pressing(const vi_situation *now, int k, const double depth[VI_ORDER + 1], double sense[VI_ORDER + 1])
{
    const vi_press *press = &now->press[k];
    const bool power = press->kind == VI_PRESS_POWER;
    const double stiffness = power ? 0.0 : press->stiffness, damping = press->damping;
    for (int n = 0; n < VI_ORDER; ++n) {
        sense[n] = stiffness * depth[n] + damping * ((double)(n + 1) * depth[n + 1]);
    }
    sense[VI_ORDER] = stiffness * depth[VI_ORDER];
    sense[0] += power ? 1.0 : press->constant;
}

/* Ends of a contact that has just begun: depth = r^2 e(r), whose rate is e + r e' / 2. */
static void ends_of_entry(const vi_drift *drift, const vi_situation *now, int k, double length, vi_event_found *first)
{
    double depth[VI_ORDER + 1], sense[VI_ORDER + 1];
    memcpy(depth, drift->penetration[k], sizeof depth);
    divide(depth, 2);
    for (int n = 0; n <= VI_ORDER; ++n) {
        sense[n] = now->press[k].damping * (0.5 * (double)n + 1.0) * depth[n];
    }
    sense[0] += 1.0;
    if (!vi_polynomial_clears(depth, length)) {
        const vi_fall fall = fall_through(depth, length, VI_ROUNDING * vi_polynomial_size(depth, length));
        consider(first, &fall, VI_DRIFT_SEPARATION, k);
    }
    if (!vi_polynomial_clears(sense, length)) {
        const vi_fall fall = fall_through(sense, length, VI_ROUNDING * vi_polynomial_size(sense, length));
        consider(first, &fall, VI_DRIFT_SEPARATION, k);
    }
}

/* Ends of a yielding contact where its force falls through zero. */
static void ends_of_force(const vi_structure *s, const vi_situation *now, int k, const double depth[VI_ORDER + 1],
                          double length, vi_event_found *first)
{
    double force[VI_ORDER + 1];
    pressing(now, k, depth, force);
    if (vi_polynomial_clears(force, length)) {
        return;
    }
    const double rounding = VI_ROUNDING * vi_polynomial_size(force, length);
    vi_fall fall = {true, 0.0, 1.0};
    /* otherwise an impact elsewhere, or the start, has thrown the point off its stop */
    if (force[0] >= -rounding || force[0] >= -pressing_noise(s, k)) {
        fall = fall_through(force, length, rounding);
    }
    consider(first, &fall, VI_DRIFT_SEPARATION, k);
}

static void separations(const vi_structure *s, const vi_drift *drift, const vi_situation *now, int k, double length,
                        vi_event_found *first)
{
    double depth[VI_ORDER + 1];
    memcpy(depth, drift->penetration[k], sizeof depth);
    if (now->thin[k] && vi_structure_stays(s, drift, k, depth, length)) {
        return;
    }
    if (s->state->leaving[k] == 2) { /* a contact that begins to press without speed must not move out by rounding */
        depth[1] = vi_max(0.0, depth[1]);
        depth[2] = vi_max(0.0, depth[2]);
    }
    if (!now->thin[k]) {
        ends_of_force(s, now, k, depth, length, first);
    }
    if ((depth[0] > 0.0 || depth[1] < 0.0) && !vi_polynomial_clears(depth, length)) {
        const double noise = VI_ROUNDING * (fabs(s->contacts[k].position) + vi_polynomial_size(depth, length));
        const vi_fall fall = fall_through(depth, length, now->thin[k] ? VI_ROUNDING * fabs(depth[0]) : noise);
        consider(first, &fall, VI_DRIFT_SEPARATION, k);
    }
}

/* Distance that reaches 0 when a receding contact presses again: minus its force, or the distance to a lagging
 * surface. */
static void gap_to_return(const vi_structure *s, const vi_drift *drift, int k, double gap[VI_ORDER + 1])
{
    const vi_contact *contact = &s->contacts[k];
    const vi_press press = vi_structure_stop_press(s, k);
    const double *depth = drift->penetration[k], tau = contact->relaxation_time;
    const double elapsed = vi_clock_elapsed(&s->model->clock, s->state->separated[k], s->state->now);
    const bool lags = vi_structure_surface_lags(s, k);
    double surface = lags ? s->state->surface[k] * exp(-elapsed / tau) : 0.0;
    for (int n = 0; n <= VI_ORDER; ++n) {
        const double rate = n < VI_ORDER ? (double)(n + 1) * depth[n + 1] : 0.0;
        if (lags) {
            gap[n] = surface - depth[n];
            surface *= -1.0 / (tau * (double)(n + 1));
        } else if (press.kind == VI_PRESS_LINEAR) {
            gap[n] = -(press.stiffness * depth[n] + press.damping * rate);
        } else {
            gap[n] = -((n == 0 ? 1.0 : 0.0) + press.damping * rate);
        }
    }
    gap[VI_ORDER] = lags ? gap[VI_ORDER] : 0.0; /* the rate's last coefficient is unknown */
}

static void returns(const vi_structure *s, const vi_drift *drift, int k, double length, vi_event_found *first)
{
    const double *depth = drift->penetration[k], tau = s->contacts[k].relaxation_time;
    const double noise = VI_ROUNDING * (fabs(s->contacts[k].position) + vi_polynomial_size(depth, length));
    if (!vi_contact_law_is_external(s->contacts[k].law.law)) {
        double gap[VI_ORDER + 1];
        gap_to_return(s, drift, k, gap);
        const double small = VI_ROUNDING * vi_polynomial_size(gap, length);
        vi_fall fall = {true, 0.0, 1.0};
        const bool lags = vi_structure_surface_lags(s, k);
        /* otherwise an impact elsewhere has thrown the point back */
        if (gap[0] >= -MOST_PRESS * vi_max(small, lags ? noise : pressing_noise(s, k))) {
            fall = vi_polynomial_fall(gap, 0.0, length, small);
        }
        consider(first, &fall, VI_DRIFT_RETURN, k);
        if (lags) {
            const double elapsed = vi_clock_elapsed(&s->model->clock, s->state->separated[k], s->state->now);
            const bool relaxed = s->state->surface[k] * exp(-elapsed / tau) <= RELAXED * noise / VI_ROUNDING;
            fall = (vi_fall){relaxed, relaxed ? 0.0 : length, 1.0};
            consider(first, &fall, VI_DRIFT_FREE, k);
            return;
        }
    }
    vi_fall fall = {true, 0.0, 1.0};
    if (depth[0] > 0.0) {
        fall = vi_polynomial_fall(depth, 0.0, length, noise);
    }
    consider(first, &fall, VI_DRIFT_FREE, k);
}

vi_event_found vi_structure_first_event(const vi_structure *s, const vi_drift *drift, const vi_situation *now, double length,
                               double searched)
{
    length = vi_drift_variable(drift, length);
    searched = vi_drift_variable(drift, searched);
    vi_event_found first = {HUGE_VAL, VI_DRIFT_NO_EVENT, -1, length};
    /* compliant stops first: at one instant their events precede others, so a stop that would pull does not act */
    for (int turn = 0; turn < 2 * s->model->contacts; ++turn) {
        const int k = turn % s->model->contacts;
        const bool compliant = s->state->status[k] >= VI_CONTACT_YIELDING;
        if (compliant != (turn < s->model->contacts)
            || (!vi_structure_watched(s, k) && s->state->status[k] < VI_CONTACT_HELD)) {
            continue;
        }
        switch (s->state->status[k]) {
        case VI_CONTACT_FREE:
        case VI_CONTACT_TOUCHING: arrivals(s, drift, now, k, searched, &first); break;
        case VI_CONTACT_HELD: releases(s, drift, now, k, length, &first); break;
        case VI_CONTACT_YIELDING:
            if (drift->rooted) {
                ends_of_entry(drift, now, k, length, &first);
            } else if (!now->kept[k]) {
                separations(s, drift, now, k, length, &first);
            }
            break;
        default: returns(s, drift, k, length, &first); break;
        }
    }
    const bool cut = first.searched < length && first.searched < first.time;
    vi_budget_spend(&s->state->budget, first.searched < length ? VI_MOST_EVALUATIONS : 0);
    if (cut || first.event == VI_DRIFT_NO_EVENT) {
        first = (vi_event_found){first.searched, VI_DRIFT_NO_EVENT, -1, 0.0};
    }
    first.time = drift->rooted ? first.time * first.time : first.time;
    return first;
}
