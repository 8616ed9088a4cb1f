#include "body/modal/structure/structure.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "body/modal/loads.h"
#include "body/modal/modal_flight.h"
#include "body/modal/stop_motion.h"
#include "body/modal/structure/arrival.h"
#include "body/modal/structure/contact.h"
#include "body/modal/structure/drift.h"
#include "body/modal/structure/extremes.h"
#include "body/modal/structure/jam.h"
#include "body/modal/structure/random_flight.h"
#include "body/modal/structure/search.h"
#include "body/modal/structure/sensitivity.h"
#include "body/modal/structure/settle.h"
#include "body/modal/structure/unbounded.h"
#include "motion/majorant.h"

/* Time that a released contact stays on its stop, in units of 1 / fastest rate + |time|. Contacts released together
 * within this time are one instant, as the rounding of their forces separates them. */
static const double ONE_RELEASE = 16.0 * DBL_EPSILON;
/* Least length of a low bounce's flight, in radians of the fastest rate; it only sets the reach of the search. */
static const double LEAST_BOUNCE = 1e-6;
/* Modal displacement or velocity below which its square is below the smallest normal number. */
static const double SMALLEST = 1e-154;

/* ---- segments ---- */

/* Length of one segment, s, and the kind of its end. */
static double segment_length(const vi_structure *s, vi_instant target, vi_ending *end)
{
    const double length = vi_segment_length(&s->model->clock, s->state->now, target, s->record->periods, end);
    double room = vi_structure_stops_move(s->model) ? vi_stop_motions_room(s) : HUGE_VAL;
    room = VI_DEGREE > 1 ? vi_min(room, s->state->loads_last) : room;
    if (room < length) {
        *end = VI_ENDS_ANYWHERE;
        return room;
    }
    return length;
}

static double landing_room(const vi_structure *s)
{
    return s->model->asks ? vi_landing_room(vi_clock_time(&s->model->clock, s->state->now)) : 0.0;
}

/* Does a contact at this instant wait for its answer? A contact at the end of the step always does. */
static bool stops_here(const vi_structure *s, vi_instant target, const vi_step_request *request)
{
    const double room = landing_room(s); /* 0 where no contact asks */
    return request->stop_at_contacts
           || (room > 0.0 && fabs(vi_clock_elapsed(&s->model->clock, s->state->now, target)) <= room);
}

static void record_period(const vi_structure *s)
{
    vi_structure_count_contacts(s);
    for (int point = 0; point < s->model->further; ++point) {
        const double *shape = s->model->shape[s->model->contacts + point];
        vi_record_point_period(s->record, point, vi_structure_at(s->model, shape, s->state->q),
                               vi_structure_at(s->model, shape, s->state->p));
    }
    vi_record_period(s->record, vi_clock_time(&s->model->clock, s->state->now), vi_structure_observed(s),
                     vi_structure_at(s->model, s->model->observed, s->state->p));
}

/* Time for which a contact just released stays on its stop, s. */
static double one_release(const vi_structure *s)
{
    return ONE_RELEASE * (s->model->radian + fabs(vi_clock_time(&s->model->clock, s->state->now)));
}

/* Move the instant by u seconds; the two named ends are met exactly. The modal state is already there. */
static void move(const vi_structure *s, double u, vi_ending end, vi_instant target)
{
    vi_structure_state *state = s->state;
    state->moved |= u > 0.0;
    if (s->sensitive != NULL) {
        vi_sensitivity_flow(s, u);
    }
    const vi_instant after = end == VI_ENDS_AT_TARGET ? target : vi_clock_after(&s->model->clock, state->now, u);
    for (int k = 0; k < s->model->contacts && u > 0.0; ++k) {
        if (state->status[k] == VI_CONTACT_TOUCHING && state->leaving[k]
            && (u <= one_release(s) || vi_structure_only_touches(s, k))) {
            continue; /* contacts that others hold stay for any time */
        }
        if (state->status[k] == VI_CONTACT_TOUCHING) {
            state->status[k] = VI_CONTACT_FREE;
        }
        state->leaving[k] = 0;
    }
    /* rounding may put a contact just before a period's end at that end */
    if (end == VI_ENDS_AT_PERIOD || (s->record->periods && after.periods > state->now.periods)) {
        state->now = (vi_instant){state->now.periods + 1, 0.0, 0.0};
        record_period(s);
    } else {
        state->now = after;
    }
    vi_structure_load(s);
}

/* ---- flight ---- */

/* Is no record wanted before the target, so that one evaluation is enough for any length? */
static bool only_end_matters(const vi_structure *s, const vi_flight *flight)
{
    const bool lasts = VI_DEGREE == 1 || s->state->loads_last == HUGE_VAL;
    const bool is_limited = vi_structure_grows(s->model) && s->model->displacement_limit > 0.0;
    return lasts && !is_limited && !flight->series && vi_flight_degree(flight) == 1 && !s->record->extrema
           && !s->record->periods && !s->state->follow_energies;
}

/* Is it certain, for any acceleration, that no contact is about to meet its stop or slow to leave it? */
static bool bounces_high(const vi_structure *s)
{
    const vi_structure_model *model = s->model;
    const double time = 2.0 * VI_LOW_BOUNCE * model->radian;
    for (int k = 0; k < model->contacts; ++k) {
        if (!vi_structure_watched(s, k)) {
            continue;
        }
        const double clearance = vi_max(0.0, vi_structure_clearance(s, k)), v = vi_structure_approach(s, k);
        const double most = vi_structure_most_acceleration(s, k);
        const bool lingers = s->state->status[k] == VI_CONTACT_TOUCHING
                             && fabs(v) * model->radian < VI_LINGERING * vi_structure_displacement_size(s, k);
        if (lingers || !(clearance > time * (v + 0.5 * time * most))) {
            return false;
        }
    }
    return true;
}

/* Time for which the body is followed from its present place, s: a contact is about to meet its stop or slow to leave
 * it. HUGE_VAL when no contact is. */
static double low_bounce(const vi_structure *s)
{
    const vi_structure_model *model = s->model;
    double acceleration[VI_MODES], force[VI_PORTS], shortest = HUGE_VAL;
    if (bounces_high(s)) {
        return HUGE_VAL;
    }
    vi_structure_accelerate(s, acceleration, force);
    for (int k = 0; k < model->contacts; ++k) {
        if (!vi_structure_watched(s, k)) {
            continue;
        }
        const double clearance = vi_max(0.0, vi_structure_clearance(s, k)), v = vi_structure_approach(s, k);
        const double a = vi_structure_direction(s, k) * vi_structure_at(model, model->shape[k], acceleration);
        const double flight = vi_parabola_root(clearance, v, a), time = 1.0 / model->fastest;
        if (flight > 0.0 && flight * model->fastest < VI_LOW_BOUNCE) {
            /* long enough to move the body: a bounce made of rounding need not come down */
            shortest = vi_min(shortest, vi_max(2.0 * flight, LEAST_BOUNCE * time));
        } else if (s->state->status[k] == VI_CONTACT_TOUCHING
                   && (fabs(v) + fabs(a) * time) * time < VI_LINGERING * vi_structure_displacement_size(s, k)) {
            shortest = vi_min(shortest, time);
        }
    }
    return shortest;
}

/* Contacts have changed the motion: the next flight starts from a new origin. */
static void forget_origins(const vi_structure *s)
{
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        s->state->origin[j].known = 0;
    }
}

/* Fly to the target when no stop can be met: one evaluation for any length. */
static void fly_free(const vi_structure *s, const vi_flight *flight, vi_instant target)
{
    const vi_clock *clock = &s->model->clock;
    const double u = vi_clock_elapsed(clock, s->state->now, target);
    vi_phase further[VI_SINES_ROOM];
    for (int k = 0; k < vi_structure_sines(s->model); ++k) {
        further[k] = vi_sine_phase(&s->model->sine[k], target);
    }
    vi_flight_end(flight, u, clock->angular_frequency * target.rest, further, s->state->q, s->state->p);
    vi_flight_reach(flight, s->state->now, s->state->q, s->state->p, s->state->origin);
    move(s, u, VI_ENDS_AT_TARGET, target);
}

/* Fly over intervals of a random load; false where they do not fit. */
static bool fly_far(const vi_structure *s, vi_instant target)
{
    const double u = vi_random_flight(s, target);
    if (!(u > 0.0)) {
        return false;
    }
    forget_origins(s);
    move(s, u, VI_ENDS_ANYWHERE, target);
    return true;
}

/* Fly to the next contact, the segment's end, or the target, whichever is first; false when numbers overflow. */
static bool fly(const vi_structure *s, vi_instant target, const vi_step_request *request)
{
    vi_ending end;
    const double length = segment_length(s, target, &end), bounce = low_bounce(s);
    const double room = end == VI_ENDS_AT_TARGET ? landing_room(s) : 0.0;
    vi_structure_state *state = s->state;
    double held[VI_MODES];
    vi_flight flight;
    vi_point points[VI_PORTS];
    vi_search_found found;
    vi_phase phase;
    const vi_drive drive = vi_structure_drive_now(s, held);
    vi_flight_start(&flight, s->model, state->q, state->p, &drive,
                    vi_min(vi_min(vi_min(length + room, bounce), vi_energies_reach(s)), vi_growth_reach(s->model)),
                    bounce < HUGE_VAL);
    vi_flight_follow(&flight, state->now, state->q, state->p, state->origin);
    vi_search_points(s, &flight, points);
    const bool idle = vi_search_is_idle(s, &flight, points);
    if (idle && only_end_matters(s, &flight)) {
        fly_free(s, &flight, target);
        return true;
    }
    found.u = flight.length;
    const vi_search_end search_result = idle ? VI_SEARCH_NOTHING : vi_search_flight(s, &flight, points, &found);
    if (search_result == VI_SEARCH_BEYOND) {
        return false;
    }
    const bool touches = search_result == VI_SEARCH_CONTACT;
    const bool ends = vi_structure_grows(s->model) && vi_unbounded_flight(s, &flight, points, touches, &found.u);
    const bool meets = touches && !ends;
    const bool whole = !meets && !ends && found.u >= length;
    const double u = whole ? length : found.u; /* the room after the end was only searched */
    if (s->record->extrema) {
        vi_extremes_of_flight(s, &flight, u);
    }
    if (state->follow_energies) {
        vi_energies_of_flight(s, &flight, held, u);
    }
    const bool near = meets && isfinite(found.moment);
    if (near) {
        vi_flight_end_near(&flight, &found.now, found.moment, state->q, state->p, &phase);
    } else {
        vi_phase further[VI_SINES_ROOM];
        vi_flight_further(&flight, u, further);
        vi_flight_end(&flight, u, drive.phase.angle + flight.angular_frequency * u, further, state->q, state->p);
    }
    if (!meets) {
        vi_flight_reach(&flight, state->now, state->q, state->p, state->origin);
        move(s, u, whole ? end : VI_ENDS_ANYWHERE, target);
        return true;
    }
    forget_origins(s);
    move(s, u, vi_ending_at(end, u, length, room), target);
    if (near) {
        vi_structure_phase_is(s, phase);
    }
    vi_structure_meet(s, found.contact, stops_here(s, target, request));
    return true;
}

/* ---- coupled motion ---- */

/* Set a mode to rest when the squares of its numbers would underflow. Between stops that take a share of its speed each
 * time it would go on until no digits are left. */
static void end_smallest(const vi_structure *s)
{
    vi_structure_state *state = s->state;
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        if (fabs(state->q[j]) < SMALLEST && fabs(state->p[j]) < SMALLEST) {
            state->q[j] = state->p[j] = 0.0;
        }
    }
}

static void drift(const vi_structure *s, vi_instant target, const vi_step_request *request)
{
    vi_ending end;
    vi_drift_event event;
    int k;
    const double length = segment_length(s, target, &end);
    const double room = end == VI_ENDS_AT_TARGET ? landing_room(s) : 0.0;
    const double u = vi_structure_drift(s, length, room, &event, &k);
    forget_origins(s);
    const bool whole = event == VI_DRIFT_NO_EVENT && u >= length;
    move(s, u, whole ? end : event == VI_DRIFT_NO_EVENT ? VI_ENDS_ANYWHERE : vi_ending_at(end, u, length, room), target);
    if (event != VI_DRIFT_NO_EVENT) {
        end_smallest(s);
    }
    switch (event) {
    case VI_DRIFT_NO_EVENT: break;
    case VI_DRIFT_ARRIVAL:
        vi_structure_meet(s, k, stops_here(s, target, request));
        break;
    case VI_DRIFT_RELEASE: vi_structure_release(s, k, 2); break;
    case VI_DRIFT_GENTLE_RELEASE: vi_structure_release(s, k, 3); break;
    /* with an acceleration, unless others hold it */
    case VI_DRIFT_LIFT: vi_structure_release(s, k, vi_structure_is_kept(s, k) ? 2 : 1); break;
    case VI_DRIFT_SEPARATION: vi_structure_separate(s, k, true); break;
    case VI_DRIFT_RETURN:
        vi_structure_return(s, k);
        break;
    case VI_DRIFT_FREE: s->state->status[k] = VI_CONTACT_FREE; break;
    }
}

/* Is any contact held, yielding, receding, or lifted only by a high derivative, or is the damping coupled? */
static bool is_coupled(const vi_structure *s)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        const int32_t status = s->state->status[k];
        if (status >= VI_CONTACT_HELD || (status == VI_CONTACT_TOUCHING && s->state->leaving[k] == 3)) {
            return true;
        }
    }
    return s->model->coupled;
}

/* ---- start ---- */

static void place(const vi_structure *s, int k)
{
    vi_structure_state *state = s->state;
    const double noise = VI_ROUNDING * vi_structure_displacement_size(s, k), clearance = vi_structure_clearance(s, k);
    if (s->model->stop[k] == VI_NO_STOP || clearance > noise) {
        return;
    }
    state->status[k] = VI_CONTACT_TOUCHING;
    if (clearance < -noise) { /* only a compliant stop may be pressed in at the start */
        state->status[k] = VI_CONTACT_YIELDING;
        vi_structure_touch_down(s, k);
    }
}

void vi_structure_start(const vi_structure *s, vi_instant now)
{
    vi_structure_state *state = s->state, fresh;
    memset(&fresh, 0, sizeof fresh);
    memcpy(fresh.q, state->q, sizeof fresh.q);
    memcpy(fresh.p, state->p, sizeof fresh.p);
    memcpy(fresh.held, state->held, sizeof fresh.held);
    memcpy(fresh.held_rate, state->held_rate, sizeof fresh.held_rate);
    fresh.degree = 1;
    fresh.loads_last = HUGE_VAL;
    fresh.further_at.periods = fresh.harmonics.first = INT64_MAX; /* no phase is known */
    fresh.follow_energies = state->follow_energies;
    fresh.exchange = state->exchange;
    fresh.now = fresh.held_since = fresh.input_since = now;
    fresh.phase = vi_phase_of(0.0);
    vi_budget_start(&fresh.budget, now);
    *state = fresh;
    vi_stop_motions_at(s, now);
    s->model->asks = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        const vi_law *law = vi_law_of(s->contacts[k].law.law);
        s->model->stop[k] = (int32_t)law->stop;
        s->model->press[k] = vi_law_press(law, &s->contacts[k].law);
        s->model->asks |= vi_contact_law_asks(s->contacts[k].law.law);
        vi_contact_clear(&s->contacts[k]);
        s->contacts[k].mass = s->model->mobility[k][k] > 0.0 ? 1.0 / s->model->mobility[k][k] : HUGE_VAL;
        place(s, k);
    }
}

/* ---- a step ---- */

/* Are the motion and its energy finite? */
static bool is_finite(const vi_structure *s)
{
    double sum = 0.0;
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        sum += fabs(s->state->q[j]) + s->state->p[j] * s->state->p[j];
    }
    return sum <= DBL_MAX;
}

/* Do the loads have finite squares? They occur under the root that gives the end of a contact's force. */
static bool loads_are_finite(const vi_structure *s)
{
    double sum = 0.0;
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        const double load = s->model->mode[j].force_size + fabs(s->state->held[j]);
        sum += load * load;
    }
    return sum <= DBL_MAX;
}

static void begin_step(const vi_structure *s)
{
    for (int point = 0; point < s->model->further; ++point) {
        const double *shape = s->model->shape[s->model->contacts + point];
        vi_record_point_begin(s->record, point, vi_structure_at(s->model, shape, s->state->q));
    }
    if (vi_record_begin_step(s->record, vi_structure_observed(s))) {
        vi_structure_begin_recording(s);
    }
    for (int k = 0; k < s->model->contacts; ++k) {
        s->contacts[k].event_time = NAN;
    }
    if (!s->state->budget.unfinished) {
        vi_structure_settle(s, true); /* the step is at its start */
    }
    if (s->record->periods && !s->record->period_open && s->state->now.rest == 0.0) {
        const int64_t impacts = s->record->period_impacts; /* of this instant */
        record_period(s);
        s->record->period_impacts = impacts;
    }
}

/* Make one flight or drift and resolve its end; VI_STEP_DONE when the step goes on. */
static vi_step_result move_on(const vi_structure *s, vi_instant target, const vi_step_request *request)
{
    vi_structure_state *state = s->state;
    const vi_step_result looked = vi_budget_look(&state->budget, &s->model->clock, state->now, s->model->impact_limit,
                                                 request);
    if (looked != VI_STEP_DONE) {
        return looked;
    }
    const bool coupled = is_coupled(s);
    if (s->sensitive != NULL) {
        vi_sensitivity_begin(s);
    }
    if (state->cascade.rounds > 0) {
        vi_structure_settle(s, stops_here(s, target, request)); /* impacts of this instant go on */
        return vi_clock_stands(&state->standstill, state->now) ? VI_STEP_STANDSTILL : VI_STEP_DONE;
    }
    if (coupled && loads_are_finite(s)) {
        drift(s, target, request);
    } else if (coupled || !(fly_far(s, target) || fly(s, target, request))) {
        return VI_STEP_NOT_FINITE;
    }
    int jammed[VI_PORTS];
    if (!is_finite(s)) {
        return VI_STEP_NOT_FINITE;
    }
    if (vi_structure_grows(s->model) && state->unbounded) {
        return VI_STEP_UNBOUNDED;
    }
    if (vi_structure_stops_move(s->model) && vi_structure_jams(s, VI_ROUNDING, jammed)) {
        return VI_STEP_STANDSTILL;
    }
    vi_structure_settle(s, stops_here(s, target, request));
    return vi_clock_stands(&state->standstill, state->now) ? VI_STEP_STANDSTILL : VI_STEP_DONE;
}

vi_step_result vi_structure_advance(const vi_structure *s, vi_instant target, const vi_step_request *request)
{
    begin_step(s);
    s->state->unbounded = VI_BOUNDED;
    vi_step_result result = VI_STEP_DONE;
    while (result == VI_STEP_DONE && !s->state->pending
           && vi_clock_is_before(s->state->now, target)) {
        const bool is_full = request->early_return && vi_record_ends_step(s->record);
        result = is_full ? VI_STEP_RECORD_FULL : move_on(s, target, request);
    }
    if (s->sensitive != NULL) {
        vi_sensitivity_end(s);
    }
    return vi_budget_end(&s->state->budget, result == VI_STEP_DONE && s->state->pending ? VI_STEP_CONTACT : result);
}

void vi_structure_outputs(const vi_structure *s, double acceleration[VI_MODES])
{
    double force[VI_PORTS];
    vi_structure_accelerate(s, acceleration, force);
    for (int k = 0; k < s->model->contacts; ++k) {
        vi_contact *contact = &s->contacts[k];
        const int32_t status = s->state->status[k];
        const bool on_stop = status == VI_CONTACT_TOUCHING || status == VI_CONTACT_HELD;
        const double *shape = s->model->shape[k];
        contact->displacement = on_stop ? vi_structure_stop_position(s, k)
                                        : vi_structure_at_body(s->model, shape, s->state->q);
        contact->velocity = status == VI_CONTACT_HELD ? vi_structure_stop_velocity(s, k, s->state->p)
                                                      : vi_structure_at_body(s->model, shape, s->state->p);
        contact->force = vi_max(0.0, force[k]);
        contact->open = vi_structure_is_open(s, k);
    }
}

void vi_structure_resolve(const vi_structure *s)
{
    int hit[VI_PORTS] = {0};
    for (int k = 0; k < s->model->contacts; ++k) {
        const bool touches = s->state->status[k] == VI_CONTACT_TOUCHING && !s->state->leaving[k];
        hit[k] = s->state->asking[k]
                 || (touches && vi_structure_approach(s, k) > VI_ROUNDING * vi_structure_velocity_size(s, k));
        s->state->asking[k] = 0;
        s->contacts[k].answered = 0;
    }
    s->state->pending = 0;
    vi_structure_resolve_hits(s, hit);
}
