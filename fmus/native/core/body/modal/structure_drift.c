#include "body/modal/structure_drift.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/modal/structure_contact.h"
#include "body/modal/structure_forces.h"
#include "body/modal/structure_held.h"
#include "body/modal/structure_record.h"
#include "body/modal/structure_thin.h"
#include "motion/majorant.h"

/* A surface that has relaxed to less than this times the displacements is at rest. */
static const double RELAXED = 1e-16;

/* A power law is entered as a thin contact from this much of the depth of that thin contact. */
static const double ENTRY = 1e-3;

/* Or from so many roundings of the displacement: the series, whose steps are parts of the depth, would not move it. */
static const double SHALLOW = 32.0;

/* Of the square of the rate of a contact on its way out, what its force does over the way at most. */
static const double COASTS = 1e-2;

/* A receding contact that is pressed by more than so many roundings was thrown back. */
static const double THROWN = 1e4;

typedef struct {
    double at[VI_PORTS], sign[VI_PORTS]; /* penetrations, directions */
    double held[VI_MODES];
    vi_press press[VI_PORTS];
    int thin[VI_PORTS]; /* of a power law: so little penetration that its force acts as an impulse */
    int kept[VI_PORTS]; /* yielding: stays as it is, its point is held */
    bool any_thin;
    double acceleration[VI_MODES]; /* with all forces; only where there is a power law */
    double length;      /* that thin contacts and relaxing surfaces allow, s */
} situation;

/* Does a contact on its way out keep its rate, whatever still presses it? */
static bool coasts(const vi_structure *s, int k, double depth, double rate)
{
    const double force = vi_structure_yield(s, k).force;
    return rate < 0.0 && force * s->model->compliance[k][k] * depth <= COASTS * rate * rate;
}

static void look(const vi_structure *s, situation *now)
{
    double force[VI_PORTS];
    bool any_power = false;
    now->any_thin = false;
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
        now->kept[k] = s->state->status[k] == VI_CONTACT_YIELDING && vi_structure_is_kept(s, k);
        if (now->kept[k]) { /* its force is what it is: rounding would move it, and set the pace */
            now->press[k] = (vi_press){VI_PRESS_LINEAR, vi_structure_yield(s, k).force, 0.0, 0.0, 1.0};
        }
        any_power = any_power || now->press[k].kind == VI_PRESS_POWER;
    }
    if (!any_power) {
        return;
    }
    vi_structure_accelerate(s, now->acceleration, force);
    for (int k = 0; k < s->model->contacts; ++k) {
        if (now->press[k].kind != VI_PRESS_POWER) {
            continue;
        }
        const double rate = vi_structure_approach(s, k), depth = vi_max(0.0, now->at[k]);
        const double a = vi_structure_at(s->model, s->model->shape[k], now->acceleration);
        const double time = vi_thin_time(s, k, rate, now->acceleration);
        /* the way in: as far as its series would need steps much shorter than this one */
        const double reached = (rate + 0.5 * vi_max(0.0, vi_structure_direction(s, k) * a) * time) * time;
        const double shallow = SHALLOW * DBL_EPSILON * vi_structure_displacement_size(s, k);
        const double entered = vi_max(ENTRY * reached, shallow);
        const double left = vi_max(-rate * time, coasts(s, k, depth, rate) ? shallow : 0.0);
        if (rate <= 0.0 ? depth <= left || depth == 0.0 : depth <= entered) {
            now->thin[k] = 1;
            now->any_thin = true;
            now->press[k] = (vi_press){.kind = VI_PRESS_NONE};
            now->length = vi_min(now->length, time); /* on its way out it may be turned round before it is out */
        } else if (rate < 0.0) {
            /* not past a turning point next to depth 0: the power law goes on as |d|^n there, its series as d^n */
            now->length = vi_min(now->length, -depth / rate);
        }
    }
}

/* ---- events ---- */

typedef struct {
    double time;
    vi_drift_event event;
    int contact;
    double searched; /* the shortest of the searches for the others, s */
} event_found;

/* A search has found this, or nothing up to fall->time. */
static void consider(event_found *first, const vi_fall *fall, vi_drift_event event, int contact)
{
    if (!fall->found) {
        first->searched = vi_min(first->searched, fall->time);
    } else if (fall->time < first->time) {
        *first = (event_found){fall->time, event, contact, first->searched};
    }
}

/* Where a polynomial falls through zero; touches from above are passed over. */
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

/* Does contact k stay where it is over the segment, as far as rounding of the terms it is the sum of can tell? It does
 * where others hold its point too: on the opposite side, say. */
static bool stays(const vi_structure *s, const vi_drift *drift, int k, const double clearance[], double length)
{
    const double moved = vi_polynomial_size(clearance, length);
    double terms = s->state->status[k] == VI_CONTACT_FREE ? vi_structure_displacement_size(s, k) : 0.0;
    for (int j = 0; j < s->model->modes; ++j) {
        double size = 0.0;
        for (int n = VI_ORDER; n >= 0; --n) {
            size = size * length + fabs(drift->modal[n][j]);
        }
        terms += fabs(s->model->shape[k][j]) * size;
    }
    /* the loads and the other stops' forces that holding forces take off again */
    terms += drift->force_scale[k] * fabs(s->model->mobility[k][k]) * length * length;
    for (int l = 0; l < s->model->contacts; ++l) {
        terms += fabs(s->model->compliance[k][l]) * vi_polynomial_size(drift->force[l], length) * length * length;
    }
    return moved <= VI_ROUNDING * terms;
}

/* Let the series of what is 0 at the start, but for rounding, begin with coefficient `first`: divided by that power of time
 * it has the same zeros but that one. */
static void divide(double c[VI_ORDER + 1], int first)
{
    for (int n = 0; n <= VI_ORDER; ++n) {
        c[n] = n + first <= VI_ORDER ? c[n + first] : 0.0;
    }
}

/* What is known exactly of the motion of contact k, which touches: thin contacts, which its series leaves out, lift it
 * off, or have just ceased to hold it. */
static void correct_start(const vi_structure *s, const situation *now, int k, double clearance[VI_ORDER + 1])
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

/* A contact that leaves its stop with neither speed nor acceleration: the first coefficient that is more than rounding
 * moves it. Divided by that power of time, its clearance has the same zeros but the one at the start. False where
 * nothing moves it. */
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

static void arrivals(const vi_structure *s, const vi_drift *drift, const situation *now, int k, double length,
                     event_found *first)
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
            && stays(s, drift, k, clearance, length))) {
        return;
    }
    double noise = VI_ROUNDING * (fabs(s->contacts[k].position) + vi_polynomial_size(clearance, length));
    bool pressed = false;
    if (s->state->status[k] == VI_CONTACT_TOUCHING && s->state->leaving[k] >= 2) {
        if (!divide_by_start(s, drift, k, clearance)) {
            return;
        }
        noise = VI_ROUNDING * vi_polynomial_size(clearance, length);
        pressed = clearance[0] < 0.0; /* by what has happened at this instant since it left */
    }
    const vi_fall fall = pressed ? (vi_fall){true, 0.0, 0.0} : vi_polynomial_fall(clearance, 0.0, length, noise);
    consider(first, &fall, VI_DRIFT_ARRIVAL, k);
}

/* Where the force of held contact k, thin contacts' part and all, falls through zero; without that part it does so at
 * `alone`. */
static vi_fall release_beside_thin(const vi_structure *s, const vi_drift *drift, const situation *now, int k,
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

static void releases(const vi_structure *s, const vi_drift *drift, const situation *now, int k, double length,
                     event_found *first)
{
    double force[VI_ORDER + 1], size = 0.0;
    memcpy(force, drift->force[k], sizeof force);
    const double thin = now->any_thin ? vi_thin_part(s, drift, now->thin, now->at, k, 0.0, &size) : 0.0;
    const double scale = drift->force_scale[k] * s->model->compliance[k][k] / vi_structure_mobility_left(s, k);
    const double noise = VI_ROUNDING * (scale + size);
    vi_fall fall = {true, 0.0, 1.0};
    if (fabs(force[0]) <= noise && fabs(thin) <= noise) {
        divide(force, vi_structure_first_of_force(s, drift, k));
        if (force[0] >= 0.0) {
            fall = fall_through(force, length, VI_ROUNDING * vi_polynomial_size(force, length));
            fall = now->any_thin && fall.found ? release_beside_thin(s, drift, now, k, fall, length, noise) : fall;
        }
    } else if (force[0] + thin >= -noise) {
        fall = force[0] >= -noise ? fall_through(force, length, noise) : fall;
        fall = now->any_thin && fall.found ? release_beside_thin(s, drift, now, k, fall, length, noise) : fall;
    }
    consider(first, &fall, VI_DRIFT_RELEASE, k);
}

/* Rounding of what has the sign of a compliant contact's force: the force itself or, of a power law, 1 + damping d'. */
static double pressing_noise(const vi_structure *s, int k)
{
    const vi_contact_law *law = &s->contacts[k].law;
    const bool linear = law->law == VI_LAW_KELVIN_VOIGT || law->law == VI_LAW_EXTERNAL_FORCE;
    const double damping = law->law == VI_LAW_EXTERNAL_FORCE ? s->contacts[k].applied_damping : law->damping;
    const double stiffness = law->law == VI_LAW_EXTERNAL_FORCE ? s->contacts[k].applied_stiffness : law->stiffness;
    const double level = linear ? stiffness * vi_structure_displacement_size(s, k) : 1.0;
    return VI_ROUNDING * (level + (law->law == VI_LAW_HERTZ ? 0.0 : damping * vi_structure_velocity_size(s, k)));
}

/* What has the sign of a yielding contact's force, and falls through zero with it: the force itself or, of a power law,
 * 1 + damping d'. The series of its force does not reach as far as that of the motion: near touch-down it moves nothing
 * yet, but has its singularity there. */
static void pressing(const situation *now, int k, const double depth[VI_ORDER + 1], double sense[VI_ORDER + 1])
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

static void separations(const vi_structure *s, const vi_drift *drift, const situation *now, int k, double length,
                        event_found *first)
{
    double depth[VI_ORDER + 1];
    memcpy(depth, drift->penetration[k], sizeof depth);
    if (now->thin[k] && stays(s, drift, k, depth, length)) {
        return;
    }
    if (s->state->leaving[k] == 2) { /* what begins to press without speed does not move out by rounding */
        depth[1] = vi_max(0.0, depth[1]);
        depth[2] = vi_max(0.0, depth[2]);
    }
    if (!now->thin[k]) {
        double force[VI_ORDER + 1];
        pressing(now, k, depth, force);
        const double rounding = VI_ROUNDING * vi_polynomial_size(force, length);
        vi_fall fall = {true, 0.0, 1.0};
        /* else an impact elsewhere, or the start, has thrown the point off its stop */
        if (force[0] >= -vi_max(rounding, pressing_noise(s, k))) {
            fall = fall_through(force, length, rounding);
        }
        consider(first, &fall, VI_DRIFT_SEPARATION, k);
    }
    if (depth[0] > 0.0 || depth[1] < 0.0) {
        const double noise = VI_ROUNDING * (fabs(s->contacts[k].position) + vi_polynomial_size(depth, length));
        const vi_fall fall = fall_through(depth, length, now->thin[k] ? VI_ROUNDING * fabs(depth[0]) : noise);
        consider(first, &fall, VI_DRIFT_SEPARATION, k);
    }
}

/* What must fall to zero for a receding contact to press again: minus its force or, where the surface needs time, the
 * distance to it. */
static void gap_to_return(const vi_structure *s, const vi_drift *drift, int k, double gap[VI_ORDER + 1])
{
    const vi_contact *contact = &s->contacts[k];
    const double *depth = drift->penetration[k], tau = contact->relaxation_time;
    const double elapsed = vi_clock_elapsed(&s->model->clock, s->state->separated[k], s->state->now);
    const bool lags = vi_structure_surface_lags(s, k);
    double surface = lags ? s->state->surface[k] * exp(-elapsed / tau) : 0.0;
    for (int n = 0; n <= VI_ORDER; ++n) {
        const double rate = n < VI_ORDER ? (double)(n + 1) * depth[n + 1] : 0.0;
        if (lags) {
            gap[n] = surface - depth[n];
            surface *= -1.0 / (tau * (double)(n + 1));
        } else if (contact->law.law == VI_LAW_KELVIN_VOIGT) {
            gap[n] = -(contact->law.stiffness * depth[n] + contact->law.damping * rate);
        } else {
            gap[n] = -((n == 0 ? 1.0 : 0.0) + (contact->law.law == VI_LAW_HERTZ ? 0.0 : contact->law.damping) * rate);
        }
    }
    gap[VI_ORDER] = lags ? gap[VI_ORDER] : 0.0; /* the rate's last coefficient is not known */
}

static void returns(const vi_structure *s, const vi_drift *drift, int k, double length, event_found *first)
{
    const double *depth = drift->penetration[k], tau = s->contacts[k].relaxation_time;
    const double noise = VI_ROUNDING * (fabs(s->contacts[k].position) + vi_polynomial_size(depth, length));
    if (s->contacts[k].law.law != VI_LAW_EXTERNAL_FORCE) {
        double gap[VI_ORDER + 1];
        gap_to_return(s, drift, k, gap);
        const double small = VI_ROUNDING * vi_polynomial_size(gap, length);
        vi_fall fall = {true, 0.0, 1.0};
        const bool lags = vi_structure_surface_lags(s, k);
        /* else an impact elsewhere has thrown the point back */
        if (gap[0] >= -THROWN * vi_max(small, lags ? noise : pressing_noise(s, k))) {
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

static event_found first_event(const vi_structure *s, const vi_drift *drift, const situation *now, double length,
                               double searched)
{
    event_found first = {HUGE_VAL, VI_DRIFT_NO_EVENT, -1, length};
    /* compliant stops first: of events at one instant theirs comes first, one that would pull no longer bears on others */
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
            if (!now->kept[k]) {
                separations(s, drift, now, k, length, &first);
            }
            break;
        default: returns(s, drift, k, length, &first); break;
        }
    }
    const bool cut = first.searched < length && first.searched < first.time;
    vi_budget_spend(&s->state->budget, first.searched < length ? VI_MOST_EVALUATIONS : 0);
    return cut || first.event == VI_DRIFT_NO_EVENT ? (event_found){first.searched, VI_DRIFT_NO_EVENT, -1, 0.0} : first;
}

/* ---- one segment ---- */

static void add_impulses(const vi_structure *s, const vi_drift *drift, const situation *now, double u)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        if (now->thin[k]) {
            vi_thin_impulse(s, k, now->at[k], drift->penetration[k][1], u);
        } else if (s->state->status[k] == VI_CONTACT_YIELDING) {
            double sum = 0.0;
            for (int n = VI_ORDER; n >= 0; --n) {
                sum = sum * u + drift->force[k][n] / (double)(n + 1);
            }
            s->state->touch_down[k].impulse += sum * u;
        }
    }
}

/* Kinetic and elastic energy of the modes, J. */
static double energy_now(const vi_structure *s)
{
    double elastic = 0.0;
    for (int j = 0; j < s->model->modes; ++j) {
        elastic += 0.5 * s->model->mode[j].stiffness * s->state->q[j] * s->state->q[j];
    }
    return vi_structure_kinetic(s) + elastic;
}

/* What is added at a segment's end, thin contacts' impulses and what holds the held ones against them, is energy that
 * the stops have taken. */
static void finish(const vi_structure *s, const vi_drift *drift, const situation *now, double u)
{
    const bool follow = now->any_thin && s->state->follow_energies;
    const double before = follow ? energy_now(s) : 0.0;
    add_impulses(s, drift, now, u);
    vi_structure_project(s);
    s->state->energies.contact_loss += follow ? before - energy_now(s) : 0.0;
}

static void follow_energies(const vi_structure *s, const vi_drift *drift, const situation *now, double u)
{
    int still[VI_PORTS] = {0};
    for (int k = 0; k < s->model->contacts; ++k) {
        double moved[VI_ORDER + 1];
        memcpy(moved, drift->penetration[k], sizeof moved);
        moved[0] = 0.0;
        still[k] = s->state->status[k] == VI_CONTACT_YIELDING && stays(s, drift, k, moved, u);
    }
    vi_energies_of_drift(s, drift, now->held, still, u);
}

/* Nothing moves and nothing will: a body at rest on a stop under constant loads. */
static bool at_rest_for_good(const vi_structure *s, const vi_drift *drift, const situation *now)
{
    const vi_structure_model *model = s->model;
    if (s->record->periods) {
        return false;
    }
    for (int j = 0; j < model->modes; ++j) {
        const vi_mode *mode = &model->mode[j];
        const bool forced = mode->force != 0.0 && model->clock.angular_frequency > 0.0;
        const double load = fabs(now->held[j]) + fabs(mode->force) + mode->stiffness * fabs(s->state->q[j]);
        if (forced || s->state->held_rate[j] != 0.0 || s->state->p[j] != 0.0
            || fabs(2.0 * drift->modal[2][j]) > VI_ROUNDING * load) {
            return false;
        }
    }
    return true;
}

/* What a drift costs, in evaluations of a mode. */
static int64_t drift_evaluations(const vi_structure_model *model)
{
    const int64_t modes = model->modes;
    return VI_ORDER * modes + (model->coupled ? modes * modes / 2 : 0);
}

double vi_structure_drift(const vi_structure *s, double length, double room, vi_drift_event *event, int *k)
{
    vi_structure_state *state = s->state;
    const vi_phase phase = vi_structure_phase(s);
    situation now;
    vi_drift drift;
    look(s, &now);
    vi_budget_spend(&state->budget, drift_evaluations(s->model));
    const vi_drift_start start = {state->q,   state->p, phase.cosine, phase.sine, now.held, state->held_rate,
                                  now.at, now.sign, now.press};
    vi_drift_begin(&drift, s->model, &start, vi_min(length + room, now.length));
    const bool to_end = drift.length >= length;
    const double reach = to_end ? length : drift.length;
    const event_found first = first_event(s, &drift, &now, reach, vi_max(reach, drift.length));
    *event = first.event;
    *k = first.contact;
    const double u = first.time;
    if (first.event == VI_DRIFT_NO_EVENT && at_rest_for_good(s, &drift, &now)) {
        return length;
    }
    if (s->record->extrema) {
        vi_extremes_of_drift(s, &drift, u);
    }
    if (state->follow_energies) {
        follow_energies(s, &drift, &now, u);
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
