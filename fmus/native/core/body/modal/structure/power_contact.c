#include "body/modal/structure/power_contact.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/modal/forces.h"
#include "body/modal/power_flow.h"
#include "body/modal/structure/contact.h"
#include "motion/majorant.h"

/* Fewest modes for which such steps cost less than the series. REPAID: contacts since the start, times squared modes,
 * from which they repay the tables. */
enum { FEWEST_MODES = 4, REPAID = 2048 };
/* Time left, in radians of the fastest rate, that one segment of the series covers at less cost. */
static const double ONE_SEGMENT = 2.5;
/* Longest step: in times to where the depth would be 0, ahead and behind; in radians of the forcing. */
static const double AHEAD = 0.9, BEHIND = 4.0, OF_FORCING = 2.0;
/* Share of the last two coefficients of the force in the error of a step. */
static const double LAST_TERMS = 0.005;
/* Largest last terms, relative to the force, in tolerances. */
static const double OF_FORCE = 50.0;
/* Error, relative to the allowed error, below which the next step may be twice as long. */
static const double RAISES = 1e-3;
/* Rounding of a depth, in roundings of the displacement. */
static const double NOISE = 16.0;
/* Time to the end of a contact, in radians of the fastest rate, below which its force may be that of a thin contact.
 * Its change of the velocity, relative to the velocity, is then at most this number of roots of the tolerance. */
static const double NEAR_END = 2.0, LITTLE = 2.0;
/* Most steps before the time is counted. */
enum { MOST_STEPS = 64 };
/* Cost of a step, in evaluations of a mode by series, for each mode. */
enum { COST = 4 };

/* List the contacts that press, all by power laws of this body's own stops, while all others are free. Returns their
 * number; 0 where another contact touches, begins, holds or recedes. */
static int pressed_contacts(const vi_structure *s, const vi_situation *now, int port[VI_PORTS])
{
    int found = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        if (s->state->status[k] == VI_CONTACT_YIELDING && now->press[k].kind == VI_PRESS_POWER
            && s->state->leaving[k] == 0 && now->at[k] > 0.0) {
            port[found++] = k;
        } else if (s->state->status[k] != VI_CONTACT_FREE) {
            return 0;
        }
    }
    return found;
}

/* Does a step fit this body, its record and this instant? */
static bool fits(const vi_structure *s, const vi_situation *now, double length)
{
    const int64_t modes = vi_structure_modes(s->model);
    return modes >= FEWEST_MODES && s->power != NULL && s->state->budget.events * modes * modes >= REPAID
           && vi_structure_is_plain(s) && !vi_structure_stops_move(s->model) && !vi_structure_grows(s->model)
           && !s->model->coupled && !s->model->varies
           && !now->any_thin && !s->state->follow_energies
           && length * s->model->fastest > ONE_SEGMENT && vi_structure_moves(s);
}

/* Time to where a motion from `depth` with this rate and acceleration would be at 0. Where it would not, the distance
 * of the complex zeros, at which the force has no series either. */
static double time_out(double depth, double rate, double acceleration)
{
    const double square = rate * rate - 2.0 * acceleration * depth;
    if (square < 0.0) {
        return sqrt(2.0 * depth / acceleration);
    }
    const double sum = sqrt(square) - rate;
    return sum > 0.0 ? 2.0 * depth / sum : HUGE_VAL;
}

/* The longest step that the ends and the beginnings of the contacts may allow, s. */
static double longest_step(const vi_power_start *start)
{
    const double forcing = start->model->clock.angular_frequency;
    double longest = forcing > 0.0 ? OF_FORCING / forcing : HUGE_VAL;
    for (int i = 0; i < start->contacts; ++i) {
        const vi_power_contact *contact = &start->contact[i];
        const double ahead = time_out(contact->depth, contact->rate, contact->acceleration);
        const double behind = time_out(contact->depth, -contact->rate, contact->acceleration);
        longest = vi_min(longest, vi_min(AHEAD * ahead, BEHIND * behind));
    }
    return longest;
}

/* Upper bound of the force on mode j by all contacts. */
static double most_push(const vi_power_start *start, const vi_power_course course[], int j)
{
    double sum = 0.0;
    for (int i = 0; i < start->contacts; ++i) {
        const double *series = course[i].force_series;
        sum += fabs(start->contact[i].toward[j]) * (fabs(series[0]) + vi_legendre_spread(series));
    }
    return sum;
}

/* Upper bound of the distance by which contact l moves within `time`. */
static double most_moved(const vi_structure *s, const vi_power_start *start, const vi_power_course course[], int l,
                         double time)
{
    double sum = 0.0;
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        const vi_mode *mode = &s->model->mode[j];
        const double radian = mode->natural > 0.0 ? 1.0 / mode->natural : HUGE_VAL;
        const double by_rate = vi_min(time, radian), by_load = vi_min(0.5 * time * time, 2.0 * radian * radian);
        const double by_force = vi_min(0.5 * time * time, time * radian);
        const double force = fabs(mode->force) + fabs(start->slope[j]) * time + most_push(start, course, j);
        sum += fabs(s->model->shape[l][j])
               * (fabs(start->p[j]) * by_rate + fabs(start->load[j]) * by_load + force * by_force);
    }
    return sum;
}

/* Is it certain that contact l, which is free, does not arrive in the step? */
static bool stays_clear(const vi_structure *s, const vi_power_start *start, const vi_power_level *level,
                        const vi_power_course course[], int l)
{
    const double clearance = vi_structure_clearance(s, l) - VI_ROUNDING * vi_structure_displacement_size(s, l);
    if (clearance > most_moved(s, start, course, l, level->step)) {
        return true;
    }
    if (!(clearance > 0.0) || s->power->press[l].kind != VI_PRESS_POWER) {
        return false;
    }
    double away[VI_NODES], series[VI_NODES];
    vi_power_other(start, level, course, l, -vi_structure_direction(s, l), clearance, away);
    vi_legendre_series(&start->tables->basis, away, series);
    return vi_power_least(series) > 0.0;
}

static bool others_stay_clear(const vi_structure *s, const vi_power_start *start, const vi_power_level *level,
                              const vi_power_course course[])
{
    for (int l = 0; l < s->model->contacts; ++l) {
        if (s->state->status[l] == VI_CONTACT_FREE && vi_structure_watched(s, l)
            && !stays_clear(s, start, level, course, l)) {
            return false;
        }
    }
    return true;
}

/* Errors of a contact's velocity and of its force from this step, relative to the errors allowed. */
static double relative_error(const vi_structure *s, const vi_power_contact *contact, const vi_power_level *level,
                             const vi_power_course *course)
{
    const double *last = &course->force_series[VI_NODES - 2];
    double deepest = 0.0, least = HUGE_VAL, largest = 0.0;
    for (int i = 0; i < VI_NODES; ++i) {
        deepest = vi_max(deepest, course->depth[i]);
        least = vi_min(least, course->depth[i]);
        largest = vi_max(largest, course->force[i]);
    }
    const double rate = vi_max(fabs(contact->rate), (deepest - least) / level->step);
    const double noise = NOISE * DBL_EPSILON * vi_structure_displacement_size(s, contact->port) / deepest;
    const double reach = level->reach[contact->port], noise_of_force = contact->press.exponent * noise * largest;
    const double terms = fabs(last[0]) + fabs(last[1]), tolerance = s->model->tolerance;
    /* a force that would stop the contact within the step: the error of a much smaller force moves nothing */
    const double stopping = rate / (s->model->compliance[contact->port][contact->port] * level->step);
    return vi_max(LAST_TERMS * terms * reach / (tolerance * rate + noise_of_force * reach),
                  terms / (OF_FORCE * tolerance * (largest + stopping) + noise_of_force));
}

/* Do the last terms of a series matter neither beside its spread nor beside the displacement at its start? */
static bool series_ends(const vi_structure *s, const double series[VI_NODES], double here)
{
    const double last = fabs(series[VI_NODES - 1]) + fabs(series[VI_NODES - 2]);
    return last <= s->model->tolerance * vi_legendre_spread(series) + NOISE * DBL_EPSILON * fabs(here);
}

/* Extend the extremes of a further observed point, as follow_extremes. */
static bool follow_point(const vi_structure *s, const vi_power_start *start, const vi_power_level *level,
                         const vi_power_course course[], int point)
{
    double moved[VI_NODES], series[VI_NODES];
    const int row = s->model->contacts + point;
    vi_power_other(start, level, course, row, 1.0, 0.0, moved);
    vi_legendre_series(&start->tables->basis, moved, series);
    const double here = vi_structure_at(s->model, s->model->shape[row], s->state->q);
    if (!series_ends(s, series, here)) {
        return false;
    }
    const vi_legendre *basis = &start->tables->basis;
    vi_record_point_extend(s->record, point, here + vi_legendre_largest(basis, series, moved, 1.0, 0.0));
    vi_record_point_extend(s->record, point, here - vi_legendre_largest(basis, series, moved, -1.0, 0.0));
    return true;
}

/* Extend the extremes. Returns false where an observed point moves too quickly for them. */
static bool follow_extremes(const vi_structure *s, const vi_power_start *start, const vi_power_level *level,
                            const vi_power_course course[])
{
    double moved[VI_NODES], series[VI_NODES];
    vi_power_observe(start, level, course, moved);
    vi_legendre_series(&start->tables->basis, moved, series);
    const double here = vi_structure_observed(s);
    if (!series_ends(s, series, here)) {
        return false;
    }
    for (int point = 0; point < s->model->further; ++point) {
        if (!follow_point(s, start, level, course, point)) {
            return false;
        }
    }
    vi_record_extend(s->record, here + vi_legendre_largest(&start->tables->basis, series, moved, 1.0, 0.0));
    vi_record_extend(s->record, here - vi_legendre_largest(&start->tables->basis, series, moved, -1.0, 0.0));
    return true;
}

/* Take impulses and largest forces of a step. */
static void record(const vi_structure *s, const vi_power_start *start, const vi_power_level *level,
                   const vi_power_course course[])
{
    for (int i = 0; i < start->contacts; ++i) {
        const int k = start->contact[i].port;
        const double *series = course[i].force_series;
        vi_touch_down *touch = &s->state->touch_down[k];
        touch->impulse += level->step * series[0];
        if (vi_structure_follows_peak(s, k)) {
            touch->peak = vi_legendre_largest(&start->tables->basis, series, course[i].force, 1.0, touch->peak);
        }
    }
}

/* The highest level of at most this length; -1: the lowest is longer. */
static int level_within(const vi_structure_model *model, double length)
{
    int level = VI_POWER_LEVELS - 1;
    while (level >= 0 && !(vi_power_step_of(model, level) <= length)) {
        --level;
    }
    return level;
}

/* Try a step of this level; true when the state has moved. */
static bool try_level(const vi_structure *s, const vi_power_start *start, int l)
{
    const vi_power_level *level = vi_power_level_of(s->power, s->model, l);
    vi_power_course course[VI_PORTS];
    vi_budget_spend(&s->state->budget, COST * start->contacts * vi_structure_modes(s->model));
    if (!vi_power_solve(start, level, course) || !others_stay_clear(s, start, level, course)) {
        return false;
    }
    double error = 0.0;
    for (int i = 0; i < start->contacts; ++i) {
        const double of_contact = relative_error(s, &start->contact[i], level, &course[i]);
        error = of_contact <= error ? error : of_contact;
    }
    if (!(error <= 1.0) || (s->record->extrema && !follow_extremes(s, start, level, course))) {
        return false;
    }
    record(s, start, level, course);
    if (error <= RAISES && s->state->power_level <= l) {
        s->state->power_level = l + 1;
    }
    vi_power_end(start, level, course, s->state->q, s->state->p);
    return true;
}

/* Make the longest step that the contacts allow, of at most `length` seconds. Returns its length; 0: none fits. */
static double step_once(const vi_structure *s, const vi_power_start *start, double length)
{
    int level = level_within(s->model, vi_min(length, longest_step(start)));
    level = level < s->state->power_level ? level : (int)s->state->power_level;
    for (; level >= 0; --level) {
        if (try_level(s, start, level)) {
            return vi_power_step_of(s->model, level);
        }
        s->state->power_level = level - 1 > 0 ? level - 1 : 0;
    }
    return 0.0;
}

/* May the force of a contact, which moves out, act as that of a thin contact? */
static bool may_be_thin(const vi_power_start *start)
{
    const double most = LITTLE * sqrt(start->model->tolerance);
    for (int i = 0; i < start->contacts; ++i) {
        const vi_power_contact *contact = &start->contact[i];
        const double speed = -contact->rate, time = speed > 0.0 ? contact->depth / speed : HUGE_VAL;
        const double change = contact->plain * start->model->compliance[contact->port][contact->port] * time;
        if (time <= NEAR_END * start->model->radian && change <= most * speed) {
            return true;
        }
    }
    return false;
}

double vi_structure_press_on(const vi_structure *s, const vi_situation *now, const vi_drift_start *state, double length)
{
    int port[VI_PORTS];
    const int contacts = fits(s, now, length) ? pressed_contacts(s, now, port) : 0;
    if (contacts == 0 || !vi_power_tables_fit(s->power, s->model)) {
        return 0.0;
    }
    const double w = s->model->clock.angular_frequency, least = ONE_SEGMENT * s->model->radian;
    vi_drift_start here = *state;
    vi_power_start start;
    double u = 0.0, moved = 1.0, depth[VI_PORTS];
    memcpy(depth, now->at, sizeof depth);
    for (int step = 0; step < MOST_STEPS && moved > 0.0 && length - u > least; ++step) {
        for (int i = 0; i < contacts && step > 0; ++i) {
            depth[port[i]] = -vi_structure_clearance(s, port[i]);
        }
        vi_power_begin(&start, s->model, s->power, &here, u, contacts, port, depth);
        if (step > 0 && may_be_thin(&start)) {
            break;
        }
        moved = step_once(s, &start, length - u);
        u += moved;
        const double angle = w * (s->state->now.rest + u);
        here.drive.phase = vi_phase_of(angle);
    }
    return u;
}
