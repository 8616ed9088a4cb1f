#include "body/one_mass/body.h"

#include <float.h>
#include <math.h>

#include "body/contact_events.h"
#include "body/landing.h"
#include "body/one_mass/impact.h"
#include "body/one_mass/rest.h"
#include "motion/majorant.h"

void vi_body_hold(vi_body *body, double held, double held_rate)
{
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        held -= vi_body_direction(body, k) * body->contacts[k].applied_force / body->mass;
    }
    body->held = held;
    body->held_rate = held_rate;
    body->held_since = body->now;
    body->budget.unfinished = 0;
}

void vi_body_drive(vi_body *body, double force, double angular_frequency)
{
    vi_instant *const past[] = {&body->held_since, &body->standstill.instant, &body->budget.mark};
    vi_clock_retune(&body->clock, angular_frequency, &body->now, past, sizeof past / sizeof past[0]);
    vi_mode_drive(&body->mode, force, angular_frequency);
    body->origin.known = 0;
    body->budget.unfinished = 0;
}

/* ---- flight ---- */

/* How long one segment may be, and what its end is. */
static double segment_length(const vi_body *body, vi_instant target, vi_ending *end)
{
    return vi_segment_length(&body->clock, body->now, target, body->record.periods, end);
}

/* Land on the contact found at clearance d and approach v: one step of the parabola that touches the motion there.
 * Returns the speed of approach, 0 for a touch. */
static double land(const vi_segment *segment, double sign, double clearance, vi_motion *m, double *u)
{
    const double v = sign * m->v, a = sign * m->a;
    const double square = v * v + 2.0 * a * clearance;
    *u += square >= 0.0 ? 2.0 * clearance / (v + sqrt(square)) : v / -a;
    if (square < 0.0) {
        return 0.0;
    }
    vi_segment_at(segment, *u, m);
    return fmax(0.0, sign * m->v);
}

/* First contact at or after `u` in the segment: its index, with *u and the approach velocity; -1 when there is none up to
 * *u, the end of the segment or of a long search. */
static int locate(vi_body *body, const vi_segment *segment, double *u, vi_motion *m, double *approach)
{
    for (int evaluation = 0; evaluation < VI_MOST_EVALUATIONS; ++evaluation) {
        double step = segment->length - *u;
        int nearest = -1, landing = -1;
        vi_budget_spend(&body->budget, 1);
        for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
            if (!vi_body_watched(body, k)) {
                continue;
            }
            const double sign = vi_body_direction(body, k), stop = body->contacts[k].position - segment->origin;
            const double clearance = vi_max(0.0, sign * (stop - m->x)), v = sign * m->v;
            const double scale = fabs(stop) + segment->scale;
            if (v > 0.0 && clearance <= VI_ROUNDING * scale) {
                *approach = land(segment, sign, clearance, m, u);
                return k;
            }
            const vi_approach state = {clearance, v, sign * m->a, sign * m->j, m->snap_bound};
            const double seconds = vi_seconds_to_landing(&state, segment->mode->fastest, scale);
            const double certified = vi_min(seconds, vi_certified_step(&state, step));
            if (certified < step) {
                step = certified;
                nearest = k;
                landing = certified == seconds ? k : -1;
            }
        }
        if (landing >= 0) {
            *u += step;
            *approach = vi_body_direction(body, landing) * (m->v + step * (m->a + 0.5 * step * m->j));
            return landing;
        }
        if (nearest >= 0 && *u + step == *u) {
            *approach = fmax(0.0, vi_body_direction(body, nearest) * m->v);
            return nearest;
        }
        *u = nearest >= 0 ? *u + step : segment->length;
        vi_segment_at(segment, *u, m);
        if (nearest < 0) {
            return -1;
        }
    }
    return -1;
}

/* Can no stop ever be reached again under the present input? */
static bool free_for_ever(const vi_body *body, const vi_segment *segment)
{
    double lowest, highest;
    if (body->record.extrema || body->record.periods || body->leaving
        || !vi_segment_range(segment, &lowest, &highest)) {
        return false;
    }
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        const double sign = vi_body_direction(body, k);
        const double furthest = sign > 0.0 ? highest : lowest;
        if (vi_body_watched(body, k) && sign * (body->contacts[k].position - furthest) <= 0.0) {
            return false;
        }
    }
    return true;
}

/* Move the body by u seconds to displacement x and velocity v; the two named ends are met exactly. */
static void move(vi_body *body, double u, double x, double v, vi_ending end, vi_instant target)
{
    const vi_instant after = end == VI_ENDS_AT_TARGET ? target : vi_clock_after(&body->clock, body->now, u);
    body->displacement = x;
    body->velocity = v;
    body->leaving = 0;
    /* a contact may be so close before a period's end that rounding puts it there */
    if (end == VI_ENDS_AT_PERIOD || (body->record.periods && after.periods > body->now.periods)) {
        body->now = (vi_instant){body->now.periods + 1, 0.0, 0.0};
        vi_record_period(&body->record, vi_clock_time(&body->clock, body->now), x, v);
    } else {
        body->now = after;
    }
}

static double landing_room(const vi_body *body)
{
    bool external = false;
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        external = external || body->contacts[k].law.law == VI_LAW_EXTERNAL;
    }
    return external ? vi_landing_room(vi_clock_time(&body->clock, body->now)) : 0.0;
}

/* A contact with an external law: stop there and wait, or (FMI 2.0) note its time and fly through. */
static void meet_external(vi_body *body, int k, double approach, bool stop_here)
{
    vi_contact *contact = &body->contacts[k];
    contact->event_time = vi_clock_time(&body->clock, body->now);
    contact->answered = 0;
    body->displacement = contact->position;
    body->velocity = vi_body_direction(body, k) * approach;
    if (stop_here) {
        body->pending = k + 1;
    } else {
        body->passed = k + 1;
    }
}

static void meet(vi_body *body, int k, double approach, double remaining, const vi_step_request *request)
{
    if (body->contacts[k].law.law == VI_LAW_EXTERNAL) {
        meet_external(body, k, approach, request->stop_at_contacts || fabs(remaining) <= landing_room(body));
    } else {
        vi_body_impact(body, k, approach, vi_contact_law_restitution(&body->contacts[k].law, approach));
    }
}

/* Does a body stay so close to the stop for a radian that rounding would decide where it is? */
static bool lingers(const vi_body *body, double position, double clearance, double acceleration, double held)
{
    const double time = 1.0 / body->mode.fastest;
    const double size = fabs(position) + body->mode.steady_amplitude + fabs(held) * time * time;
    return clearance + (fabs(body->velocity) + fabs(acceleration) * time) * time < VI_LINGERING * size;
}

/* A body about to meet a stop, or slow to leave it: how long to follow it from where it is, s; HUGE_VAL when that is
 * not needed. */
static double low_bounce(const vi_body *body, vi_phase phase, double held)
{
    double free_acceleration, slope;
    vi_mode_held(&body->mode, body->displacement, phase, held, body->held_rate, &free_acceleration, &slope);
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        if (!vi_body_watched(body, k)) {
            continue;
        }
        const double sign = vi_body_direction(body, k);
        const double clearance = fmax(0.0, sign * (body->contacts[k].position - body->displacement));
        const double flight = vi_parabola_root(clearance, sign * body->velocity, sign * free_acceleration);
        if (flight > 0.0 && flight * body->mode.fastest < VI_LOW_BOUNCE) {
            return 2.0 * flight;
        }
        if (lingers(body, body->contacts[k].position, clearance, free_acceleration, held)) {
            return 1.0 / body->mode.fastest;
        }
    }
    return HUGE_VAL;
}

/* A flight to the target over which no stop can be met: one evaluation, however long. */
static void fly_free(vi_body *body, const vi_segment *segment, vi_instant target)
{
    const vi_instant start = body->now;
    double x, v;
    vi_segment_end(segment, vi_clock_elapsed(&body->clock, body->now, target),
                   body->clock.angular_frequency * target.rest, &x, &v);
    move(body, 0.0, x, v, VI_ENDS_AT_TARGET, target);
    vi_origin_reach(&body->origin, segment, start, x, v);
}

/* Fly to the next contact, the end of the segment, or the target, whichever comes first; false where the motion goes
 * beyond the largest numbers. */
static bool fly(vi_body *body, vi_instant target, const vi_step_request *request)
{
    vi_ending end;
    const double length = segment_length(body, target, &end);
    const double room = end == VI_ENDS_AT_TARGET ? landing_room(body) : 0.0;
    const vi_phase phase = vi_body_phase_now(body);
    const double held = vi_body_held_now(body), bounce = low_bounce(body, phase, held);
    vi_segment segment;
    vi_segment_start(&segment, &body->mode, body->displacement, body->velocity, phase, held, body->held_rate,
                     vi_min(length + room, bounce), bounce < HUGE_VAL);
    const vi_instant start = body->now;
    vi_since since = {start, 0.0, 0.0};
    vi_origin_follow(&body->origin, &segment, &body->clock, start, body->displacement, body->velocity, &since);
    if (free_for_ever(body, &segment)) {
        fly_free(body, &segment, target);
        return isfinite(body->displacement) && isfinite(body->velocity);
    }
    vi_motion m;
    vi_segment_first(&segment, body->displacement, body->velocity, &m);
    double u = 0.0, approach = 0.0;
    if (body->leaving) {
        m.a = 0.0; /* exactly: that is what released it */
    }
    if (!isfinite(m.snap_bound) || !isfinite(segment.scale) || !isfinite(m.j)) {
        return false;
    }
    const int k = locate(body, &segment, &u, &m, &approach);
    const bool whole = k < 0 && u >= length;
    if (whole && room > 0.0) {
        u = length; /* the room after the end was only searched */
        vi_segment_at(&segment, length, &m);
    }
    const double end_displacement = vi_body_within(body, segment.origin + m.x);
    if (body->record.extrema) {
        vi_body_follow_extrema(body, &segment, u);
        vi_record_extend(&body->record, k < 0 ? end_displacement : body->contacts[k].position);
    }
    if (k < 0) {
        move(body, u, end_displacement, m.v, whole ? end : VI_ENDS_ANYWHERE, target);
        vi_origin_reach(&body->origin, &segment, start, segment.origin + m.x, m.v);
    } else {
        body->origin.known = 0;
        move(body, u, body->contacts[k].position, vi_body_direction(body, k) * approach,
             vi_ending_at(end, u, length, room), target);
        meet(body, k, approach, vi_clock_elapsed(&body->clock, body->now, target), request);
    }
    return isfinite(body->displacement) && isfinite(body->velocity);
}

/* ---- rest on a stop ---- */

static void release(vi_body *body)
{
    vi_contact *contact = &body->contacts[body->stuck - 1];
    vi_contact_lift(contact, &body->clock, body->now);
    vi_record_stick(&body->record, contact->stick_start, contact->stick_end, body->stuck, body->tail_impulse);
    body->stuck = 0;
    body->leaving = 1;
}

static void stay(vi_body *body, vi_instant target)
{
    const int k = body->stuck - 1;
    const double stop = body->contacts[k].position;
    if (vi_body_lifted(body, k)) {
        release(body);
        body->leaving = 0; /* its acceleration is not 0 */
        return;
    }
    if (!body->record.periods && vi_body_pressed_for_ever(body, k)) {
        body->now = target;
        return;
    }
    vi_ending end;
    bool released;
    const double length = segment_length(body, target, &end);
    const double u = vi_body_time_to_release(body, k, length, &released);
    move(body, u, stop, 0.0, u >= length ? end : VI_ENDS_ANYWHERE, target);
    if (released) {
        release(body);
    }
}

/* ---- on a stop at the start of a step, or after its inputs changed ---- */

/* What a body that touches stop k does now: hit it, rest on it, or leave it. */
static void settle(vi_body *body, int k, const vi_step_request *request)
{
    const vi_contact *contact = &body->contacts[k];
    const double sign = vi_body_direction(body, k), approach = sign * body->velocity;
    if (approach > 0.0) {
        meet(body, k, approach, 0.0, request);
        return;
    }
    if (approach < 0.0) {
        return;
    }
    const double held = vi_body_held_now(body);
    double pressure, slope;
    vi_mode_held(&body->mode, contact->position, vi_body_phase_now(body), held, body->held_rate, &pressure, &slope);
    const double noise = vi_body_pressure_noise(body, contact->position);
    const bool leaves = sign * slope < 0.0 || body->leaving;
    if (sign * pressure > noise || (sign * pressure >= -noise && !leaves)) {
        body->leaving = 0;
        vi_body_stick(body, k, 0.0, 0.0);
    } else {
        body->leaving = sign * pressure >= -noise;
    }
}

static void settle_all(vi_body *body, const vi_step_request *request)
{
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        if (!body->stuck && !body->pending && vi_body_watched(body, k)
            && body->displacement == body->contacts[k].position) {
            settle(body, k, request);
        }
    }
}

void vi_body_start(vi_body *body, vi_instant now, double displacement, double velocity)
{
    body->now = body->held_since = now;
    body->standstill = (vi_standstill){now, 0};
    vi_budget_start(&body->budget, now);
    body->origin.known = 0;
    body->displacement = displacement;
    body->velocity = velocity;
    body->stuck = body->leaving = body->pending = body->passed = 0;
    body->fastest_impact = body->tail_impulse = 0.0;
    body->low_impacts = 0;
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        vi_contact_clear(&body->contacts[k]);
        body->contacts[k].mass = body->mass;
    }
}

/* ---- a step ---- */

static void open_first_period(vi_body *body)
{
    if (body->record.periods && !body->record.period_open && body->now.rest == 0.0) {
        vi_record_period(&body->record, vi_clock_time(&body->clock, body->now), body->displacement, body->velocity);
    }
}

static void begin_step(vi_body *body, const vi_step_request *request)
{
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        body->contacts[k].event_time = NAN;
    }
    vi_record_begin_step(&body->record, body->displacement);
    if (!body->budget.unfinished) {
        settle_all(body, request);
    }
    open_first_period(body);
}

/* One flight or rest; VI_STEP_DONE when the step goes on. */
static vi_step_result move_on(vi_body *body, vi_instant target, const vi_step_request *request)
{
    const vi_step_result looked = vi_budget_look(&body->budget, &body->clock, body->now, body->impact_limit, request);
    if (looked != VI_STEP_DONE) {
        return looked;
    }
    vi_budget_spend(&body->budget, 1);
    if (body->stuck) {
        stay(body, target);
    } else if (!fly(body, target, request)) {
        return VI_STEP_NOT_FINITE;
    }
    return vi_clock_stands(&body->standstill, body->now) ? VI_STEP_STANDSTILL : VI_STEP_DONE;
}

vi_step_result vi_body_advance(vi_body *body, vi_instant target, const vi_step_request *request)
{
    begin_step(body, request);
    /* a record that is full already was not emptied by the importer: ending the step again would end it for ever */
    const bool ends_when_full = request->early_return && !vi_record_full(&body->record);
    vi_step_result result = VI_STEP_DONE;
    while (result == VI_STEP_DONE && !body->pending && vi_clock_elapsed(&body->clock, body->now, target) > 0.0) {
        result = ends_when_full && vi_record_full(&body->record) ? VI_STEP_RECORD_FULL
                                                                 : move_on(body, target, request);
    }
    return vi_budget_end(&body->budget, result == VI_STEP_DONE && body->pending ? VI_STEP_CONTACT : result);
}

void vi_body_complain(const vi_body *body, char message[VI_MESSAGE_LENGTH])
{
    int on_stop[VI_BODY_CONTACTS];
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        on_stop[k] = vi_body_watched(body, k) && body->displacement == body->contacts[k].position;
    }
    vi_complain_of_standstill(message, vi_clock_time(&body->clock, body->now), on_stop, VI_BODY_CONTACTS);
}

void vi_body_resolve(vi_body *body)
{
    const int k = body->pending - 1;
    body->pending = 0;
    body->contacts[k].answered = 0;
    vi_body_impact(body, k, fabs(body->velocity), body->contacts[k].applied_restitution);
}

void vi_body_take_impulses(vi_body *body)
{
    for (int k = 0; k < VI_BODY_CONTACTS && !body->pending; ++k) {
        vi_contact *contact = &body->contacts[k];
        if (contact->applied_impulse == 0.0) {
            continue;
        }
        if (body->stuck) {
            release(body);
        }
        body->velocity += contact->applied_impulse / body->mass;
        body->leaving = 0;
        body->origin.known = 0;
        vi_contact_struck(contact, vi_clock_time(&body->clock, body->now));
    }
}

double vi_body_outputs(vi_body *body)
{
    const vi_mode *mode = &body->mode;
    double free_acceleration, slope;
    vi_mode_held(mode, body->displacement, vi_body_phase_now(body), vi_body_held_now(body), body->held_rate,
                 &free_acceleration, &slope);
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        vi_contact *contact = &body->contacts[k];
        contact->displacement = body->displacement;
        contact->velocity = body->velocity;
        const double pressure = vi_body_direction(body, k) * free_acceleration;
        contact->force = body->stuck == k + 1 ? fmax(0.0, body->mass * pressure) : 0.0;
    }
    return body->stuck ? 0.0 : free_acceleration - 2.0 * mode->decay * body->velocity;
}
